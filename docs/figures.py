"""Draw the pictures of README and documentation again, with the present engine: `make figures`.

What each of the gallery's and of the home page shows, in `images/structure.json`, is compared by tests with what its
program draws.
"""

import json
import re
import runpy
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt

import vibroimpact as vi

DOCS = Path(__file__).parent
IMAGES = DOCS / "images"

# Most are those of the gallery: a script, or a page whose program it is, and the pictures that it leaves, in order.
PICTURES = {
    "index.md": ["hardest-hit"],
    "guide/response.md": ["response"],
    "guide/supports.md": ["supports"],
    "guide/free_vibration.md": ["free-vibration"],
    "applications/tube_in_support": ["tube-in-support"],
    "applications/tube_in_two_supports": ["tube-in-two-supports"],
    "applications/two_designs": ["verdict"],
    "applications/rig_with_a_beam": ["compliant"],
    "ideas/stability_map": ["stability-map"],
    "ideas/what_std_hides": ["std"],
    "ideas/names_and_exponents": ["classes", "exponents"],
    "ideas/unstable_orbits": ["orbits"],
    "ideas/exact_boundaries": ["continuation"],
    "ideas/twins": ["pitchforks"],
    "ideas/two_motions": ["coexistence"],
    "ideas/basins_between_stops": ["basins-of-two-stops"],
    "ideas/refined_map": ["refinement"],
    "ideas/quasi_periodic": ["quasi-periodic"],
    "ideas/modes_and_restitution": ["restitution"],
    "ideas/laws_of_restitution": ["laws"],
}


STRUCTURE = IMAGES / "structure.json"


def structure(figure: Any) -> list[dict[str, Any]]:
    """Return what each axes of a figure show: texts, limits to four digits, and how many artists of each kind."""
    figure.draw_without_rendering()
    return [
        {
            "title": ax.get_title(),
            "labels": [ax.get_xlabel(), ax.get_ylabel()],
            "limits": [float(f"{end:.4g}") for end in (*ax.get_xlim(), *ax.get_ylim())],
            "legend": [text.get_text() for text in (ax.get_legend().get_texts() if ax.get_legend() else [])],
            "artists": [len(part) for part in (ax.lines, ax.collections, ax.patches, ax.images, ax.texts)],
        }
        for ax in figure.axes
    ]


def run(script: str) -> None:
    """Run a script of the gallery, or the program that a page shows, whose files are not kept."""
    if script.endswith(".md"):
        program = re.search(r"^```python\n(.*?)^```$", (DOCS / script).read_text("utf-8"), re.MULTILINE | re.DOTALL)
        with TemporaryDirectory() as folder, chdir(folder):
            exec(compile(program[1], script, "exec"), {})  # type: ignore[index]
    else:
        runpy.run_path(str(DOCS.parent / "examples" / f"{script}.py"), run_name="__main__")


def draw(script: str, names: list[str]) -> dict[str, Any]:
    """Run a script, keep the first figures that it leaves, and return what they show."""
    plt.close("all")
    run(script)
    shown = {}
    for number, name in zip(plt.get_fignums(), names, strict=False):
        figure = plt.figure(number)
        shown[name] = structure(figure)
        vi.plotting.save_figure(figure, IMAGES / f"{name}.png", dpi=110, overwrite=True)
    return shown


def main() -> None:
    """Draw all pictures into docs/images/."""
    IMAGES.mkdir(exist_ok=True)
    plt.show = lambda: None  # a script shows its figures at the end
    vi.plotting.save_figure(vi.plotting.oscillator_sketch(), IMAGES / "model.png", dpi=110, overwrite=True)
    shown = {name: parts for script, names in PICTURES.items() for name, parts in draw(script, names).items()}
    STRUCTURE.write_text(json.dumps(shown, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    for script in ("compared_pictures.py", "machine_pictures.py", "explorer_picture.py"):
        runpy.run_path(str(DOCS / script), run_name="__main__")


if __name__ == "__main__":
    main()
