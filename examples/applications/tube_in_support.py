"""
A tube in its support
=====================

Which clearance and which pump speeds keep a heat-exchanger tube from rattling hard against its support?

The tube's first bending mode (2.1 kg, 18 Hz, 1 % damping) is shaken with 5 N by a pump that runs at 600 to
2400 rpm, once a revolution. A support bar stands beside it, 0.5 mm away as drawn; steel on steel gives back
some 0.7 of the speed. Hits above 50 mm/s are taken to be the ones that wear the tube through.

What the model leaves out: the support is hard (a contact lasts no time; right while it is much shorter than the
period of the mode), the restitution is one number, and there is one mode, moving in one direction, with a stop
on one side. Read the frequencies and the order of the velocities from it, not their third digit.
"""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import vibroimpact as vi

MASS, NATURAL_FREQUENCY, DAMPING_RATIO = 2.1, 18.0, 0.01  # kg, Hz, 1
FORCE, RESTITUTION, CLEARANCE = 5.0, 0.7, 0.5e-3  # N, 1, m
HARD = 0.05  # m/s
DUTY = 25.0  # Hz, 1500 rpm
KNOCK = vi.State(
    displacement=-0.5e-3, velocity=0.2
)  # as a valve slamming nearby would leave it
SPEEDS = np.linspace(10.0, 40.0, 121)  # Hz
CLEARANCES = np.linspace(-0.3e-3, 1.5e-3, 91)  # m; negative: pressed against the bar


# %%
# The tube, as one mass on a spring in front of its support.


def tube() -> vi.ImpactOscillator:
    """Return the tube as the seven numbers, in SI units."""
    stiffness = MASS * (2 * np.pi * NATURAL_FREQUENCY) ** 2
    return vi.ImpactOscillator(
        mass=MASS,
        damping=2 * DAMPING_RATIO * np.sqrt(stiffness * MASS),
        stiffness=stiffness,
        amplitude=FORCE,
        frequency=DUTY,
        restitution=RESTITUTION,
        gap=CLEARANCE,
    )


# %%
# A map over pump speed and clearance, and sweeps with the speed rising and falling.


def hardest_hits(osc: vi.ImpactOscillator) -> xr.Dataset:
    """Return the hardest settled hit over pump speed and clearance, the worse of two starts."""
    window = {"transient_impacts": 500, "sample_impacts": 1000}
    axes = {"frequency": SPEEDS, "gap": CLEARANCES}
    rest = vi.parameter_map(osc, indices=["max_velocity"], **window, **axes)
    knocked = vi.parameter_map(
        osc, indices=["max_velocity"], start=KNOCK, **window, **axes
    )
    worse = rest["max_velocity"].fillna(0) > knocked["max_velocity"].fillna(0)
    return xr.where(worse, rest, knocked, keep_attrs=True).assign_attrs(knocked.attrs)


def pass_through(osc: vi.ImpactOscillator, direction: str) -> xr.DataArray:
    """Return the hits while the pump speed creeps up or down, the motion carried along."""
    frequencies = np.linspace(10.0, 40.0, 301)
    diagram = vi.bifurcation_diagram(
        osc,
        direction=direction,
        transient_impacts=300,
        sample_impacts=100,
        frequency=frequencies,
    )
    return diagram["velocity"]


# %%
# The results in words: speeds with hard hits, and the two motions at the duty speed.


def stretches(values: np.ndarray, chosen: np.ndarray, scale: float, digits: int) -> str:
    """Return in words the runs of neighbouring values that are chosen, such as '1 to 2 and 4 to 7'."""
    edges = np.flatnonzero(
        np.diff(np.concatenate([[False], chosen, [False]]).astype(int))
    )
    ends = [
        (values[low] * scale, values[high - 1] * scale)
        for low, high in edges.reshape(-1, 2)
    ]
    texts = [
        f"{low:.{digits}f}" + (f" to {high:.{digits}f}" if high > low else "")
        for low, high in ends
    ]
    return (
        " and ".join([", ".join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)
        or "none"
    )


def rpm(hits: xr.DataArray, limit: float) -> str:
    """Return in words the pump speeds in rpm with a hit above the limit."""
    hard = hits > limit
    return stretches(
        hits["frequency"].values,
        (hard.any("impact") if "impact" in hits.dims else hard).values,
        60.0,
        0,
    )


def two_motions(osc: vi.ImpactOscillator) -> str:
    """Return in words what the tube does at its duty speed, from rest and after a knock."""
    sections = [
        vi.impact_section(osc, start=start, transient_impacts=500, sample_impacts=200)
        for start in (None, KNOCK)
    ]
    rest, knocked = (vi.recognise(section).sentence(osc.period) for section in sections)
    time, speeds = sections[1]["time"].values, sections[1]["velocity"].values
    lost = (
        osc.mass
        / 2
        * (1 - osc.restitution**2)
        * (speeds[1:] ** 2).sum()
        / (time[-1] - time[0])
    )
    return f"From rest: {rest}. After a knock: {knocked}; {lost * 1e3:.0f} mW go into the contact."


def verdict(
    osc: vi.ImpactOscillator, hits: xr.Dataset, up: xr.DataArray, down: xr.DataArray
) -> list[str]:
    """Return the answer in words."""
    resonant = osc.replace(frequency=NATURAL_FREQUENCY).steady_amplitude
    as_drawn = hits["max_velocity"].sel(gap=CLEARANCE, method="nearest")
    gentle = ~(hits["max_velocity"] > HARD).any("frequency").values
    silent = (hits["status"] == vi.Status.STUCK_FOREVER).all("frequency").values
    lightest = CLEARANCES[silent].max()
    return [
        f"{FORCE:g} N bend the tube {osc.amplitude / osc.stiffness * 1e3:.2f} mm; without the support it would swing "
        f"{resonant * 1e3:.1f} mm at {NATURAL_FREQUENCY:g} Hz.",
        f"With {CLEARANCE * 1e3:g} mm clearance, pump running up: hard hits (above {HARD * 1e3:g} mm/s) at "
        f"{rpm(up, HARD)} rpm, the hardest of {float(up.max()) * 1e3:.0f} mm/s.",
        f"Coasting down: hard hits at {rpm(down, HARD)} rpm, the hardest of {float(down.max()) * 1e3:.0f} mm/s.",
        f"The difference is history: at {DUTY * 60:.0f} rpm two motions are possible. {two_motions(osc)}",
        f"Speeds to stay out of, whatever came before (two starts tried): {rpm(as_drawn, HARD)} rpm.",
        f"Clearances gentle at every speed: {stretches(CLEARANCES, gentle, 1e3, 2)} mm (negative: pressed against "
        "the bar). Every other one tried has hard hits at some speed.",
        f"Best: press the tube against the bar by {-lightest * 1e3:.2f} mm ({-lightest * osc.stiffness:.1f} N). "
        "Even after the knock it comes to rest there and never lifts off again, at any speed.",
    ]


# %%
# The figure, then the whole program.


def draw(
    osc: vi.ImpactOscillator, hits: xr.Dataset, up: xr.DataArray, down: xr.DataArray
) -> plt.Figure:
    """Draw hits over clearance and speed, and those of one clearance on the way up and down."""
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(12.5, 5.2), layout="constrained"
    )
    in_mm = hits.assign_coords(
        gap=("gap", CLEARANCES * 1e3, {**hits["gap"].attrs, "units": "mm"})
    )
    vi.plotting.index_contour(in_mm, "max_velocity", level=HARD, reference={}, ax=left)
    left.axhline(CLEARANCE * 1e3, color="#d55e00", linestyle="--")
    left.text(36, CLEARANCE * 1e3 + 0.02, "as drawn", weight="bold", ha="right")
    left.set_title("Hardest hit, from rest or after a knock")
    for hits_there, color, way in (
        (up, "#0072b2", "running up"),
        (down, "#d55e00", "coasting down"),
    ):
        x = np.repeat(hits_there["frequency"].values, hits_there.sizes["impact"])
        size = 9 if way == "running up" else 3
        right.scatter(
            x,
            hits_there.values.ravel() * 1e3,
            s=size,
            color=color,
            linewidths=0,
            label=way,
        )
    right.axhline(HARD * 1e3, color="0.4", linestyle=":", label="hard above this")
    right.set(
        xlim=(10, 40),
        ylim=(0, None),
        xlabel="driving frequency [Hz]",
        ylabel="impact velocity [mm/s]",
    )
    right.set_title(f"Hits at {osc.gap * 1e3:g} mm clearance")
    right.legend()
    return figure


def main() -> None:
    """Compute, tell and draw."""
    osc = tube()
    hits, up, down = (
        hardest_hits(osc),
        pass_through(osc, "up"),
        pass_through(osc, "down"),
    )
    print("\n".join(verdict(osc, hits, up, down)))
    draw(osc, hits, up, down)
    assert abs(float(up.max()) - 0.134) < 0.001  # m/s
    assert abs(float(down.max()) - 0.077) < 0.001
    plt.show()


if __name__ == "__main__":
    main()
