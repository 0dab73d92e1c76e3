"""Branches of orbits on compliant stops, and their bifurcations and boundaries, against published and exact values."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from branching import name_of, values_of
from compliant import between, bilinear, the_stable, two_masses
from contents import special_points
from systems import drawn
from vibroimpact.continuation import stable_windows


@pytest.fixture(scope="module")
def branch():
    return vi.continue_orbit(vi.find_orbit(two_masses)[0], "omega", (0.6, 0.8))


@pytest.mark.long
def test_two_masses_on_a_one_sided_spring_double_and_fold_where_it_is_known(branch):
    assert sorted(point.value for point in special_points(branch, "period_doubling")) == pytest.approx(
        [0.7387830254, 0.7555861594], abs=1e-10
    )
    # The fold at which the contact that is born becomes stable or not lies 6e-9 beside its graze.
    beside, known = sorted(point.value for point in special_points(branch, "fold"))
    assert known == pytest.approx(0.7556273526, abs=1e-10)
    assert 0.0 < branch.special[-1].value - beside < 1e-8
    assert max(point.residual for point in branch.special) < 1e-12


@pytest.mark.long
def test_two_masses_on_a_one_sided_spring_have_a_neimark_sacker_point(branch):
    (point,) = special_points(branch, "neimark_sacker")
    first, second = point.orbit.multipliers[:2]
    assert abs(first) == pytest.approx(1.0, abs=1e-12)
    assert first == second.conjugate()
    assert first.imag > 0.1
    assert point.value == pytest.approx(0.6186068742670, abs=1e-11)


@pytest.mark.long
def test_two_masses_on_a_one_sided_spring_swing_farthest_where_it_is_known():
    # There the constant part counts half: sqrt(q_0^2/2 + sum |q_h|^2/2) of the displacement.
    found = vi.continue_orbit(vi.find_orbit(two_masses.replace(omega=0.754))[0], "omega", (0.7525, 0.7552), step=0.02)
    swings = []
    for orbit in found.orbits:
        displacement, _, _ = orbit.motion(np.linspace(0.0, orbit.period, 512, endpoint=False))
        swings.append(math.hypot(displacement[:, 0].std(), displacement[:, 0].mean() / math.sqrt(2.0)))
    at = int(np.argmax(swings))
    assert swings[at] == pytest.approx(0.97951, abs=1e-5)
    assert found.orbits[at].value("omega") == pytest.approx(0.75399, abs=2e-4)


@pytest.mark.long
def test_a_contact_is_born_where_the_motion_without_stops_swings_as_far_as_the_gap(branch):
    (point,) = special_points(branch, "grazing")
    system, omega = two_masses.at(), point.value
    dynamic = system.stiffness - omega**2 * system.mass + 1j * omega * system.damping
    assert abs(np.linalg.solve(dynamic, [0.0, 0.1])[0]) == pytest.approx(1.0, abs=1e-13)
    assert point.orbit.velocities == (0.0,)
    free = np.block([[np.zeros((2, 2)), np.eye(2)], [-system.stiffness, -system.damping]])
    expected = np.exp(np.linalg.eigvals(free).real * point.orbit.period)
    assert sorted(np.abs(point.orbit.multipliers)) == pytest.approx(sorted(expected), abs=1e-12)  # nothing jumps


@pytest.mark.long
def test_without_damping_multipliers_go_on_beyond_a_graze():
    begin = the_stable(vi.find_orbit(between.replace(below=1.4, gap=0.2, omega=2.0, stiffness=100.0), stops="above"))
    found = vi.continue_orbit(begin, "below", (1.0, 1.5))
    (graze,) = special_points(found, "grazing")
    born = next(
        orbit for orbit in found.orbits if orbit.n_impacts == 2 and abs(orbit.value("below") - graze.value) < 1e-5
    )
    assert sum(begin.multipliers) == pytest.approx(sum(graze.orbit.multipliers), abs=1e-9)
    assert {orbit.n_impacts for orbit in found.orbits} == {1, 2}
    assert all(orbit.admissible for orbit in found.orbits)
    assert 0.0 < min(born.velocities) < 0.02


# Symmetry


@pytest.fixture(scope="module")
def symmetric():
    (orbit,) = vi.find_orbit(between, stops="above", symmetric=True)
    return vi.continue_orbit(orbit, "omega", (1.8, 3.2), step=0.05)


def test_between_two_equal_springs_twins_are_born_at_a_pitchfork(symmetric):
    (point,) = special_points(symmetric, "pitchfork")
    assert min(abs(value + 1.0) for value in point.orbit.half_multipliers) < 1e-10
    twin = vi.switch_branch(point)
    assert not twin.symmetric
    assert twin.n_periods == 1
    assert twin.velocities[0] != pytest.approx(twin.velocities[1], rel=1e-6)
    assert twin.twin.stops == twin.stops[::-1]
    back = vi.find_orbit(twin.twin.system, stops=twin.twin.stops, near=twin.twin)
    assert back[0].velocities == pytest.approx(twin.twin.velocities, rel=1e-9)


# Boundaries


def test_a_curve_of_pitchforks_is_followed_over_the_gap(symmetric):
    (point,) = special_points(symmetric, "pitchfork")
    curve = vi.continue_boundary(point, ("omega", "stiffness"), ((2.0, 2.3), (25.0, 35.0)), step=0.1)
    assert curve.kind == "pitchfork"
    assert max(curve.residuals) < 1e-10


@pytest.mark.long
@pytest.mark.parametrize("number", range(5))
def test_every_boundary_is_a_ray_of_force_over_gap(branch, number):
    # Motion in units of the gap depends on the force over the gap alone.
    point = branch.special[number]
    curve = vi.continue_boundary(point, ("gap", "push"), ((0.5, 2.0), (0.05, 0.2)), step=0.05)
    assert curve.kind == point.kind
    ratios = [orbit.value("push") / orbit.value("gap") for orbit in curve.orbits]
    assert ratios == pytest.approx([0.1] * len(ratios), rel=1e-11)
    gaps = [orbit.value("gap") for orbit in curve.orbits]
    assert (min(gaps), max(gaps)) == pytest.approx((0.5, 2.0))


@pytest.mark.long
@pytest.mark.parametrize("kind", ["neimark_sacker", "fold"])
def test_a_boundary_passes_through_the_special_points_of_a_branch_beside(branch, kind):
    point = special_points(branch, kind)[0]
    curve = vi.continue_boundary(point, ("omega", "gap"), ((0.6, 0.8), (0.9, 1.1)), step=0.05)
    beside = min(curve.orbits, key=lambda orbit: abs(orbit.value("gap") - 0.95))
    model, omega = two_masses.replace(gap=beside.value("gap")), beside.value("omega")
    start = vi.find_orbit(model.replace(omega=omega - 0.002), stops=beside.stops, near=beside)[0]
    crossing = vi.continue_orbit(start, "omega", (omega - 0.004, omega + 0.002))
    assert min(abs(point.value - omega) for point in special_points(crossing, kind)) < 1e-10


@pytest.mark.long
def test_the_boundaries_of_a_plane_are_found_without_a_guess():
    @vi.family
    def one(gap=0.05, push=1.0):
        stops = [vi.Stop(direction=1, gap=gap, stiffness=100.0, damping=1.0, name="above")]
        return bilinear(stops=stops, omega=2.45, push=push)

    curves = vi.boundary_curves(one, ("gap", "push"), ((0.02, 0.1), (0.4, 1.5)), n_periods=(1,), lines=2, step=0.2)
    rays = {curve.kind: [orbit.value("gap") / orbit.value("push") for orbit in curve.orbits] for curve in curves}
    steady = abs(1.0 / (1.0 - 2.45**2 + 0.05j * 2.45))
    assert rays["grazing"] == pytest.approx([steady] * len(rays["grazing"]), rel=1e-12)
    (doubling,) = (
        point
        for point in vi.continue_orbit(vi.find_orbit(one)[0], "gap", (0.04, 0.06)).special
        if point.kind == "period_doubling"
    )
    assert rays["period_doubling"] == pytest.approx([doubling.value] * len(rays["period_doubling"]), rel=1e-10)


# Where events appear, vanish or change places


def windows_of(branch):
    """Return impacts and ends of the stable windows, in each of which the engine settles on the orbits."""
    windows = stable_windows(branch)
    for window in windows:
        for share in (0.1, 0.5, 0.9):
            inside, *_ = window.orbits_at(window.low + share * (window.high - window.low))
            assert inside.name == window.name == name_of(inside)
    return [window.n_impacts for window in windows], [window.ends for window in windows]


@pytest.mark.long
def test_windows_end_where_an_impact_is_lost_or_born_between_two_pushes_of_a_damped_stop():
    model = drawn(np.random.default_rng([83, 13]), of_any_kind=True)[0]
    (orbit, *_) = vi.find_orbit(model, n_impacts=4, near=vi.impact_section(model))
    impacts, ends = windows_of(vi.continue_orbit(orbit, "omega", (1.611, orbit.value("omega")), virtual=False))
    assert impacts == [3, 4, 3, 4]
    assert ends == [("range", "grazing"), ("grazing", "grazing"), ("grazing", "grazing"), ("grazing", "range")]


def test_a_branch_goes_on_where_a_gap_within_a_contact_vanishes():
    model = drawn(np.random.default_rng([84, 76]), of_any_kind=True)[0]
    (orbit, *_) = vi.find_orbit(model, near=vi.impact_section(model))
    branch = vi.continue_orbit(orbit, "omega", (0.63, 0.73))
    impacts, ends = windows_of(branch)
    assert impacts == [1, 2, 1]
    assert ends == [("range", "grazing"), ("grazing", "grazing"), ("grazing", "range")]
    assert all(each.admissible for each in branch.orbits)


def test_a_contact_with_a_lightly_damped_stop_parts_in_two_at_a_graze_and_is_free_in_between_soon_after():
    # Where its force first vanishes the stop is pressed in by l^2 u'', as good as nothing: l = c/k is 0.8 ms.
    stop = vi.Stop(direction=1, gap=0.223, stiffness=23.3, damping=0.018, name="a")
    system = vi.ImpactSystem(
        mass=1.0, damping=0.07, stiffness=1.0, force=vi.Force(omega=2.45, harmonics={1: 1.0}), stops=[stop]
    )
    (orbit, *_) = (each for each in vi.find_orbit(system, n_periods=2, n_impacts=1) if each.admissible)
    branch = vi.continue_orbit(orbit, "omega", (2.0, 2.5), virtual=False)
    assert all(each.admissible for each in branch.orbits)
    opening, freed = values_of(branch, "grazing")[:2]
    assert 0.0 < abs(freed - opening) < 1e-7
    assert {each.n_impacts for each in branch.orbits} == {1, 2}


@pytest.mark.long
def test_a_branch_is_the_same_however_its_steps_fall():
    # At its lower end two short contacts vanish at nearly the same place, and twins of the orbits are close.
    stop = vi.Stop(direction=1, gap=0.606, stiffness=185.1, damping=0.15)
    force = vi.Force(omega=3.52, harmonics={1: 1.0})
    system = vi.ImpactSystem(mass=1.0, damping=0.08, stiffness=1.0, force=force, stops=[stop])
    orbit = next(orbit for orbit in vi.find_orbit(system, n_periods=3) if orbit.admissible)
    places = []
    for high in (0.65, 0.75, 0.85):
        branch = vi.continue_orbit(orbit, "stop_1_gap", (-0.5, high), step=0.02, virtual=False)
        assert branch.outcome == ("range", "range")
        places.append([special.value for special in branch.special])
    assert len(places[0]) == 10
    assert places[1] == pytest.approx(places[0], rel=1e-11)
    assert places[2] == pytest.approx(places[0], rel=1e-11)


@pytest.mark.long
def test_a_graze_is_found_also_where_another_one_is_just_past():
    # Downwards, a part that was free before it was struck is still pressed in; then the force of another contact
    # vanishes for a moment.
    model = drawn(np.random.default_rng([84, 50]), of_any_kind=True)[0].replace(omega=0.27795)
    (orbit, *_) = vi.find_orbit(model, near=vi.impact_section(model))
    branch = vi.continue_orbit(orbit, "omega", (0.2777, 0.278), virtual=False)
    assert branch.outcome == ("range", "range")
    assert all(each.admissible for each in branch.orbits)
    assert values_of(branch, "grazing") == pytest.approx([0.277743913534, 0.277903534891], rel=1e-11)


@pytest.mark.long
def test_a_branch_goes_on_where_an_impact_on_a_rigid_stop_and_a_contact_with_a_compliant_one_change_places():
    model = drawn(np.random.default_rng([84, 68]), of_any_kind=True)[0]
    (orbit, *_) = vi.find_orbit(model, near=vi.impact_section(model))
    branch = vi.continue_orbit(orbit, "omega", (orbit.value("omega"), 0.878), virtual=False)
    assert branch.outcome == ("range", "range")
    assert all(each.admissible for each in branch.orbits)
    orders = ("stop_2", "stop_2", "stop_1", "stop_1"), ("stop_2", "stop_1", "stop_2", "stop_1")
    assert {each.stops for each in branch.orbits} == set(orders)
    last = branch.orbits[-1]
    motion = vi.simulate(last.model, start=last.start, periods=1, samples_per_period=50)
    displacement, _, _ = last.motion(motion["time"].values)
    assert motion["displacement"].values == pytest.approx(displacement, abs=1e-9)


def test_a_branch_has_the_same_special_points_from_whichever_of_its_orbits_it_is_followed():
    # Two pushes appear at a graze in one direction and meet in the other.
    model = drawn(np.random.default_rng([86, 16]), of_any_kind=True)[0]
    (orbit, *_) = vi.find_orbit(model, n_periods=2, near=vi.impact_section(model))
    branch = vi.continue_orbit(orbit, "omega", (1.0, 1.2), step=0.02, virtual=False)
    inside = min(branch.orbits, key=lambda each: abs(each.value("omega") - 1.065))
    again = vi.continue_orbit(inside, "omega", (1.0, 1.2), step=0.02, virtual=False)
    assert len(branch.special) == 2
    assert branch.outcome == again.outcome == ("range", "range")
    assert values_of(again, "grazing") == pytest.approx(values_of(branch, "grazing"), rel=1e-12)


@pytest.mark.long
def test_a_branch_closes_also_where_contacts_have_appeared_and_vanished_on_the_way():
    stop = vi.Stop(direction=1, gap=0.44, stiffness=38.0, damping=0.295, name="a")
    force = vi.Force(omega=3.28, harmonics={1: 1.0})
    system = vi.ImpactSystem(mass=1.0, damping=0.03, stiffness=1.0, force=force, stops=[stop])
    orbit = next(orbit for orbit in vi.find_orbit(system, n_periods=3) if orbit.admissible)
    branch = vi.continue_orbit(orbit, "a_gap", (-0.5, 2.0), step=0.02, virtual=False)
    assert branch.outcome == ("closed", "closed")
    assert all(each.admissible for each in branch.orbits)
    assert {each.n_impacts for each in branch.orbits} == {1, 2}
    first, last = branch.orbits[0], branch.orbits[-1]
    assert first.value("a_gap") == pytest.approx(last.value("a_gap"), rel=1e-9)
    assert first.velocities == pytest.approx(last.velocities, rel=1e-9)
    places = sorted(point.value for point in branch.special)
    assert min(np.diff(places)) > 1e-9  # none is listed twice


@pytest.mark.long
def test_orbits_of_three_periods_live_from_one_graze_of_the_period_1_orbit_to_the_same_again():
    # On the way events of two stops change places twice.
    model = drawn(np.random.default_rng([85, 7]), of_any_kind=True)[0]
    (orbit, *_) = vi.find_orbit(model, n_periods=3, n_impacts=5, near=vi.impact_section(model))
    branch = vi.continue_orbit(orbit, "omega", (1.34, 2.0), step=0.05, virtual=False)
    assert branch.outcome == ("grazing", "grazing")
    assert all(each.admissible for each in branch.orbits)
    low, high = branch.orbits[0], branch.orbits[-1]
    assert low.value("omega") == pytest.approx(high.value("omega"), rel=1e-11)
    for each in (low, high):
        times = np.linspace(0.0, 3.0 * each.period, 301)
        displacement, _, _ = each.motion(times)
        assert displacement[100:] == pytest.approx(displacement[:-100], abs=1e-6)
