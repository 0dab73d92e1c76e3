"""Draw the pictures of README and documentation anew, with the engine as it is: `make figures`."""

import runpy
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi
from vibroimpact.motion import recognise

DOCS = Path(__file__).parent
IMAGES = DOCS / "images"


def stability_map() -> plt.Figure:
    """Draw Std over driving frequency and mass, finely."""
    sweep = vi.parameter_map(
        vi.ImpactOscillator(), omega=np.linspace(0.5, 5, 360), mass=np.linspace(0.1, 5, 240), sample_impacts=2000
    )
    axes = vi.plotting.index_contour(sweep, "std", reference={"mass": 1.0})
    return axes.get_figure()


def std() -> plt.Figure:
    """Draw the three things that Std hides: more than one impact a cycle, the cut of a chatter, the start."""
    figure, axes = plt.subplots(1, 3, figsize=(13, 4.2), layout="constrained")
    osc = vi.ImpactOscillator()
    _two_impacts(axes[0], osc.replace(omega=1.0))
    _cuts(axes[1], osc)
    _starts(axes[2], osc.replace(omega=3.0))
    return figure


def _two_impacts(ax: plt.Axes, osc: vi.ImpactOscillator) -> None:
    hits = vi.impact_section(osc, sample_impacts=12)
    std = float(hits["velocity"].std())
    ax.stem((hits["time"] - hits["time"][0]) / osc.period, hits["velocity"], basefmt=" ")
    ax.set(ylim=(0, None), xlabel="driving periods", ylabel="impact velocity [m/s]")
    ax.set_title(f"w = 1: {recognise(vi.impact_section(osc)).name}, stable, Std = {std:.3f}")


def _cuts(ax: plt.Axes, osc: vi.ImpactOscillator) -> None:
    cuts = np.logspace(-2, -9, 29)
    std = [vi.parameter_map(osc, omega=[0.1], tolerances=vi.Tolerances(chatter=cut))["std"].item() for cut in cuts]
    ax.semilogx(cuts, std, "o-", markersize=4)
    ax.set(ylim=(0, None), xlabel="slowest impact counted, relative to V", ylabel="Std [m/s]")
    ax.set_title("w = 0.1, chattering: one motion, any Std")


def _starts(ax: plt.Axes, osc: vi.ImpactOscillator) -> None:
    drawn: dict[str, list[tuple[float, float, float]]] = {"sticking": [], "periodic": []}
    for phase in np.linspace(0, 1, 40, endpoint=False):
        for velocity in np.linspace(0.05, 2, 20):
            start = vi.State(osc.gap, velocity, phase * osc.period)
            hits = vi.impact_section(osc, start=start, transient_impacts=2000, sample_impacts=500)
            kind = "sticking" if hits.sizes["stick"] else "periodic"
            drawn[kind].append((phase, velocity, float(hits["velocity"].std())))
    total = sum(map(len, drawn.values()))
    for (kind, points), colour in zip(drawn.items(), ("#d55e00", "#0072b2"), strict=True):
        phase, velocity, std = np.array(points).T
        text = f"{kind}: {100 * len(points) / total:.0f} % of starts, Std {std.mean():.3f}"
        ax.scatter(phase, velocity, s=9, marker="s", color=colour, linewidths=0, label=text)
    ax.set(xlabel="phase of first impact", ylabel="velocity of first impact [m/s]", title="w = 3: two motions")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), fontsize=9)


def main() -> None:
    """Draw all pictures into docs/images/."""
    IMAGES.mkdir(exist_ok=True)
    tube = runpy.run_path(str(DOCS.parent / "examples" / "tube_in_support.py"))
    osc = tube["tube"]()
    results = tube["hardest_hits"](osc), tube["pass_through"](osc, "up"), tube["pass_through"](osc, "down")
    pictures = {"stability-map": stability_map(), "std": std(), "tube-in-support": tube["draw"](osc, *results)}
    pictures["model"] = vi.plotting.oscillator_sketch().get_figure()
    for name, figure in pictures.items():
        vi.plotting.save_figure(figure, IMAGES / f"{name}.png", dpi=110, overwrite=True)


if __name__ == "__main__":
    main()
