"""Exponents: of cycles those of their multipliers, of chaos the growth of deviations, by every code."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

import vibroimpact as vi
from codes import Engine, differences, index_of, later, name_of
from designs import RESTS, orbit_of_one_impact
from oracles.one_impact import trace, transition
from systems import (
    beside_its_centre,
    chain,
    free_masses,
    free_pair,
    one_mass,
    sticking,
    system,
    uncoupled,
)
from vibroimpact.backends.modal.carry import Carrier
from vibroimpact.contact import hunt_crossley, piecewise

pytestmark = pytest.mark.usefixtures("modal_engine")

OSC = vi.ImpactOscillator()
FAR = vi.State(-1.0)
CHAOS = vi.ImpactOscillator(omega=2.8)
NAMED = ("n_periods", "n_impacts", "lyapunov_per_impact")


# Cycles of one mass


@pytest.mark.parametrize("omega", [1.4, 2.0, 2.6])
def test_the_exponent_of_a_period_1_orbit_is_that_of_its_50_digit_multipliers(values, way, omega):
    known = values["period_n_impact_1"][f"w={omega},n=1"]
    osc = vi.ImpactOscillator(omega=omega)
    growth = math.log(max(math.hypot(*map(float, known[name])) for name in ("mult1", "mult2")))
    indices = way.indices(osc, transient=200, sample=40 if way.slow else 5000)
    assert name_of(indices) == (1, 1)
    # At 2.0 the multipliers nearly meet, 5e-4 apart: a rounding of the trace counts 2000-fold.
    near = {"witness": 5e-12, "engine": 1e-8, "engine of systems": 1e-8}[way.name]
    assert indices["lyapunov"] == pytest.approx(growth / osc.period, abs=near)
    assert indices["lyapunov_per_impact"] == pytest.approx(growth, abs=2 * near * osc.period)


@pytest.mark.parametrize(
    ("n", "changes"),
    [
        (1, {"omega": 1.7, "gap": 0.1}),
        (2, {"omega": 4.1}),
        (1, {"omega": 2.8, "mass": 0.5, "restitution": 0.85}),
        (1, {"omega": 2.0, "damping": 2.5}),
        (1, {"omega": 2.2, "restitution": 0.6, "amplitude": 2.5, "gap": -0.1}),
    ],
)
def test_the_exponent_of_an_impact_1_motion_follows_from_its_trace_in_closed_form(way, n, changes):
    osc = vi.ImpactOscillator(**changes)
    indices, last = way.indices(osc, transient=600, sample=40), way.section(osc, 600, 40).isel(impact=-1)
    decay, _, _ = transition(osc, n * osc.period)
    sum_of_both = trace(osc, n * osc.period, float(last["phase"]), float(last["velocity"]))
    growth = math.log(max(abs(np.roots([1.0, -sum_of_both, osc.restitution**2 * decay**2]))))
    assert name_of(indices) == (n, 1)
    near = {"rel": 1e-9} if way.slow else {"rel": 1e-7, "abs": 1e-8}
    assert indices["lyapunov_per_impact"] == pytest.approx(growth, **near)
    assert indices["lyapunov"] == pytest.approx(growth / (n * osc.period), **near)


def test_an_orbit_that_repeats_but_is_unstable_is_no_cycle(way):
    osc = vi.ImpactOscillator(omega=1.15)
    start = orbit_of_one_impact(osc)
    hits, indices = way.section(osc, start=start), way.indices(osc, transient=0, sample=20, start=start)
    assert hits["velocity"].values == pytest.approx(start.velocity, rel=1e-10)
    assert name_of(indices) == (0, 0)
    assert indices["lyapunov"] > 0


# Cycles of systems


def knocking(omega, c):
    """Return a mass between two springs; a damper that begins to push makes a deviation jump."""
    one, other = (1.0, 0.3, 50.0, c), (-1.0, 0.5, 20.0, 0.4)
    stops = [vi.Stop(direction=side, gap=gap, stiffness=k, damping=d) for side, gap, k, d in (one, other)]
    return system(1.0, 0.2, 1.0, omega, stops, {1: 1.0})


GYROSCOPIC = np.array([[0.0, 0.03, 0.0], [-0.03, 0.0, 0.01], [0.0, -0.01, 0.0]])
PIECES = piecewise([0.05, 0.3, 1.0, 2.5], [0.9, 0.8, 0.5, 0.45])
COMPLEX = {"abs": 2.0 / (3000 * chain().period)}  # 1/N of a complex pair
CYCLES = {  # a system, the phase at which it touches no stop, and how closely sums over 3000 impacts give the exponent
    "chain": (chain(), 0.0, COMPLEX),
    "coupled by a gyroscope": (chain(damping=0.02 * chain().stiffness + GYROSCOPIC), 0.0, COMPLEX),
    "two stops": (vi.models.two_sided_oscillator(), 0.0, {"rel": 1e-6}),
    "hunt and crossley": (chain(hunt_crossley(damping=0.3)), 0.0, COMPLEX),
    "piecewise": (chain(PIECES), 0.0, COMPLEX),
    # One stop closes, the other is struck meanwhile.
    "sticking": (sticking(), 0.55, {"abs": 1e-5}),
    **{f"springs, w={omega}": (knocking(omega, c), 0.0, {"rel": 2e-3})
       for omega, c in ((0.9, 0.9), (1.1, 0.0), (1.9, 0.9), (2.4, 2.5))},
}  # fmt: skip


@pytest.mark.parametrize("name", CYCLES)
def test_the_exponent_of_a_cycle_is_that_of_differences(name):
    """The map over a cycle by central differences of motions; its spectral radius is that of the orbit, too."""
    model, phase, near = CYCLES[name]
    found, periods = index_of(model, "lyapunov", "n_periods", transient_impacts=3000)
    assert periods > 0
    looks = vi.stroboscopic_section(model, phase=phase, transient_periods=1000, sample_periods=1)
    state, begin = np.concatenate([looks.displacement.values[0], looks.velocity.values[0]]), phase * model.period
    assert later(Engine(), model, state, begin, periods) == pytest.approx(state, abs=1e-9)
    radius = max(abs(np.linalg.eigvals(differences(Engine(), model, state, begin, periods, step=1e-5))))
    assert found == pytest.approx(math.log(radius) / (periods * model.period), **near)
    for orbit in vi.find_orbit(model, n_impacts=len(model.stops)) if not model.stops[0].compliant else ():
        if name != "sticking" and orbit.stable and orbit.admissible:
            assert name != "two stops" or found == pytest.approx(orbit.lyapunov, rel=1e-9)
            assert orbit.spectral_radius == pytest.approx(radius, rel=1e-7)
            assert orbit.determinant == pytest.approx(np.prod(orbit.multipliers).real, rel=1e-9)


def test_a_mass_that_is_held_for_ever_leaves_the_exponent_of_the_other():
    model = vi.ImpactSystem(
        mass=[[1.0, 0.2], [0.2, 1.0]],
        damping=[[0.2, -0.05], [-0.05, 0.1]],
        stiffness=[[3.0, -1.0], [-1.0, 2.0]],
        force=vi.Force(omega=1.9, harmonics={1: [0.0, 1.0]}, constant=[50.0, 0.0]),
        stops=[vi.Stop(direction=[1, 0], gap=0.0), vi.Stop(direction=[0, 1], gap=0.1, restitution=0.7)],
    )
    free = vi.ImpactOscillator(mass=1.0, damping=0.1, stiffness=2.0, omega=1.9, gap=0.1, restitution=0.7)
    (orbit,) = (orbit for orbit in vi.find_orbit(free) if orbit.stable and orbit.admissible)
    for early in (False, True):
        (found,) = index_of(model, "lyapunov", transient_impacts=2000, early_closing=early)
        assert found == pytest.approx(orbit.lyapunov, rel=1e-3)


# Growth


DESIGNS = [
    CHAOS,
    vi.ImpactOscillator(omega=2.8, mass=0.3, stiffness=2.0, damping=0.2, gap=0.15, restitution=0.9),
    vi.ImpactOscillator(omega=3.0, damping=6.0, restitution=0.7),
]


@pytest.mark.parametrize("osc", DESIGNS, ids=["chaos", "off the stop", "overdamped"])
def test_growth_is_that_of_flights_and_saltations(way, osc):
    """Of a deviation (1, 0.7/h) with h = 2.4/L, of length |y| + h |y'|: the one after the other."""
    hits = way.section(osc, sample=60, start=FAR)
    times, v = np.array([0.0, *hits["time"].values]), hits["velocity"].values
    matrix = np.array([[0.0, 1.0], [-osc.stiffness / osc.mass, -osc.damping / osc.mass]])
    h = 2.4 / max(osc.omega, osc.natural_frequency, -np.linalg.eigvals(matrix).real.min())
    push = (osc.amplitude * np.sin(2 * math.pi * hits["phase"].values) - osc.stiffness * osc.gap) / osc.mass
    damp, r = osc.damping / osc.mass, osc.restitution
    deviation, lengths = np.array([1.0, 0.7 / h]), []
    for i in range(60):
        deviation = expm(matrix * (times[i + 1] - times[i])) @ deviation
        before, after = push[i] - damp * v[i], push[i] + damp * r * v[i]
        deviation = np.array([[-r, 0], [(after + r * before) / v[i], -r]]) @ deviation
        lengths.append(abs(deviation[0]) + h * abs(deviation[1]))
    indices = way.indices(osc, transient=10, sample=50, start=FAR)
    if indices["n_periods"] == 0:
        growth, begun = math.log(lengths[-1] / lengths[10]), times[-1] - times[11]
        assert indices["lyapunov"] * begun == pytest.approx(growth, abs=1e-9 if way.slow else 0.3)
        assert indices["lyapunov_per_impact"] * 49 == pytest.approx(growth, abs=1e-9 if way.slow else 0.3)
    else:
        later = math.log(lengths[-1] / lengths[-1 - indices["n_impacts"]])
        assert indices["lyapunov_per_impact"] * indices["n_impacts"] == pytest.approx(later, rel=1e-6)


@pytest.mark.parametrize("way", ["witness"], indirect=True)
def test_the_growth_of_a_deviation_is_that_of_the_distance_of_neighbours(way):
    h, r = 2.4 / CHAOS.omega, CHAOS.restitution
    above, below, middle = (
        way.section(CHAOS, 1, 6, start=vi.State(-1.0 + off, off * 0.7 / h)) for off in (1e-6, -1e-6, 0.0)
    )
    late, faster = ((above[name] - below[name]).values for name in ("time", "velocity"))
    v, phase = middle["velocity"].values, middle["phase"].values
    after = np.sin(2 * math.pi * phase) + CHAOS.damping * r * v
    length = np.abs(r * v * late) + h * np.abs(after * late + r * faster)
    indices = way.indices(CHAOS, transient=1, sample=6, start=FAR)
    growth = indices["lyapunov"] * float(middle["time"][-1] - middle["time"][0])
    assert growth == pytest.approx(math.log(length[-1] / length[0]), abs=1e-8)
    assert indices["lyapunov_per_impact"] == pytest.approx(growth / 5, rel=1e-12)


def test_the_exponent_at_28_is_that_of_forty_million_impacts(values):
    starts = np.linspace(-1.9, -0.1, 50)
    found = [
        vi.parameter_map(
            OSC, omega=2.8 + 1e-12 * np.arange(20), start=vi.State(start), indices=["lyapunov"], sample_impacts=10_000
        )["lyapunov"].values
        for start in starts
    ]
    mean, error = (float(number) for number in values["lyapunov_w=2.8"]["lam_per_time_mean_se"])
    chaotic = np.concatenate(found)
    assert np.isfinite(chaotic).all()
    assert abs(chaotic.mean() - mean) < 5e-4  # 1e7 impacts
    assert abs(chaotic.mean() - mean) < 4 * math.hypot(error, chaotic.std() / math.sqrt(chaotic.size))


@pytest.mark.long
def test_the_exponent_of_chaos_is_the_known_one_within_its_spread(values, way):
    mean, error = map(float, values["lyapunov_w=2.8"]["lam_per_time_mean_se"])
    indices = way.indices(CHAOS, transient=100, sample=2000, start=FAR)
    assert indices["lyapunov"] == pytest.approx(mean, abs=4 * error * math.sqrt(4e7 / 2000))
    assert name_of(indices) == (0, 0)


@pytest.mark.parametrize("scale", [2.0, 0.25])
def test_twice_as_fast_an_oscillator_has_twice_the_exponent(way, scale):
    slow, fast = CHAOS, vi.ImpactOscillator(mass=1 / scale**2, damping=0.01 / scale, omega=2.8 * scale)
    a, b = (way.indices(osc, transient=20, sample=12, start=FAR) for osc in (slow, fast))
    assert b["lyapunov"] == pytest.approx(scale * a["lyapunov"], rel=1e-9)
    for name in ("lyapunov_per_impact", "dissipation", "impact_phase_spread", "grazing_margin"):
        assert b[name] == pytest.approx(a[name], rel=1e-9)


def test_a_closed_stop_leaves_a_coupled_mode_its_neighbours():
    system = vi.ImpactSystem(
        mass=np.eye(2),
        damping=[[0.02, -0.01], [-0.01, 0.02]],
        stiffness=[[2.0, -1.0], [-1.0, 2.0]],
        force=vi.Force(omega=0.25, harmonics={1: [1.0, 0.3]}),
        stops=[vi.Stop(direction=[1, 0], gap=0.0, restitution=0.5)],
    )
    hits = vi.impact_section(system, sample_impacts=300)
    assert hits.sizes["stick"] > 5
    (found,) = index_of(system, "lyapunov", sample_impacts=2000)
    assert -1.0 < found < 1.0


def test_a_rest_in_the_transient_hides_no_chaos_behind_another_part_of_the_machine():
    """The first mass, on its own, comes to rest once before it is chaotic; the second one only decays."""
    walls = [vi.Stop(direction=[sign, 0], gap=0.5, restitution=0.5) for sign in (1, -1)]
    machine = uncoupled([0.0, 0.2], [0.0, 2.0], walls, [2.0, 1.0], omega=1.0)
    assert vi.impact_section(machine, transient_impacts=0, sample_impacts=100).sizes["stick"] == 1
    (found,) = index_of(machine, "lyapunov")
    assert found == pytest.approx(0.196, abs=0.02)


# Deviations


def mixed(rng):
    """Return a random system of two or three coordinates before a rigid stop and one that gives."""
    n = int(rng.integers(2, 4))
    spread, stiffness = rng.standard_normal((2, n, n))
    stops = [
        vi.Stop(direction=rng.standard_normal(n), gap=rng.uniform(0.0, 0.5), restitution=rng.choice([0.0, 0.3, 0.7])),
        vi.Stop(direction=rng.standard_normal(n), gap=rng.uniform(0.0, 0.5), stiffness=rng.uniform(3.0, 300.0)),
    ]
    return vi.ImpactSystem(
        mass=np.eye(n),
        damping=0.2 * spread @ spread.T,
        stiffness=stiffness @ stiffness.T + 0.5 * np.eye(n),
        force=vi.Force(omega=rng.uniform(0.3, 2.0), harmonics={1: 2.0 * rng.standard_normal(n)}),
        stops=stops,
    )


def test_neighbours_of_a_motion_between_rigid_stops_and_such_that_give_move_as_other_motions_do():
    rng, compared = np.random.default_rng(3), 0
    while compared < 40:
        system, phase, periods = mixed(rng), rng.uniform(0.0, 1.0), rng.uniform(0.5, 2.0)
        carrier = Carrier(system.cells({}), vi.Tolerances())
        x, _ = carrier.over(np.zeros(2 * len(system.mass)), 0.0, 6.0 + phase)
        place, _ = carrier.coordinates(x)
        if min(abs(stop.gap - stop.direction @ place) for stop in system.stops) < 1e-3:
            continue  # a neighbour of what rests lies beyond the stop
        _, derivative = carrier.over(x, phase, periods)
        steps = 1e-6 * np.abs(x).max() * np.array([1.0, 0.1])
        numbers = [
            np.column_stack([carrier.over(x + h * u, phase, periods)[0] - carrier.over(x - h * u, phase, periods)[0]
                             for u in np.eye(len(x))]) / (2.0 * h) for h in steps
        ]  # fmt: skip
        if np.abs(numbers[0] - numbers[1]).max() > 1e-5:
            continue  # nearly a graze
        compared += 1
        assert numbers[1] == pytest.approx(derivative, abs=1e-4 * max(1.0, np.abs(derivative).max()))


@pytest.mark.parametrize("early", [True, False])
@pytest.mark.parametrize("hardest", [5.411, 1.381])
def test_a_rest_whose_time_rounding_decides_ends_no_cycle(hardest, early):
    """As of one mass: neighbours part by more than 1e13 from one rest to the next, so no rest repeats another."""
    osc = RESTS[hardest]
    far = vi.Stop(direction=-1, gap=50.0 * osc.velocity_scale, restitution=0.5)
    for one in (one_mass(osc), one_mass(osc, stops=[*one_mass(osc).stops, far])):
        for model in (osc, one):
            cell = vi.parameter_map(model, omega=[osc.omega], indices=NAMED, early_closing=early).isel(omega=0)
            assert np.isneginf(cell["lyapunov_per_impact"])
            assert (int(cell["n_periods"]), int(cell["n_impacts"])) == (0, -1)


# Masses whose centre is free


def test_two_free_masses_have_the_exponent_of_the_one_mass_that_moves_as_one_does_from_the_other():
    pair = free_pair(0.5)
    one, _ = beside_its_centre(pair)
    (found, periods), (alone, _) = (index_of(model, "lyapunov", "n_periods") for model in (pair, one))
    assert periods == 0
    assert found == pytest.approx(alone, abs=0.02)  # of 3000 impacts of chaos
    assert alone == pytest.approx(0.196, abs=0.02)
    section = vi.impact_section(pair, transient_impacts=0, sample_impacts=100)
    assert section.sizes["stick"]  # in the transient, which took all of the deviation but the drift


def test_drag_and_loads_on_the_centre_alone_change_no_exponent():
    mass = np.diag([1.0, 3.0])
    load = vi.Force(omega=1.0, harmonics={1: [1.0, -1.0]})
    pushed = vi.Force(omega=1.0, harmonics={1: [2.0, 2.0]}, constant=[0.1, 0.3])
    plain, moved = (free_pair(mass=mass, force=force) for force in (load, pushed))
    named = [index_of(model, *NAMED, transient_impacts=500) for model in (plain, moved)]
    assert named[0][:2] == named[1][:2] == [1, 2]
    assert named[0][2] == pytest.approx(named[1][2], rel=1e-9)
    braked = free_pair(mass=mass, damping=1e-3 * mass, force=pushed)
    alone = index_of(beside_its_centre(braked)[0], *NAMED, transient_impacts=500)
    assert index_of(braked, *NAMED, transient_impacts=500) == pytest.approx(alone, abs=1e-3)  # a complex pair: 1/N


@pytest.mark.long
def test_free_masses_have_the_names_and_exponents_of_their_relative_motion():
    named = 0
    for seed in range(24):
        model = free_masses(seed)
        own, centres = beside_its_centre(model)
        indices = [
            index_of(
                one, "n_periods", "n_impacts", "max_velocity", "lyapunov", sample_impacts=500, transient_impacts=1500
            )
            for one in (model, own)
        ]
        assert centres > 0
        if any(0 < one[0] <= 8 for one in indices):
            assert indices[0][:2] == indices[1][:2], seed
            assert indices[0][2] == pytest.approx(indices[1][2], rel=1e-6)
            assert indices[0][3] == pytest.approx(indices[1][3], abs=0.02), seed  # a complex pair: 1/N
            named += 1
    assert named > 8
