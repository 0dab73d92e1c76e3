"""Symmetric motions between two stops: their pitchforks, the twins born there, and the curves of both."""

import numpy as np
import pytest

import vibroimpact as vi
from contents import special_points
from plain import Plain
from systems import chain, symmetric_orbit, two_sided
from vibroimpact.continuation import coverage, curves_through
from vibroimpact.dataset import bundle
from vibroimpact.orbits import orbit_distance
from vibroimpact.report import sentences_of

pytestmark = pytest.mark.usefixtures("modal_engine")


@pytest.fixture(scope="module")
def two_sided_branch():
    return vi.continue_orbit(symmetric_orbit(two_sided()), "omega", (1.0, 2.5), step=0.05, virtual=False)


@vi.family
def symmetric_family(omega=2.0, gap=0.5, restitution=0.6):
    return two_sided(omega, restitution, gap)


@pytest.fixture(scope="module")
def pitchfork():
    model = symmetric_family.replace(omega=2.0)
    orbit = next(found for found in vi.find_orbit(model, n_impacts=2) if found.symmetric and found.stable)
    return special_points(vi.continue_orbit(orbit, "omega", (1.0, 2.1), step=0.1), "pitchfork")[0]


# Twins


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
    orbit = symmetric_orbit(two_sided())
    branch = vi.continue_orbit(orbit, "below_gap", (0.3, 0.7), step=0.1)
    assert not any(other.symmetric for other in branch.orbits)
    assert branch.outcome == ("range", "range")
    for other in branch.orbits[::4]:
        assert Plain(other.system).replayed(other) < 1e-11


@pytest.mark.parametrize("model", [chain(), vi.ImpactOscillator()], ids=["three masses", "one mass"])
def test_an_orbit_without_a_mirror_has_no_twin(model):
    with pytest.raises(ValueError, match="no twin"):
        _ = vi.find_orbit(model)[0].twin


# Curves


def test_pitchforks_are_followed_where_the_plane_keeps_the_symmetry(pitchfork):
    curve = vi.continue_boundary(pitchfork, ("omega", "restitution"), ((0.9, 2.1), (0.5, 0.8)), step=0.1)
    assert curve.kind == "pitchfork"
    for orbit in curve.orbits:
        assert orbit.symmetric
        assert min(abs(value + 1) for value in orbit.half_multipliers) < 1e-9


@pytest.mark.parametrize(
    ("plane", "breaking"),
    [
        ((("omega", "above_gap"), ((0.9, 2.1), (0.3, 0.7))), "above_gap"),
        ((("above_gap", "below_gap"), ((0.3, 0.7),) * 2), "above_gap and below_gap"),
    ],
)
def test_a_plane_that_breaks_the_symmetry_has_no_pitchforks(plane, breaking):
    orbit = symmetric_orbit(two_sided())
    (point, *_) = special_points(vi.continue_orbit(orbit, "omega", (1.0, 2.1), step=0.1), "pitchfork")
    with pytest.raises(ValueError, match=f"and {breaking} would break the symmetry of the model; vary parameters that"):
        vi.continue_boundary(point, *plane)


def test_a_boundary_of_a_system_survives_files_and_is_drawn(tmp_path, pitchfork):
    curve = vi.continue_boundary(pitchfork, ("omega", "restitution"), ((0.9, 2.1), (0.55, 0.7)), step=0.2)
    vi.save(curve.dataset, tmp_path / "curve.nc")
    assert vi.load(tmp_path / "curve.nc").identical(curve.dataset)
    ax = vi.plotting.boundaries(curve)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["pitchfork of period-1 impact-2"]


def test_the_graze_at_which_a_symmetric_orbit_of_two_impacts_ends_is_one_of_the_motion_without_impacts():
    """Both impacts have velocity 0 there: what touches is the steady motion, of no impact, as on R = g."""
    model = symmetric_family.replace(omega=2.0)
    orbit = next(found for found in vi.find_orbit(model, n_impacts=2) if found.symmetric and not found.stable)
    (graze,) = special_points(vi.continue_orbit(orbit, "omega", (1.5, 2.1), step=0.05, virtual=False), "grazing")
    system = graze.orbit.system
    stiffness, damping, mass = (float(np.ravel(part)[0]) for part in (system.stiffness, system.damping, system.mass))
    swing = 1.0 / abs(stiffness - mass * graze.value**2 + 1j * graze.value * damping)
    assert swing == pytest.approx(0.5, rel=1e-9)
    (curve,) = curves_through([graze], ("omega", "gap"), ((1.5, 2.1), (0.2, 0.8)), step=0.1)
    assert max(max(orbit.velocities) for orbit in curve.orbits) == 0.0
    (text,) = vi.plotting.boundaries(curve).get_legend().get_texts()
    assert text.get_text() == "grazing of the motion without impacts"
    assert "grazing of the motion without impacts" in " ".join(
        sentences_of(bundle([curve.dataset], "boundary_curves", {}))
    )


def test_the_motion_of_a_cell_is_followed_to_the_pitchfork_that_ends_it(pitchfork):
    """A coarse map's cycles are followed across its class boundaries."""
    model = symmetric_family.replace(omega=1.05)
    orbit = coverage._orbit_of(model, 1, 2)
    assert orbit.symmetric
    end, lasts = coverage._end_of_orbit(orbit, "omega", (1.05, 1.15))
    assert (end.kind, lasts) == ("pitchfork", False)
    assert end.value == pytest.approx(pitchfork.value, rel=1e-12)
