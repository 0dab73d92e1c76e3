"""Branches of orbits of systems: closed forms, one mass in another form, and what the engine does beside them."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from contents import special_points
from plain import Plain
from systems import bouncing_ball, chain, changed, impact_damper, one_mass, two_sided
from vibroimpact.continuation import follow_all
from vibroimpact.orbits import orbit_distance

pytestmark = pytest.mark.usefixtures("modal_engine")

GRAVITY = 9.81


@vi.family
def ball(amplitude=0.02, omega=20.0, restitution=0.5):
    table = vi.Stop(direction=-1, gap=0.0, restitution=restitution, name="table", motion={1: -amplitude})
    return vi.ImpactSystem(mass=0.3, stiffness=0.0, force=vi.Force(omega=omega, constant=-0.3 * GRAVITY), stops=[table])


def specials(branch):
    return sorted((point.kind, point.value) for point in branch.special)


def symmetric(system, **how):
    return next(orbit for orbit in vi.find_orbit(system, stops="above", symmetric=True, **how) if orbit.stable)


@pytest.fixture(scope="module")
def two_sided_branch():
    return vi.continue_orbit(symmetric(two_sided()), "omega", (1.0, 2.5), step=0.05, virtual=False)


@pytest.fixture(scope="module")
def damper():
    return vi.continue_orbit(symmetric(impact_damper()), "omega", (0.75, 1.2), step=0.1)


# Closed forms: the bouncing ball, J. Guckenheimer and P. Holmes, Nonlinear Oscillations (1983), section 2.4


def of_the_ball(restitution, n_periods):
    fold = n_periods * math.pi * (1 - restitution) / (1 + restitution)
    return fold, math.hypot(fold, 2 * (1 + restitution**2) / (1 + restitution) ** 2)


@pytest.mark.parametrize(("restitution", "n_periods"), [(0.5, 1), (0.25, 2), (0.8, 3)])
def test_the_ball_folds_and_doubles_over_the_amplitude_where_the_closed_form_says(restitution, n_periods):
    fold, doubling = of_the_ball(restitution, n_periods)
    of_gamma = GRAVITY / ball().omega ** 2
    orbit = vi.find_orbit(
        ball.replace(restitution=restitution, amplitude=0.5 * (fold + doubling) * of_gamma), n_periods=n_periods
    )[0]
    branch = vi.continue_orbit(orbit, "amplitude", (0.95 * fold * of_gamma, 1.05 * doubling * of_gamma), step=0.1)
    for kind, gamma in {"fold": fold, "period_doubling": doubling}.items():
        (point,) = special_points(branch, kind)
        assert point.value / of_gamma == pytest.approx(gamma, rel=1e-12)
        assert point.orbit.admissible
    for orbit in branch.orbits:
        assert np.prod(orbit.multipliers) == pytest.approx(orbit.determinant, rel=1e-10)


def test_the_ball_folds_and_doubles_over_the_frequency_where_known():
    (orbit, *_) = vi.find_orbit(bouncing_ball(1.2, omega=3.0))
    branch = vi.continue_orbit(orbit, "omega", (2.7, 3.6), step=0.1)
    gammas = {point.kind: 1.2 * (point.value / 3.0) ** 2 for point in branch.special}
    assert gammas["fold"] == pytest.approx(1.047197551197, abs=1e-12)
    assert gammas["period_doubling"] == pytest.approx(1.526823700519, abs=1e-12)


# One mass, in another form


def test_one_mass_as_a_system_has_the_special_points_of_the_oscillator():
    rng, met = np.random.default_rng(7), 0
    for number in range(3):
        osc = vi.ImpactOscillator(
            omega=rng.uniform(2.2, 2.7), restitution=rng.uniform(0.6, 0.9), damping=rng.uniform(0.0, 0.05)
        )
        known = vi.find_orbit(osc)[0]
        orbit = min(vi.find_orbit(one_mass(osc)), key=lambda other: orbit_distance(other, known))
        axis = ("omega", "gap", "restitution")[number % 3]
        value = osc.values[axis]
        span = {"omega": (2.0, 3.0), "gap": (value - 0.4, value + 0.4), "restitution": (0.3, 1.0)}[axis]
        parameter = axis if axis == "omega" else f"stop_1_{axis}"
        points = specials(vi.continue_orbit(orbit, parameter, span, step=0.1))
        expected = specials(vi.continue_orbit(known, axis, span, step=0.1))
        assert [kind for kind, _ in points] == [kind for kind, _ in expected]
        assert [at for _, at in points] == pytest.approx([at for _, at in expected], rel=1e-10)
        met += len(expected)
    assert met > 2


def test_rising_from_a_plastic_impact_is_no_graze():
    osc = vi.ImpactOscillator(omega=1.6, restitution=0.0, damping=0.1, gap=0.3)
    orbit = vi.find_orbit(osc)[0]
    branch = vi.continue_orbit(vi.find_orbit(one_mass(osc))[0], "stop_1_gap", (0.0, 0.7), step=0.1)
    assert specials(branch) == specials(vi.continue_orbit(orbit, "gap", (0.0, 0.7), step=0.1)) == []
    assert branch.orbits[0].admissible == vi.find_orbit(osc.replace(gap=0.0))[0].admissible


def test_doubled_orbits_are_those_of_the_oscillator():
    osc = vi.ImpactOscillator(omega=2.6)
    branches = [follow_all(vi.find_orbit(model), "omega", (2.5, 2.8), step=0.05) for model in (osc, one_mass(osc))]
    for ours, theirs in zip(*branches, strict=True):
        assert ours.outcome == theirs.outcome
        assert [kind for kind, _ in specials(ours)] == [kind for kind, _ in specials(theirs)]
        assert [at for _, at in specials(ours)] == pytest.approx([at for _, at in specials(theirs)], rel=1e-10)


# The same system in other coordinates


@pytest.mark.long(but=1)
@pytest.mark.parametrize("how", ["permuted and mirrored, in other units", "a mode more"])
def test_special_points_do_not_depend_on_coordinates(how):
    system = chain()
    if how == "a mode more":
        more = [np.diag([*part.diagonal(), 0.0]) for part in (np.zeros((3, 3)),) * 3]
        for part, grown, entry in zip(
            (system.mass, system.damping, system.stiffness), more, (2.0, 0.1, 3.0), strict=True
        ):
            grown[:3, :3], grown[3, 3] = part, entry
        other = vi.ImpactSystem(
            mass=more[0],
            damping=more[1],
            stiffness=more[2],
            force=vi.Force(omega=0.9, harmonics={1: [1.0, 0.0, 0.0, 0.5]}),
            stops=[vi.Stop(direction=[0, 0, 1, 0], gap=0.5, restitution=0.7, name="bar")],
        )
    else:
        basis = np.diag([0.5, 3.0, -2.0])[[2, 0, 1]]
        other = changed(system, basis=basis)
    branches = [
        vi.continue_orbit(vi.find_orbit(one)[0], f"{one.stop_names[0]}_gap", (0.4, 0.9), step=0.1)
        for one in (system, other)
    ]
    ours, theirs = map(specials, branches)
    assert [kind for kind, _ in ours] == [kind for kind, _ in theirs]
    assert len(ours) > 1
    assert [at for _, at in ours] == pytest.approx([at for _, at in theirs], rel=1e-10)


# Bifurcations


@pytest.mark.parametrize(
    ("system", "orbit", "parameter", "span"),
    [
        (chain(), vi.find_orbit(chain())[0], "bar_gap", (0.5, 0.87)),
        (impact_damper(), symmetric(impact_damper()), "omega", (1.0, 1.12)),
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


def test_twins_are_born_at_a_pitchfork(two_sided_branch):
    """The half map doubles its period there; beyond, the motion from rest is one of the twins."""
    first, last = special_points(two_sided_branch, "pitchfork")
    for point in (first, last):
        assert point.orbit.symmetric
        assert point.orbit.half_multipliers[0] == pytest.approx(-1, abs=1e-11)
        born = vi.switch_branch(point, amplitude=1e-3)
        twin = born.twin
        assert not born.symmetric
        assert orbit_distance(born, point.orbit) < 0.01
        assert abs(born.value("omega") - point.value) < 1e-4
        for orbit in (born, twin):
            assert Plain(orbit.system).replayed(orbit) < 1e-11
        (same,) = vi.find_orbit(born.system, stops=twin.stops, near=twin)
        assert orbit_distance(same, twin) < 1e-9
        assert orbit_distance(born, twin) > 1e-4 or born.stops != twin.stops
        assert twin.twin.turns == pytest.approx(born.turns, abs=1e-12)
        assert twin.twin.start.displacement == pytest.approx(born.start.displacement, abs=1e-12)


def test_the_asymmetric_branch_leads_from_pitchfork_to_pitchfork(two_sided_branch):
    first, last = special_points(two_sided_branch, "pitchfork")
    branch = vi.continue_orbit(vi.switch_branch(first), "omega", (1.0, 2.5), step=0.1)
    assert branch.outcome == ("pitchfork", "pitchfork")
    ends = special_points(branch, "pitchfork")
    assert [end.value for end in ends] == pytest.approx([first.value, last.value], rel=1e-12)
    for graze in special_points(branch, "grazing"):
        plain = Plain(graze.orbit.system)
        assert touched(plain, graze) < 1e-12
    for orbit in branch.orbits:
        assert np.prod(orbit.multipliers) == pytest.approx(orbit.determinant, rel=1e-10)


def touched(plain, point):
    """Return the least clearance and rate near the touch of a graze, by SciPy's exponential, over the state's size."""
    orbit, stops = point.orbit, {stop.name: stop for stop in point.orbit.system.stops}
    times, period = [turn * orbit.system.period for turn in orbit.turns], orbit.system.period
    found = []
    for whole in range(orbit.n_periods + 1):
        at = (whole + point.touch_phase) * period
        if not times[0] < at <= times[0] + orbit.period:
            continue
        x, begin = np.append(orbit.start.displacement, orbit.start.velocity), times[0]
        for name, time in zip(orbit.stops, times, strict=True):
            if time < at:
                x, begin = plain.hit(stops[name], plain.fly(x, begin, time), time), time
        x = plain.fly(x, begin, at)
        found += [
            abs(plain.clearance(stop, x, at)) + abs(plain.speed(stop, x, at)) / orbit.system.omega
            for stop in stops.values()
        ]
    return min(found) / np.abs(x).max()


def test_symmetric_orbits_settle_between_their_pitchforks_as_diagrams_show(two_sided_branch):
    first, last = special_points(two_sided_branch, "pitchfork")
    for value in (first.value - 0.01, last.value + 0.05):
        diagram = vi.bifurcation_diagram(two_sided(), omega=[value], transient_impacts=4000, sample_impacts=40)
        hits = diagram.velocity.values.ravel()
        assert np.ptp(hits) < 1e-9
    inside = vi.bifurcation_diagram(two_sided(), omega=[first.value + 0.005], transient_impacts=8000, sample_impacts=40)
    assert np.ptp(inside.velocity.values) > 1e-3


def test_a_broken_symmetry_is_followed_with_the_whole_cycle():
    orbit = symmetric(two_sided())
    branch = vi.continue_orbit(orbit, "below_gap", (0.3, 0.7), step=0.1)
    assert not any(other.symmetric for other in branch.orbits)
    assert branch.outcome == ("range", "range")
    for other in branch.orbits[::4]:
        assert Plain(other.system).replayed(other) < 1e-11


def test_an_orbit_without_a_mirror_has_no_twin():
    with pytest.raises(ValueError, match="no twin"):
        _ = vi.find_orbit(chain())[0].twin


def test_a_frequency_in_hertz_and_steps_of_any_length_give_the_same_points(two_sided_branch):
    orbit, (first, _) = symmetric(two_sided()), special_points(two_sided_branch, "pitchfork")
    ends = (1.05 / 2 / math.pi, 2.1 / 2 / math.pi)
    known = special_points(vi.continue_orbit(orbit, "frequency", ends, step=0.4), "pitchfork")[0]
    assert 2 * math.pi * known.value == pytest.approx(first.value, rel=1e-12)


@pytest.mark.long
def test_a_branch_that_loses_its_last_contact_ends_where_the_steady_motion_touches_the_stop():
    """x'' + .05 x' + x = sin wt touches where (1 - w^2)^2 + (.05 w)^2 = 1/gap^2; the message and the point agree."""
    gap, damping = 5.8, 0.05
    stops = [vi.Stop(direction=1, gap=gap, stiffness=0.1)]
    soft = vi.ImpactSystem(
        mass=1, damping=damping, stiffness=1, force=vi.Force(omega=1.0, harmonics={1: 1}), stops=stops
    )
    half = 1.0 - 0.5 * damping**2
    squares = half + np.array([-1.0, 1.0]) * np.sqrt(half**2 - 1.0 + 1.0 / gap**2)
    (orbit,) = vi.find_orbit(soft)
    branch = vi.continue_orbit(orbit, "omega", (0.8, 1.3))
    assert branch.outcome == ("grazing", "grazing")
    ends = branch.values[[0, -1]]
    assert ends == pytest.approx(np.sqrt(squares), abs=1e-11)
    assert [point.value for point in special_points(branch, "grazing")] == ends.tolist()
    for low in ends:
        assert f"omega = {low:.12g} rad/s, where it grazes the stop" in branch.message
