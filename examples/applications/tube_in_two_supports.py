"""
A tube in two supports
======================

A heat-exchanger tube between two supports: three modes and four stops.

The tube of ``tube_in_support.py`` (18 Hz, 1 % damping, 5 N from a pump at its middle) is now a span of 4.2 kg, pinned
at both ends, whose first mode has the effective mass of 2.1 kg that stood there alone. It passes through
two supports, at 0.35 and 0.7 of its length, with the same clearance above and below.

What the model leaves out: hard stops with one restitution, which holds for three modes and for no other number of them;
motion in one plane; friction in the supports.
"""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import vibroimpact as vi
from vibroimpact.report import sentences_of

SPAN_MASS, FIRST, DAMPING_RATIO, FORCE, RESTITUTION = (
    4.2,
    18.0,
    0.01,
    5.0,
    0.7,
)  # kg, Hz, 1, N, 1
PLACES = {"pump": 0.5, "first": 0.35, "second": 0.7}  # of the length
MODES = np.arange(1, 4)


# %%
# The tube as a family: its clearance and the pump speed are parameters.


@vi.family(units={"clearance": "m", "frequency": "Hz"})
def tube(clearance: float = 0.5e-3, frequency: float = 20.0) -> vi.ImpactSystem:
    """Return the tube with its clearance above and below in both supports."""
    shapes = np.sqrt(2.0 / SPAN_MASS) * np.sin(
        np.pi * np.outer(list(PLACES.values()), MODES)
    )
    stops = [
        vi.Stop(
            direction={support: sign},
            gap=clearance,
            restitution=RESTITUTION,
            name=f"{support}_{side}",
        )
        for support in ("first", "second")
        for side, sign in (("upper", 1.0), ("lower", -1.0))
    ]
    return vi.ImpactSystem.from_modes(
        frequencies=FIRST * MODES**2,  # Hz: 18, 72, 162
        damping_ratios=DAMPING_RATIO,
        shapes=shapes,  # a row per place, a column per mode
        points=list(PLACES),
        force=vi.Force(frequency=frequency, harmonics={1: {"pump": FORCE}}),
        stops=stops,
    )


# %%
# A map over both, and what is drawn of it.


def hardest_hits(points: int) -> xr.Dataset:
    """Return the hardest settled hit over pump speed and clearance."""
    axes = {
        "frequency": np.linspace(10.0, 40.0, points),
        "clearance": np.linspace(0.2e-3, 1.5e-3, points),
    }
    return vi.parameter_map(
        tube,
        indices=["max_velocity"],
        transient_impacts=500,
        sample_impacts=500,
        **axes,
    )


def draw(hits: xr.Dataset) -> plt.Figure:
    """Draw the motion in the first support at 20 Hz, its impacts on all four stops, and the hardest hits."""
    figure, axes = plt.subplots(1, 3, figsize=(15.0, 4.6), layout="constrained")
    motion = vi.simulate(tube, periods=10)
    vi.plotting.time_history(motion, stop="first_upper", ax=axes[0])
    vi.plotting.impact_map(
        vi.impact_section(tube, transient_impacts=2000, sample_impacts=300), ax=axes[1]
    )
    vi.plotting.index_contour(hits, "max_velocity", reference={}, ax=axes[2])
    for ax, title in zip(
        axes,
        ("In the first support", "Impacts at 20 Hz", "Hardest hit, from rest"),
        strict=True,
    ):
        ax.set_title(title)
    return figure


# %%
# How often each stop is struck, and how hard.


def main() -> None:
    """Compute, tell and draw."""
    section = vi.impact_section(tube, transient_impacts=2000, sample_impacts=600)
    print("\n".join(sentences_of(section)))
    counts = [int((section["stop"] == name).sum()) for name in tube.at().stop_names]
    assert counts == [
        200,
        200,
        100,
        100,
    ]  # the first support is struck twice as often as the second
    hits = hardest_hits(48)
    print(f"hardest hit of all: {float(hits['max_velocity'].max()):.3f} m/s")
    draw(hits)
    plt.show()


if __name__ == "__main__":
    main()
