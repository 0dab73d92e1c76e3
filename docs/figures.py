"""Draw the pictures of README and documentation again, with the present engine: `make figures`."""

import runpy
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import vibroimpact as vi
from vibroimpact.continuation.windows import follow_all

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
    """Draw three limits of Std: several impacts per cycle, the cut-off of a chatter, the initial condition."""
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
    ax.set_title(f"w = 1: {vi.recognise(vi.impact_section(osc)).name}, stable, Std = {std:.3f}")


def _cuts(ax: plt.Axes, osc: vi.ImpactOscillator) -> None:
    cuts = np.logspace(-2, -9, 29)
    std = [vi.parameter_map(osc, omega=[0.1], tolerances=vi.Tolerances(chatter=cut))["std"].item() for cut in cuts]
    ax.semilogx(cuts, std, "o-", markersize=4)
    ax.set(ylim=(0, None), xlabel="slowest impact counted, relative to V", ylabel="Std [m/s]")
    ax.set_title("w = 0.1, chattering: Std depends on the cut-off")


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
        text = f"{kind}: {100 * len(points) / total:.0f} % of initial conditions, Std {std.mean():.3f}"
        ax.scatter(phase, velocity, s=9, marker="s", color=colour, linewidths=0, label=text)
    ax.set(xlabel="phase of first impact", ylabel="velocity of first impact [m/s]", title="w = 3: two motions")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), fontsize=9)


def plane() -> xr.Dataset:
    """Return Std, exponents and names of motions over driving frequency and mass."""
    names = ("std", "lyapunov", "lyapunov_per_impact", "n_periods", "n_impacts")
    axes = {"omega": np.linspace(0.5, 5, 300), "mass": np.linspace(0.1, 5, 200)}
    return vi.parameter_map(vi.ImpactOscillator(), **axes, indices=names, sample_impacts=1000)


def orbits() -> plt.Figure:
    """Draw three orbits: one impact, a stable and an unstable one together, and one that sticks."""
    figure, axes = plt.subplots(1, 3, figsize=(12.5, 4.4), layout="constrained")
    osc = vi.ImpactOscillator()
    (one,) = vi.find_orbit(osc.replace(omega=1.4))
    (sticking,) = vi.find_orbit(osc.replace(omega=0.1), n_impacts=-1)
    stable, unstable = vi.find_orbit(osc.replace(omega=1.3), n_periods=2, n_impacts=3)
    for ax, orbit in zip(axes, (one, stable, sticking), strict=True):
        vi.plotting.phase_portrait(_cycle(orbit), ax=ax)
        ax.set_title(
            f"w = {orbit.oscillator.omega:g}: {orbit.name}\nmultipliers {abs(orbit.multipliers[0]):.2g} in size"
        )
        ax.get_legend().remove()
        ax.locator_params(axis="x", nbins=5)
    beside = _cycle(unstable)
    axes[1].plot(beside["displacement"], beside["velocity"], "--", color="#d55e00", linewidth=1)
    axes[1].set_title("w = 1.3: period-2 impact-3, stable (blue)\nand unstable (red, dashed)")
    return figure


def _cycle(orbit: vi.Orbit) -> xr.Dataset:
    return vi.simulate(orbit.oscillator, start=orbit.start, periods=orbit.n_periods, samples_per_period=2000)


def continuation() -> plt.Figure:
    """Draw branches over a swept diagram, and boundaries over driving frequency and restitution."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(12, 5.2), layout="constrained")
    osc = vi.ImpactOscillator()
    orbits = [*vi.find_orbit(osc.replace(omega=2.5)), *vi.find_orbit(osc.replace(omega=3.25), n_periods=2)]
    branches = follow_all(orbits, "omega", (2.4, 3.6), longest=2, most=2)
    sweep = vi.bifurcation_diagram(
        osc, omega=np.linspace(2.4, 3.6, 300), direction="up", transient_impacts=500, sample_impacts=50
    )
    vi.plotting.branch_diagram(branches, sweep, ax=left)
    box = (1.0, 4.0), (0.3, 0.95)
    curves = vi.boundary_curves(osc, ("omega", "restitution"), box, n_periods=(1, 2))
    cells = {"omega": np.linspace(*box[0], 200), "restitution": np.linspace(*box[1], 120)}
    vi.plotting.boundaries(curves, vi.parameter_map(osc, **cells, sample_impacts=1000), ax=right)
    return figure


def pitchforks() -> plt.Figure:
    """Draw the branches of a symmetric two-sided oscillator over its diagram, and the twins born at its pitchforks."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(12, 5.0), layout="constrained", width_ratios=(1.5, 1))
    model = vi.family(vi.models.two_sided_oscillator)
    (orbit,) = (found for found in vi.find_orbit(model, n_impacts=2) if found.symmetric and found.stable)
    branches = follow_all([orbit], "frequency", (16.5, 25.5), doublings=1)
    sweep = vi.bifurcation_diagram(
        model, frequency=np.linspace(16.5, 25.5, 300), transient_impacts=2000, sample_impacts=40
    )
    vi.plotting.branch_diagram(branches, sweep, ax=left)
    near = min(branches[-1].orbits, key=lambda found: abs(found.value("frequency") - 21.5))

    def listed(orbit: vi.Orbit) -> str:
        hits = zip(orbit.velocities, orbit.stops, strict=True)
        return " and ".join(f"{velocity:.3f} m/s on the {stop}" for velocity, stop in hits)

    for twin, colour in ((near, "#d55e00"), (near.twin, "#0072b2")):
        motion = vi.simulate(twin.system, start=twin.start, periods=1, samples_per_period=2000)
        place, rate = motion["displacement"].isel(coordinate=0), motion["velocity"].isel(coordinate=0)
        right.plot(1e3 * place, rate, color=colour, label=listed(twin))
    right.set(
        xlabel="displacement $q$ [mm]",
        ylabel="velocity $q'$ [m/s]",
        title=f"the twins at {near.value('frequency'):.3g} Hz",
    )
    right.locator_params(axis="x", nbins=5)
    right.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14))
    return figure


def basins_of_two_stops() -> plt.Figure:
    """Draw the basins of asymmetric twins between two stops, at two phases half a period apart."""
    stops = [vi.Stop(direction=side, gap=0.05, name=name) for side, name in ((1, "above"), (-1, "below"))]
    force = vi.Force(omega=5.0, harmonics={1: 1.0})
    mass = vi.ImpactSystem(mass=1.0, damping=0.05, stiffness=1.0, force=force, stops=stops)
    figure, axes = plt.subplots(1, 2, figsize=(13, 5.4), layout="constrained")
    states = {"displacement": np.linspace(-0.05, 0.05, 240), "velocity": np.linspace(-1.0, 1.0, 240)}
    for ax, phase in zip(axes, (0.0, 0.5), strict=True):
        vi.plotting.basin_portrait(vi.basins(mass, **states, phase=phase), ax=ax)
        ax.set_title(f"states at phase {phase:g}")
    return figure


def coexistence() -> plt.Figure:
    """Draw the basins of two motions, and how up and down sweeps differ."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(13, 5.4), layout="constrained")
    osc = vi.ImpactOscillator()
    grid = {"phase": np.linspace(0, 1, 241), "velocity": np.linspace(0, 3, 181)}
    vi.plotting.basin_portrait(vi.basins(osc.replace(omega=3.0), **grid), ax=left)
    left.set_title("w = 3: initial conditions at the stop")
    for direction, colour, size in (("up", "#d55e00", 3.0), ("down", "#0072b2", 1.2)):
        sweep = vi.bifurcation_diagram(
            osc, omega=np.linspace(1.1, 1.5, 300), direction=direction, transient_impacts=1000, sample_impacts=60
        )
        omega, velocity = np.broadcast_arrays(sweep["omega"].values[:, None], sweep["velocity"].values)
        right.plot(omega.ravel(), velocity.ravel(), ".", color=colour, markersize=size, label=f"sweep {direction}")
    right.set(xlabel=r"angular driving frequency $\omega$ [rad/s]", ylabel="impact velocity $I$ [m/s]", ylim=(0, None))
    right.set_title("one oscillator, up and down")
    right.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2, markerscale=4)
    return figure


def refinement() -> plt.Figure:
    """Draw a refined map of motions, and which of its cells were computed."""
    axes_of_plane = {"omega": np.linspace(0.5, 5, 65), "mass": np.linspace(0.1, 5, 65)}
    plane_ = vi.refined_map(vi.ImpactOscillator(), refine=3, sample_impacts=2000, **axes_of_plane)
    figure, (left, right) = plt.subplots(1, 2, figsize=(14, 5.4), layout="constrained")
    vi.plotting.motion_map(plane_, ax=left)
    left.set_title(f"{plane_.sizes['omega']} x {plane_.sizes['mass']} cells")
    levels = np.ma.masked_less(plane_["level"].transpose("mass", "omega").values, 0)
    colours = mpl.colormaps["viridis_r"].resampled(4)
    mesh = right.pcolormesh(plane_["omega"], plane_["mass"], levels, cmap=colours, vmin=-0.5, vmax=3.5, rasterized=True)
    right.set(xlabel=left.get_xlabel(), title=f"{plane_.attrs['fraction_computed']:.0%} of them computed")
    right.grid(visible=False)
    figure.colorbar(mesh, ax=right, ticks=range(4), label="level of computation (white: filled in)")
    return figure


def verdict() -> plt.Figure:
    """Draw two designs side by side."""
    osc = vi.ImpactOscillator()
    return vi.plotting.comparison_figure([osc.replace(omega=1.4), osc.replace(omega=2.8)], size=(8.4, 8.8))


@vi.family(units={"omega": "rad/s", "gap": "m"})
def between_stops(omega: float = 0.955, gap: float = 0.7) -> vi.ImpactSystem:
    """Return two masses, the second one between two stops."""
    stiffness = np.array([[2.9, -1.6], [-1.6, 1.6]])
    return vi.ImpactSystem(
        mass=np.diag([1.1, 0.8]),
        damping=0.017 * stiffness,
        stiffness=stiffness,
        force=vi.Force(omega=omega, harmonics={1: [1.0, 0.0]}),
        stops=[vi.Stop(direction=[0.0, side], gap=gap, restitution=0.81) for side in (1.0, -1.0)],
    )


def quasi_periodic() -> plt.Figure:
    """Draw motions of two masses over frequency and gap, and the closed curves that quasi-periodic impacts fill."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained", width_ratios=(3, 2))
    axes = {"omega": np.linspace(0.8, 1.1, 80), "gap": np.linspace(0.6, 0.8, 50)}
    names = ("lyapunov_per_impact", "n_periods", "n_impacts")
    sweep = vi.parameter_map(between_stops, indices=names, transient_impacts=2000, sample_impacts=2000, **axes)
    vi.plotting.motion_map(sweep, ax=left)
    left.set_title("two masses between two stops, from rest")
    hits = vi.impact_section(between_stops, transient_impacts=2000, sample_impacts=2000)
    for stop, color in (("stop_1", "#0072b2"), ("stop_2", "#d55e00")):
        here = hits["stop"].values == stop
        right.plot(
            hits["phase"].values[here], hits["velocity"].values[here], ".", color=color, markersize=2, label=stop
        )
    right.set(xlabel=r"phase $\psi/T$", ylabel="impact velocity [m/s]", title="omega 0.955, gap 0.7: quasi-periodic")
    right.legend(frameon=False, markerscale=4)
    return figure


def restitution() -> plt.Figure:
    """Draw what further modes do to the struck mass, to impacts per period and to the rebound of a bar."""
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained")
    modes = np.arange(1, 13)
    for at, marker in ((1.0, "o-"), (0.7, "s--")):
        strips = [vi.models.cantilever_with_stop(modes=float(n), stop_at=at) for n in modes]
        masses = [1e3 / strip.modal().mobility[0, 0] for strip in strips]
        left.plot(
            modes, masses, marker, markersize=4, label=f"stop at {'the tip' if at == 1.0 else '0.7 of the length'}"
        )
    left.set(ylabel="struck mass [g]", ylim=(0, None))
    hits = [_impacts_per_period(vi.models.cantilever_with_stop(modes=float(n))) for n in modes[:10]]
    middle.semilogy(modes[:10], hits, "o-", markersize=4)
    middle.set(ylabel="impacts per period")
    for r in (0.0, 0.4, 0.7, 0.9):
        right.plot(modes, [_rebound(n, r) for n in modes], "o-", markersize=4, label=f"r = {r:g}")
    right.set(ylabel="speed after over speed before", ylim=(0, 1.02))
    for ax in (left, middle, right):
        ax.set(xlabel="number of modes", xticks=range(2, 13, 2))
    left.legend(frameon=False)
    right.legend(frameon=False, loc="lower right")
    return figure


def _impacts_per_period(strip: vi.ImpactSystem) -> float:
    hits = vi.impact_section(strip, transient_impacts=4000, sample_impacts=4000)["time"].values
    return float((len(hits) - 1) / (hits[-1] - hits[0]) / strip.frequency)


def _rebound(n: int, r: float) -> float:
    """Return the speed of a free bar after a stop over that before; length, mass and speed of sound are 1."""
    order = np.arange(n)
    stop = vi.Stop(direction=np.where(order, np.sqrt(2.0), 1.0), gap=0.0, restitution=r)
    stiffness = np.diag((np.pi * order) ** 2)
    bar = vi.ImpactSystem(mass=np.eye(n), stiffness=stiffness, force=vi.Force(omega=0.3), stops=[stop])
    coming = vi.State([-1.0] + [0.0] * (n - 1), [1.0] + [0.0] * (n - 1))
    return -float(vi.simulate(bar, start=coming, periods=1)["velocity"][-1, 0])


def laws() -> plt.Figure:
    """Draw laws of restitution over the speed of the impact."""
    figure, ax = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
    speeds, table = np.logspace(-2, 1, 300), ([0.05, 0.2, 0.6, 2.0, 5.0], [0.86, 0.8, 0.68, 0.52, 0.45])
    for damping, line in ((0.12, "-"), (0.48, "--")):
        law = vi.contact.hunt_crossley(damping=damping)
        ax.semilogx(speeds, law(speeds), line, color="C0", label=f"Hunt and Crossley, D = {damping:g} s/m")
    viscous = vi.contact.kelvin_voigt(damping_ratio=0.2)
    ax.semilogx(speeds, viscous(speeds), color="C1", label=r"Kelvin and Voigt, $\zeta$ = 0.2")
    ax.semilogx(speeds, vi.contact.piecewise(*table)(speeds), color="C2", label="a table")
    ax.plot(*table, "o", color="C2", markersize=4)
    ax.set(xlabel="speed of the impact [m/s]", ylabel="restitution", ylim=(0, 1.02), xlim=(speeds[0], speeds[-1]))
    ax.legend(frameon=False, loc="lower left")
    return figure


def compliant() -> plt.Figure:
    """Draw two settled periods of a rig with a beam as stop, and the force of the beam."""
    rig = vi.models.bilinear_oscillator()
    still = vi.simulate(rig, periods=300, samples_per_period=1).isel(time=-1)
    start = vi.State(still["displacement"].values.round(8), still["velocity"].values.round(8))
    return vi.plotting.time_history(vi.simulate(rig, start=start, periods=2, samples_per_period=1000)).get_figure()


def main() -> None:
    """Draw all pictures into docs/images/."""
    IMAGES.mkdir(exist_ok=True)
    tube = runpy.run_path(str(DOCS.parent / "examples" / "tube_in_support.py"))
    osc = tube["tube"]()
    results = tube["hardest_hits"](osc), tube["pass_through"](osc, "up"), tube["pass_through"](osc, "down")
    pictures = {"stability-map": stability_map(), "std": std(), "tube-in-support": tube["draw"](osc, *results)}
    pictures["model"] = vi.plotting.oscillator_sketch().get_figure()
    supports = runpy.run_path(str(DOCS.parent / "examples" / "tube_in_two_supports.py"))
    pictures["tube-in-two-supports"] = supports["draw"](supports["hardest_hits"](80))
    cells = plane()
    pictures |= {
        "exponents": vi.plotting.exponent_map(cells).get_figure(),
        "classes": vi.plotting.motion_map(cells).get_figure(),
        "orbits": orbits(),
        "continuation": continuation(),
        "pitchforks": pitchforks(),
        "coexistence": coexistence(),
        "basins-of-two-stops": basins_of_two_stops(),
        "refinement": refinement(),
        "quasi-periodic": quasi_periodic(),
        "restitution": restitution(),
        "laws": laws(),
        "compliant": compliant(),
        "verdict": verdict(),
    }
    for name, figure in pictures.items():
        vi.plotting.save_figure(figure, IMAGES / f"{name}.png", dpi=110, overwrite=True)
    for script in ("machine_pictures.py", "explorer_picture.py"):
        runpy.run_path(str(DOCS / script), run_name="__main__")


if __name__ == "__main__":
    main()
