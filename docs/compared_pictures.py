"""Draw three pictures that compare: with a published figure, with a reference solution, and cost against accuracy."""

import doctest
import json
import re
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

import vibroimpact as vi
from vibroimpact.plotting.style import BLUE, GREEN, INK, RED

DOCS = Path(__file__).parent
MEASURED = DOCS.parent / "benchmarks" / "results" / "latest.json"
ENGINES = {"fixed-step": "by the paper's scheme: Runge-Kutta, step 0.5 ms", "cpu": "exactly"}
# What is drawn of the benchmark: its colour, and where its name stands, in points from the mark.
DRAWN = {
    "ours, one core": (BLUE, (8, -3)),
    "ours, one orbit": (BLUE, (8, -3)),
    "heyoka, one orbit": (GREEN, (8, 3)),
    "heyoka, batch": (GREEN, (-8, -12)),
    "the paper's scheme": (RED, (-8, 8)),
    "SciPy DOP853, one orbit": (INK, (-8, 8)),
}


def published_figure(omega: Any = None, sample_impacts: int = 1000) -> Figure:
    """Return figure 10 of Lee's paper, Std over the impact velocities, drawn by the paper's scheme and exactly.

    The paper gives no initial conditions. Released at the stop, the scheme rattles there for more impacts than it
    keeps, so the mass starts clear of it. Of the 5000 impacts that the paper keeps, 1000 are enough for a picture.
    """
    figure, panels = plt.subplots(2, 1, figsize=(8.0, 7.6), sharex=True, sharey=True, layout="constrained")
    axis = {"omega": np.linspace(0.02, 5.0, 125) if omega is None else omega}
    for ax, (engine, title) in zip(panels, ENGINES.items(), strict=True):
        how = {"start": vi.State(-1.0), "backend": engine, "transient_impacts": 100, **axis}
        diagram = vi.bifurcation_diagram(vi.ImpactOscillator(), **how, sample_impacts=100)
        sweep = vi.parameter_map(vi.ImpactOscillator(), **how, sample_impacts=sample_impacts)
        vi.plotting.diagram_with_index(diagram, sweep, ax=ax)
        ax.set_title(title, fontsize=10, loc="left")
    panels[0].get_legend().remove()
    panels[0].set_xlabel("")
    panels[0].set_ylim(0.0, 8.0)
    return figure


def cost_and_accuracy(measured: dict[str, Any]) -> Figure:
    """Return the cost of an impact over the error of the first twenty of a chaotic motion, of each contender."""
    figure, ax = plt.subplots(figsize=(7.2, 4.6), layout="constrained")
    for row in measured["contenders"]:
        if row["name"] in DRAWN and row["cost"]:
            color, away = DRAWN[row["name"]]
            place = row["error_first_20"], row["cost"]["chaotic"]["ns"]
            ax.loglog(*place, "o", color=color, markersize=8)
            side = "left" if away[0] > 0 else "right"
            ax.annotate(row["name"], place, away, textcoords="offset points", ha=side, color=color, fontsize=9)
    ax.set(xlim=(1e-16, 1.0), ylim=(10.0, 1e7))
    ax.set_xlabel("error of the first 20 impacts of a chaotic motion [m/s]")
    ax.set_ylabel("time per impact [ns]")
    ax.set_title(f"w = 2.8, {measured['machine']['processor']}, measured {measured['date'][:10]}", fontsize=9)
    ax.grid(color="#e8e8e8")
    return figure


def turning_beam() -> Figure:
    """Return the tip of the beam that turns onto a spring, with the points of the reference, from the page itself."""
    page, names = (DOCS / "about" / "verification.md").read_text(encoding="utf-8"), {}
    for block in re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL):
        if "beam_modes" in block:
            exec(doctest.script_from_examples(block), names)
    rows = re.findall(r"^\| (\d+) \| (\S+) \| \S+ \| \S+ \| (\S+) \| \S+ \| \S+ \|$", page, re.MULTILINE)
    time, *published = np.array(rows, float).T
    figure, ax = plt.subplots(figsize=(7.2, 3.8), layout="constrained")
    for stiffness, points, color in zip((18000.0, 45000.0), published, (BLUE, RED), strict=True):
        curve = names["tip"](stiffness, samples=50)
        ax.plot(np.linspace(0.0, 12.0, len(curve)), curve, color=color, label=f"spring of {stiffness:,.0f} N/m")
        ax.plot(time, points, "o", color=color, markersize=5)
    ax.axhline(0.0, color=INK, linewidth=0.8)
    ax.set(xlim=(0.0, 12.5), xlabel="time [ms]", ylabel="displacement of the tip [mm]")
    ax.legend()
    return figure


def main() -> None:
    """Draw all into docs/images/."""
    pictures = {
        "published-figure": published_figure(),
        "turning-beam": turning_beam(),
        "cost-and-accuracy": cost_and_accuracy(json.loads(MEASURED.read_text(encoding="utf-8"))),
    }
    for name, figure in pictures.items():
        vi.plotting.save_figure(figure, DOCS / "images" / f"{name}.png", dpi=110, overwrite=True)


if __name__ == "__main__":
    main()
