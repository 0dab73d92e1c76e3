"""Draw the pictures of README and documentation again, with the present engine: `make figures`."""

import runpy
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt

import vibroimpact as vi

DOCS = Path(__file__).parent
IMAGES = DOCS / "images"

# Most are those of the gallery: a script, and the pictures that it leaves, in order.
PICTURES = {
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


def draw(script: str, names: list[str]) -> None:
    """Run a script of the gallery and keep the first figures that it leaves."""
    plt.close("all")
    runpy.run_path(str(DOCS.parent / "examples" / f"{script}.py"), run_name="__main__")
    for number, name in zip(plt.get_fignums(), names, strict=False):
        vi.plotting.save_figure(plt.figure(number), IMAGES / f"{name}.png", dpi=110, overwrite=True)


def main() -> None:
    """Draw all pictures into docs/images/."""
    IMAGES.mkdir(exist_ok=True)
    plt.show = lambda: None  # a script shows its figures at the end
    vi.plotting.save_figure(vi.plotting.oscillator_sketch(), IMAGES / "model.png", dpi=110, overwrite=True)
    for script, names in PICTURES.items():
        draw(script, names)
    for script in ("machine_pictures.py", "explorer_picture.py"):
        runpy.run_path(str(DOCS / script), run_name="__main__")


if __name__ == "__main__":
    main()
