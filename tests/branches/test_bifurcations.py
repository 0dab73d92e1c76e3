"""What is born where a branch folds, doubles, grazes or turns quasi-periodic, and what the engine does beside it."""

from dataclasses import replace

import numpy as np
import pytest

import vibroimpact as vi
from branching import first, name_of, specials, values_of
from contents import special_points
from designs import random_oscillator
from systems import chain, drawn, impact_damper, one_mass, symmetric_orbit
from vibroimpact.continuation import follow_all
from vibroimpact.continuation.equations import LAST_IMPACT, TOUCH
from vibroimpact.continuation.flights import equations_of
from vibroimpact.continuation.points import Solution
from vibroimpact.orbits import orbit_distance

pytestmark = pytest.mark.usefixtures("modal_engine")


@pytest.fixture(scope="module")
def doubled(as_model):
    branch = vi.continue_orbit(first(2.6, as_model=as_model), "omega", (2.5, 2.7), step=0.1)
    return vi.continue_orbit(vi.switch_branch(branch.special[-1]), "omega", (2.5, 3.3), step=0.03, virtual=False)


# Doublings


def test_the_doubled_orbit_is_what_the_engine_settles_on(doubled):
    for omega in (2.66, 2.69):
        near = min(doubled.orbits, key=lambda orbit: abs(orbit.value("omega") - omega))
        there = near.model.replace(omega=omega)
        (orbit,) = vi.find_orbit(there, n_periods=2, n_impacts=2, near=near)
        hits = vi.impact_section(there, transient_impacts=8000, sample_impacts=2)
        assert sorted(hits["velocity"].values) == pytest.approx(sorted(orbit.velocities), rel=1e-10)
        assert orbit.stable


def test_the_doubled_branch_ends_where_it_was_born(values, doubled):
    born = float(values["period_doubling_w_of_n=1"][1]["w"])
    assert doubled.outcome[0] == "period_doubling"
    assert doubled.special[0].value == pytest.approx(born, rel=1e-13)
    assert doubled.special[0].orbit.name == "period-1 impact-1"
    assert doubled.values.min() == pytest.approx(born, abs=2e-3)
    assert max(point.residual for point in doubled.special) < 1e-12


def test_the_doubled_orbit_doubles_again_and_the_engine_agrees(doubled):
    second = values_of(doubled, "period_doubling")[1]
    point = next(point for point in doubled.special if point.value == second)
    assert name_of(point.orbit, point.orbit.model.replace(omega=second - 2e-3)) == "period-2 impact-2"
    assert name_of(point.orbit, point.orbit.model.replace(omega=second + 2e-3)) == "period-4 impact-4"
    again = vi.switch_branch(point)
    assert again.name == "period-4 impact-4"
    assert again.determinant == pytest.approx(point.orbit.determinant**2, rel=1e-3)


def test_near_a_doubling_the_square_of_the_split_grows_with_the_parameter(as_model):
    """A pitchfork: half the split squared, the parameter is a quarter as far."""
    (point,) = vi.continue_orbit(first(2.6, as_model=as_model), "omega", (2.55, 2.7), step=0.1).special
    far, near = (abs(vi.switch_branch(point, amplitude=a).value("omega") - point.value) for a in (2e-3, 1e-3))
    assert far / near == pytest.approx(4.0, rel=1e-2)


@pytest.mark.parametrize(
    ("parameter", "span", "values"),
    [
        ("stiffness", (1.6, 2.3), (2.551469611, 0.04091934, 1.69698237, 1.8093324, 1.20655787, 0.50639540, -0.1330281)),
        ("omega", (0.9, 1.2), (1.5547508651, 0.01637423, 1.33915471, 1.6110999972, 1.05314477, 0.91838202, 0.0)),
    ],
)
def test_the_orbit_on_the_branch_born_at_a_doubling_can_be_followed_by_the_mass(parameter, span, values):
    names = "mass", "damping", "stiffness", "amplitude", "omega", "restitution", "gap"
    osc = vi.ImpactOscillator(**dict(zip(names, values, strict=True)))
    orbit = next(orbit for orbit in vi.find_orbit(osc) if orbit.admissible)
    branch = vi.continue_orbit(orbit, parameter, span, virtual=False)
    point = next(point for point in branch.special if point.kind == "period_doubling")
    doubled = vi.switch_branch(point)  # at the usual amplitude it would touch the stop once more
    assert doubled.admissible
    assert (doubled.n_periods, doubled.n_impacts) == (2 * orbit.n_periods, 2 * orbit.n_impacts)


def test_doubled_orbits_are_those_of_the_oscillator():
    osc = vi.ImpactOscillator(omega=2.6)
    branches = [follow_all(vi.find_orbit(model), "omega", (2.5, 2.8), step=0.05) for model in (osc, one_mass(osc))]
    for ours, theirs in zip(*branches, strict=True):
        assert ours.outcome == theirs.outcome
        assert [kind for kind, _ in specials(ours)] == [kind for kind, _ in specials(theirs)]
        assert [at for _, at in specials(ours)] == pytest.approx([at for _, at in specials(theirs)], rel=1e-10)


# Grazes

BESIDE_GRAZES = {  # by n and p: the oscillator, the range of omega, and the bifurcations of the branch
    (1, 4): (
        vi.ImpactOscillator(mass=0.3847, damping=0.2101, omega=1.2534, restitution=0.7066, gap=-0.28695),
        (1.1, 1.5),
        ["grazing", "period_doubling", "grazing"],
    ),
    (4, 2): (
        vi.ImpactOscillator(mass=0.7865, damping=0.03055, omega=2.8232, restitution=0.79348, gap=0.37876),
        (2.26, 2.9),
        ["grazing", "period_doubling"],
    ),
}


def beside_grazes(cycle, as_model, step=0.01):
    osc, ends, kinds = BESIDE_GRAZES[cycle]
    model = as_model(osc)
    (orbit, *_) = vi.find_orbit(model, n_periods=cycle[0], n_impacts=cycle[1], near=vi.impact_section(model))
    return vi.continue_orbit(orbit, "omega", ends, step=step), kinds


@pytest.mark.parametrize("cycle", BESIDE_GRAZES, ids=str)
@pytest.mark.parametrize("step", [0.01, 0.03, 0.1])
def test_a_step_may_hide_neither_a_doubling_before_a_graze_nor_the_first_of_two_grazes(as_model, cycle, step):
    """Where the velocity of an impact passes zero, a multiplier passes through infinity, from -1 to 1 or back."""
    branch, kinds = beside_grazes(cycle, as_model, step)
    assert [point.kind for point in branch.special] == kinds
    finer, _ = beside_grazes(cycle, as_model, 0.005)
    values = [point.value for point in branch.special]
    assert values == pytest.approx([point.value for point in finer.special], rel=1e-10)
    assert all(point.orbit.admissible for point in branch.special)


@pytest.mark.parametrize("away", [-1e-10, 1e-10])
@pytest.mark.parametrize(("at", "condition"), [(0, TOUCH), (-1, LAST_IMPACT)])
def test_rounding_does_not_decide_whether_the_orbit_of_a_graze_is_admissible(as_model, at, condition, away):
    branch, _ = beside_grazes((1, 4), as_model)
    equations, z = equations_of(branch.special[at].orbit, ("omega",), ((1.1, 1.5),))
    graze = Solution(*equations.at_graze(equations.pack(z)))
    moved = replace(graze, x=graze.x + away)
    assert moved.equations.condition == condition
    assert moved.touches == (condition == TOUCH)
    assert moved.admissible
    assert moved.orbit.admissible
    assert any(orbit.admissible for orbit in branch.orbits if orbit.value("omega") == branch.special[at].value)


@pytest.mark.long(but=4)
@pytest.mark.parametrize("seed", range(24))
def test_branches_of_random_oscillators_bifurcate_alike_as_one_mass_and_as_a_system(seed):
    rng, motion = np.random.default_rng([11, seed]), None
    while motion is None or motion.kind != "periodic":
        osc = random_oscillator(rng)
        motion = vi.recognise(vi.impact_section(osc))
    ends, values = (0.85 * osc.omega, 1.15 * osc.omega), []
    for model in (osc, one_mass(osc)):
        near = vi.impact_section(model)
        (orbit, *_) = vi.find_orbit(model, n_periods=motion.n_periods, n_impacts=motion.n_impacts, near=near)
        branch = vi.continue_orbit(orbit, "omega", ends)
        assert all(point.orbit.admissible for point in branch.special)
        values.append([(point.kind, point.value / osc.omega) for point in branch.special])
    assert [kind for kind, _ in values[0]] == [kind for kind, _ in values[1]]
    assert [at for _, at in values[0]] == pytest.approx([at for _, at in values[1]], abs=2e-9)


def test_where_a_valve_opens_no_more_its_impact_is_lost_at_a_graze():
    stops = [
        vi.Stop(direction=-1.0, gap=0.0, stiffness=1e5, damping=20.0, name="seat"),
        vi.Stop(direction=1.0, gap=2e-3, restitution=0.4, name="cage"),
    ]
    force = vi.Force(frequency=45.0, harmonics={1: 25.0}, constant=-30.0)
    valve = vi.ImpactSystem(mass=1.0, stiffness=1e4, damping=10.0, force=force, stops=stops)
    orbit = next(orbit for orbit in vi.find_orbit(valve) if orbit.admissible and orbit.stops == ("seat",))
    branch = vi.continue_orbit(orbit, "omega", (260.0, 500.0), virtual=False)
    (graze,) = branch.special
    assert graze.kind == branch.outcome[1] == "grazing"
    assert graze.orbit.velocities[0] == pytest.approx(0.0, abs=1e-9)
    names = [[each.name for each in vi.attractors(valve.replace(omega=graze.value + side))] for side in (-0.01, 0.01)]
    assert "period-1 impact-1" in names[0]
    assert names[1] == ["permanently in contact"]


def test_an_impact_is_lost_where_its_stop_pushes_again_before_it_is_left():
    model = drawn(np.random.default_rng([83, 13]), of_any_kind=True)[0]
    (orbit, *_) = vi.find_orbit(model, n_impacts=4, near=vi.impact_section(model))
    branch = vi.continue_orbit(orbit, "stop_1_gap", (0.2, orbit.value("stop_1_gap")))
    (graze,) = special_points(branch, "grazing")
    fewer, more = (
        min(branch.orbits, key=lambda each: abs(each.value("stop_1_gap") - graze.value - side))
        for side in (-2e-3, 2e-3)
    )
    assert [fewer.n_impacts, more.n_impacts] == [3, 4]
    for beside in (fewer, more):
        assert beside.admissible
        assert beside.stable
        assert name_of(beside) == beside.name


MULTIPLIERS = {  # what is zero at a bifurcation
    "fold": lambda mu: abs(mu - 1.0).min(),
    "pitchfork": lambda mu: abs(mu - 1.0).min(),
    "period_doubling": lambda mu: abs(mu + 1.0).min(),
    "neimark_sacker": lambda mu: abs(abs(mu) - 1.0).min(),
    "grazing": lambda mu: 0.0,
}


@pytest.mark.long(but=1)
@pytest.mark.parametrize("seed", [43, 10, 13, 31, 37, 97])
def test_the_multipliers_of_a_bifurcation_are_those_of_its_kind(seed):
    """Where the velocity of a contact with a damped stop passes zero, no multiplier is infinite (seeds 43 and 13)."""
    model = drawn(np.random.default_rng([83, seed]), of_any_kind=True)[0]
    near = vi.impact_section(model)
    motion = vi.recognise(near)
    (orbit, *_) = vi.find_orbit(model, n_periods=motion.n_periods, n_impacts=motion.n_impacts, near=near)
    gap = {"stop_1_gap": (0.85 * model.stops[0].gap - 0.02, 1.15 * model.stops[0].gap + 0.02)}
    for parameter, ends in {"omega": (0.85 * model.omega, 1.15 * model.omega), **gap}.items():
        for point in vi.continue_orbit(orbit, parameter, ends).special:
            assert MULTIPLIERS[point.kind](np.array(point.orbit.multipliers)) < 1e-5, point


# Folds


@pytest.mark.parametrize("omega", [1.1, 2.0, 3.0])
def test_without_a_gap_no_branch_folds(as_model, omega):
    orbit = first(omega, as_model=as_model)
    restitution = next(name for name in orbit.model.values if name.endswith("restitution"))
    ranges = {"omega": (omega - 0.05, omega + 0.5), restitution: (0.1, 1.0), "damping": (0, 1)}
    for parameter, ends in ranges.items():
        if parameter in orbit.model.values:
            branch = vi.continue_orbit(orbit, parameter, ends, step=0.1)
            assert not values_of(branch, "fold")
            assert branch.outcome == ("range", "range")
            assert (np.diff(branch.values) > 0).all()


def test_a_branch_with_a_gap_turns_at_its_fold_where_the_two_roots_meet(as_model):
    """The closed form's roots are one where g^2 = R^2 (1 + (alpha w / beta)^2)."""
    model = as_model(vi.ImpactOscillator(omega=1.2, gap=3.0))
    hit, grazed = vi.find_orbit(model)
    branch = vi.continue_orbit(hit, "omega", (1.0, 2.0), step=0.02)
    (fold,) = values_of(branch, "fold")
    assert len(vi.find_orbit(model.replace(omega=fold - 1e-9))) == 2
    assert len(vi.find_orbit(model.replace(omega=fold + 1e-9))) == 0
    assert max(branch.values) == pytest.approx(fold, rel=1e-14)
    at = int(np.argmin([abs(orbit.velocities[0] - grazed.velocities[0]) for orbit in branch.orbits]))
    assert branch.values[at] == pytest.approx(1.2, abs=0.05)
    (point,) = special_points(branch, "fold")
    assert point.orbit.trace == pytest.approx(1 + point.orbit.determinant, rel=1e-12)


def test_three_impacts_fold_even_without_a_gap():
    """That no branch folds without a gap is a law of one impact only."""
    branch = vi.continue_orbit(first(0.6, n_impacts=3), "omega", (0.55, 0.75), step=0.03, virtual=False)
    (point,) = special_points(branch, "fold")
    assert point.orbit.admissible
    assert max(branch.values) == point.value
    beside = point.orbit.model.replace(omega=point.value - 1e-5)
    pair = vi.find_orbit(beside, n_impacts=3)
    assert [orbit.stable for orbit in pair] in ([True, False], [False, False])
    assert (1 - pair[0].trace + pair[0].determinant) * (1 - pair[1].trace + pair[1].determinant) < 0


# Grazes


def test_one_impact_is_born_with_velocity_zero_where_the_free_motion_grazes(as_model):
    """The unstable orbit ends where the gap is the steady amplitude."""
    orbit = vi.find_orbit(as_model(vi.ImpactOscillator(omega=1.2, gap=3.0)))[1]
    gap = next(name for name in orbit.model.values if name.endswith("gap"))
    branch = vi.continue_orbit(orbit, gap, (1.0, 4.0), step=0.02)
    grazes = special_points(branch, "grazing")
    assert grazes[0].value == pytest.approx(vi.ImpactOscillator(omega=1.2).steady_amplitude, rel=1e-13)
    assert grazes[0].orbit.velocities[0] == pytest.approx(0, abs=1e-12)


def test_two_impacts_a_period_live_between_their_bifurcations(as_model):
    branch = vi.continue_orbit(
        first(0.95, n_impacts=2, as_model=as_model), "omega", (0.8, 1.1), step=0.02, virtual=False
    )
    stable = [orbit for orbit in branch.orbits if orbit.stable and orbit.admissible]
    for orbit in stable[:: max(1, len(stable) // 6)]:
        if min(abs(orbit.value("omega") - point.value) for point in branch.special) > 2e-3:
            assert name_of(orbit) == "period-1 impact-2"
    for point in branch.special:
        assert point.residual < 1e-12
        inside, outside = (
            name_of(point.orbit, point.orbit.model.replace(omega=point.value + side)) for side in (-2e-3, 2e-3)
        )
        assert inside != outside


def test_where_one_impact_begins_to_graze_a_second_impact_is_born(as_model, values):
    """At the graze the orbits with one and with two impacts a period are one, an impact without velocity."""
    branch = vi.continue_orbit(
        first(0.95, n_impacts=2, as_model=as_model), "omega", (0.8, 1.1), step=0.05, virtual=False
    )
    (graze,) = special_points(branch, "grazing")
    known = values["grazing_w_of_n=1"][0]
    assert graze.value == pytest.approx(float(known["w"]), abs=1e-12)
    assert sorted(graze.orbit.velocities) == pytest.approx([0.0, float(known["v"])], abs=1e-11)


# Quasi-periodic motions


@pytest.mark.parametrize(
    ("system", "orbit", "parameter", "span"),
    [
        (chain(), vi.find_orbit(chain())[0], "bar_gap", (0.5, 0.87)),
        (impact_damper(), symmetric_orbit(impact_damper()), "omega", (1.0, 1.12)),
    ],
)
def test_a_motion_settles_before_a_neimark_sacker_point_and_not_beyond(system, orbit, parameter, span):
    (point,) = special_points(vi.continue_orbit(orbit, parameter, span, step=0.1), "neimark_sacker")
    assert [abs(value) for value in point.orbit.multipliers[:2]] == pytest.approx([1, 1], abs=1e-10)
    assert point.orbit.multipliers[0].imag > 0.1
    for beyond in (False, True):
        there = system.replace(**{parameter: point.value * (1.001 if beyond else 0.999)})
        how = {"symmetric": True, "stops": "above"} if orbit.symmetric else {}
        nearest = min(vi.find_orbit(there, **how), key=lambda other: orbit_distance(other, point.orbit))
        assert nearest.stable is not beyond
        beside = vi.State(
            *(0.999 * np.array(part) for part in (nearest.start.displacement, nearest.start.velocity)),
            nearest.start.time,
        )
        hits = vi.impact_section(there, start=beside, transient_impacts=20000, sample_impacts=200).velocity.values
        assert (np.ptp(hits) > 0.01 * hits.max()) is np.bool_(beyond)
        if not beyond:
            assert hits == pytest.approx(nearest.velocities[0], rel=1e-10)
