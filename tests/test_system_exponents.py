"""How neighbours of a system's motion part from it, and whether its impacts come back."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from codes import Engine, differences, later
from designs import RESTS
from systems import (
    beside_its_centre,
    between_stops,
    bouncing_ball,
    chain,
    free_masses,
    free_pair,
    one_mass,
    sticking,
    system,
    uncoupled,
)  # fmt: skip
from vibroimpact.backends.modal.carry import Carrier
from vibroimpact.contact import hunt_crossley, piecewise
from vibroimpact.motion import MotionClass, decide

pytestmark = pytest.mark.usefixtures("modal_engine")

NAMED = ("n_periods", "n_impacts", "lyapunov_per_impact")


def index(model, *names, **how):
    arguments = {"omega": [model.omega], "indices": names, "sample_impacts": 3000} | how
    sweep = vi.parameter_map(model, **arguments)
    return [float(sweep[name].item()) for name in names]


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
    found, periods = index(model, "lyapunov", "n_periods", transient_impacts=3000)
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


def test_one_mass_has_the_motions_of_the_oscillator():
    omega = [0.1, 0.3, 0.9, 1.1, 2.0, 2.8]
    sweep = vi.parameter_map(vi.ImpactOscillator(), omega=omega, indices=NAMED, early_closing=False)
    as_system = vi.parameter_map(one_mass(vi.ImpactOscillator()), omega=omega, indices=NAMED)
    for name in NAMED[:2]:
        assert as_system[name].values.tolist() == sweep[name].values.tolist()
    found, known = as_system["lyapunov_per_impact"].values, sweep["lyapunov_per_impact"].values
    assert found[:2].tolist() == [-math.inf, -math.inf]
    assert found[2:] == pytest.approx(known[2:], abs=0.02)


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
    (found,) = index(system, "lyapunov", sample_impacts=2000)
    assert -1.0 < found < 1.0


# Quasi-periodic motions: an exponent of 0, and no cycle


def averages(system):
    """Return the mean of exp(2 pi i phase) over each of two long windows, by weights that vanish smoothly at the ends.

    Along a quasi-periodic motion such means converge faster than any power of the number of impacts.
    """
    phases = vi.impact_section(system, transient_impacts=4000, sample_impacts=4000)["phase"].values[::2]
    at = (np.arange(1000) + 0.5) / 1000
    weights = np.exp(-1.0 / (at * (1.0 - at)))
    return [weights @ np.exp(2j * np.pi * part) / weights.sum() for part in np.split(phases, 2)]


def test_beyond_a_neimark_sacker_point_motions_are_quasi_periodic():
    omegas = [0.945, 0.95, 0.96, 0.965, 0.969, 0.98]
    before, after = (
        min(vi.find_orbit(between_stops(omega), n_impacts=2), key=lambda orbit: orbit.spectral_radius)
        for omega in (0.969, 0.965)
    )
    assert before.spectral_radius < 1.0 < after.spectral_radius
    assert abs(after.multipliers[0].imag) > 0.1
    sweep = vi.parameter_map(
        between_stops(1.0), omega=omegas, indices=NAMED, transient_impacts=2000, sample_impacts=3000
    )
    classes = vi.classify(sweep)["motion"]
    words = [classes.attrs["flag_meanings"].split()[code] for code in classes.values]
    assert words == ["chaotic", *["quasi_periodic"] * 3, *["periodic"] * 2]
    for omega, word in zip(omegas, words, strict=True):
        first, last = averages(between_stops(omega))
        assert (abs(first - last) < 1e-9) == (word != "chaotic")


def test_the_growth_over_many_impacts_decides_what_is_quasi_periodic():
    growths = [-1.1, -0.9, 0.0, math.log(3000) - 0.1, math.log(3000) + 0.1, 0.0, 0.0, math.nan]
    status = [*[vi.Status.OK] * 5, vi.Status.SHORT_WINDOW, vi.Status.STICKING, vi.Status.BUDGET]
    known = [MotionClass(code).label for code in decide(status, growths, 0, 0, 3000)]
    yes, no = "quasi-periodic", "undecided"
    assert known == [no, yes, yes, yes, no, no, yes, "not followed to the end"]
    assert MotionClass(int(decide(vi.Status.OK, 0.0, 0, 0, 999))) == MotionClass.UNDECIDED
    assert MotionClass(int(decide(vi.Status.OK, 0.0, 3, 2, 3000))) == MotionClass.PERIODIC


def test_one_mass_never_moves_quasi_periodically_not_even_without_loss():
    elastic = vi.ImpactOscillator(restitution=1.0, damping=0.0, omega=3.3)
    for model in (elastic, one_mass(elastic)):
        sweep = vi.parameter_map(model, omega=[3.3], start=vi.State(-0.4), indices=NAMED, sample_impacts=3000)
        assert vi.classify(sweep)["motion"].values == MotionClass.UNDECIDED
        assert "quasi_periodic" not in vi.classify(sweep)["motion"].attrs["flag_meanings"]


# The bouncing ball's multipliers have the product r^2 and the sum 1 + r^2 - (1 + r)^2 sqrt(gamma^2 - fold^2); see
# test_orbits.


@pytest.mark.long(but=6)
@pytest.mark.parametrize("early_closing", [False, True])
@pytest.mark.parametrize(("restitution", "n_periods"), [(0.5, 1), (0.8, 1), (0.25, 2)])
@pytest.mark.parametrize("multiplier", [-0.98, -0.996, -0.9995, -1.0005, -1.004])
def test_a_cycle_that_is_reached_by_turns_from_either_side_is_not_named_double(
    multiplier, restitution, n_periods, early_closing
):
    squared, fold = restitution**2, n_periods * math.pi * (1.0 - restitution) / (1.0 + restitution)
    slope = (1.0 + squared - multiplier - squared / multiplier) / (1.0 + restitution) ** 2
    ball = bouncing_ball(math.hypot(fold, slope), restitution)
    orbit = vi.find_orbit(ball, n_periods=n_periods)[0]
    assert min(abs(one - multiplier) for one in orbit.multipliers) < 1e-9
    named = set()
    for kick in (1e-2, 1e-4, 1e-5, 1e-6, 1e-7):
        start = vi.State(orbit.start.displacement, (1.0 - kick) * np.array(orbit.start.velocity), orbit.start.time)
        for sample in (200, 500, 1000, 2000):
            (found,) = index(ball, "n_periods", start=start, transient_impacts=sample // 2, sample_impacts=sample,
                             early_closing=early_closing)  # fmt: skip
            named.add(int(found))
    assert named <= ({0, n_periods} if multiplier > -1.0 else {0, 2 * n_periods})
    assert abs(multiplier + 1.0) < 1e-3 or len(named) == 2  # it is named where it is near


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
        (found,) = index(model, "lyapunov", transient_impacts=2000, early_closing=early)
        assert found == pytest.approx(orbit.lyapunov, rel=1e-3)


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
    (found, periods), (alone, _) = (index(model, "lyapunov", "n_periods") for model in (pair, one))
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
    named = [index(model, *NAMED, transient_impacts=500) for model in (plain, moved)]
    assert named[0][:2] == named[1][:2] == [1, 2]
    assert named[0][2] == pytest.approx(named[1][2], rel=1e-9)
    braked = free_pair(mass=mass, damping=1e-3 * mass, force=pushed)
    alone = index(beside_its_centre(braked)[0], *NAMED, transient_impacts=500)
    assert index(braked, *NAMED, transient_impacts=500) == pytest.approx(alone, abs=1e-3)  # a complex pair: 1/N


@pytest.mark.long
def test_free_masses_have_the_names_and_exponents_of_their_relative_motion():
    named = 0
    for seed in range(24):
        model = free_masses(seed)
        own, centres = beside_its_centre(model)
        indices = [index(one, "n_periods", "n_impacts", "max_velocity", "lyapunov", sample_impacts=500,
                      transient_impacts=1500) for one in (model, own)]  # fmt: skip
        assert centres > 0
        if any(0 < one[0] <= 8 for one in indices):
            assert indices[0][:2] == indices[1][:2], seed
            assert indices[0][2] == pytest.approx(indices[1][2], rel=1e-6)
            assert indices[0][3] == pytest.approx(indices[1][3], abs=0.02), seed  # a complex pair: 1/N
            named += 1
    assert named > 8


def test_a_rest_in_the_transient_hides_no_chaos_behind_another_part_of_the_machine():
    """The first mass, on its own, comes to rest once before it is chaotic; the second one only decays."""
    walls = [vi.Stop(direction=[sign, 0], gap=0.5, restitution=0.5) for sign in (1, -1)]
    machine = uncoupled([0.0, 0.2], [0.0, 2.0], walls, [2.0, 1.0], omega=1.0)
    assert vi.impact_section(machine, transient_impacts=0, sample_impacts=100).sizes["stick"] == 1
    (found,) = index(machine, "lyapunov")
    assert found == pytest.approx(0.196, abs=0.02)
