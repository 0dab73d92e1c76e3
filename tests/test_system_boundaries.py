"""Curves of bifurcations of systems in two parameters: closed forms, one mass in another form, and identities."""

import numpy as np
import pytest

import vibroimpact as vi
from contents import special_points
from systems import chain, one_mass, two_sided
from test_system_continuation import GRAVITY, ball, of_the_ball, symmetric
from vibroimpact.continuation import Boundaries, coverage, curves
from vibroimpact.continuation.curves import curves_through
from vibroimpact.continuation.results import kinds_of
from vibroimpact.dataset import bundle, unbundle
from vibroimpact.orbits import orbit_distance
from vibroimpact.report import sentences_of

pytestmark = pytest.mark.usefixtures("modal_engine")


@vi.family
def symmetric_family(omega=2.0, gap=0.5, restitution=0.6):
    return two_sided(omega, restitution, gap)


@pytest.fixture(scope="module")
def pitchfork():
    model = symmetric_family.replace(omega=2.0)
    orbit = next(found for found in vi.find_orbit(model, n_impacts=2) if found.symmetric and found.stable)
    return special_points(vi.continue_orbit(orbit, "omega", (1.0, 2.1), step=0.1), "pitchfork")[0]


@pytest.mark.long
def test_boundaries_of_the_ball_are_the_closed_forms():
    plane = ("amplitude", "restitution"), ((0.01, 0.04), (0.4, 0.9))
    found = vi.boundary_curves(ball, *plane, n_periods=(1,), lines=2, step=0.1)
    assert {curve.kind for curve in found} == {"fold", "period_doubling"}
    for curve in found:
        for orbit, residual in zip(curve.orbits, curve.residuals, strict=True):
            fold, doubling = of_the_ball(orbit.value("restitution"), 1)
            gamma = orbit.value("amplitude") * ball().omega ** 2 / GRAVITY
            assert gamma == pytest.approx(fold if curve.kind == "fold" else doubling, rel=1e-12)
            assert residual < 1e-12


def test_one_mass_as_a_system_has_the_boundaries_of_the_oscillator():
    osc = vi.ImpactOscillator(omega=2.6)
    (point,) = special_points(
        vi.continue_orbit(vi.find_orbit(one_mass(osc))[0], "omega", (2.5, 2.7), step=0.1), "period_doubling"
    )
    curve = vi.continue_boundary(point, ("omega", "stop_1_restitution"), ((2.4, 2.9), (0.6, 0.95)), step=0.1)
    for orbit in curve.orbits:
        at = osc.replace(omega=orbit.value("omega"), restitution=orbit.value("stop_1_restitution"))
        known = min(vi.find_orbit(at), key=lambda other: orbit_distance(other, orbit))
        assert 1 + known.trace + known.determinant == pytest.approx(0, abs=1e-10)


@pytest.mark.long(but=1)
@pytest.mark.parametrize("kind", ["neimark_sacker", "grazing"])
def test_a_boundary_of_three_masses_keeps_its_condition(kind):
    branch = vi.continue_orbit(vi.find_orbit(chain())[0], "bar_gap", (0.1, 0.87), step=0.1)
    curve = vi.continue_boundary(
        special_points(branch, kind)[0], ("bar_gap", "bar_restitution"), ((0.1, 0.9), (0.5, 0.9)), step=0.1
    )
    assert curve.outcome == ("range", "range")
    assert max(curve.residuals) < 1e-10
    if kind == "neimark_sacker":
        for orbit in curve.orbits:
            assert min(abs(abs(value) - 1) for value in orbit.multipliers if value.imag) < 1e-9
    else:
        assert np.isfinite(curve.touch_phases).all()


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
    orbit = symmetric(two_sided())
    (point, *_) = special_points(vi.continue_orbit(orbit, "omega", (1.0, 2.1), step=0.1), "pitchfork")
    with pytest.raises(ValueError, match=f"and {breaking} would break the symmetry of the model; vary parameters that"):
        vi.continue_boundary(point, *plane)


def test_an_end_of_sticking_of_a_system_is_refused():
    with pytest.raises(ValueError, match="end_of_sticking"):
        vi.boundary_curves(ball, ("amplitude", "omega"), ((0.01, 0.02), (10, 20)), kinds=["end_of_sticking"])


def test_a_boundary_of_a_system_survives_files_and_is_drawn(tmp_path, pitchfork):
    curve = vi.continue_boundary(pitchfork, ("omega", "restitution"), ((0.9, 2.1), (0.55, 0.7)), step=0.2)
    vi.save(curve.dataset, tmp_path / "curve.nc")
    assert vi.load(tmp_path / "curve.nc").identical(curve.dataset)
    ax = vi.plotting.boundaries(curve)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["pitchfork of period-1 impact-2"]


def test_curves_of_one_type_on_different_stops_are_told_apart_by_their_labels(tmp_path):
    """The legend gives kind and type once; the label at a curve names the stop struck, then the stop grazed."""
    model = vi.models.two_sided_oscillator().replace(omega=230.0, left_gap=1.5e-3, right_gap=1.6e-3)
    right, left = vi.find_orbit(model, n_periods=2, n_impacts=1)[:2]
    branches = [vi.continue_orbit(orbit, "omega", (200.0, 231.0), step=0.2) for orbit in (left, right)]
    grazes = [point for branch in branches for point in special_points(branch, "grazing")[:1]]
    found = curves_through(grazes, ("omega", "right_gap"), ((200.0, 215.0), (1.5e-3, 1.7e-3)), step=0.2)
    assert [(curve.orbits[0].stops, curve.touched) for curve in found] == [(("left",), "right"), (("right",), "left")]
    ax = vi.plotting.boundaries(found)
    assert [text.get_text() for text in ax.texts] == ["p2 i1, left", "p2 i1, right"]
    vi.save(bundle([curve.dataset for curve in found], "boundary_curves", {}), tmp_path / "curves.nc")
    again = unbundle(vi.load(tmp_path / "curves.nc"))
    again[0].attrs["stops"] = "right"  # as if both struck the right stop, each grazing another
    texts = [text.get_text() for text in vi.plotting.boundaries(again).texts]
    assert texts == ["p2 i1, touching right", "p2 i1, touching left"]
    assert [text.get_text() for text in vi.plotting.boundaries(found[0]).texts] == ["p2 i1"]


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


@pytest.mark.long
def test_a_branch_along_which_a_contact_is_born_is_named_by_the_impacts_that_it_has():
    pair = two_sided(
        stops=[
            vi.Stop(direction=1, gap=0.2, stiffness=100.0, name="above"),
            vi.Stop(direction=-1, gap=1.4, stiffness=100.0, name="below"),
        ],
        force=vi.Force(omega=2.0, harmonics={1: 1.0}),
    )
    branch = vi.continue_orbit(vi.find_orbit(pair, stops="above")[0], "below_gap", (1.0, 1.5))
    assert {orbit.n_impacts for orbit in branch.orbits} == {1, 2}
    texts = [text.get_text() for text in vi.plotting.branch_diagram(branch).get_legend().get_texts()]
    assert texts[0] == "period-1 impact-1 to impact-2"
    assert "period-1 impact-1 to impact-2: " in sentences_of(branch.dataset)[0]


def test_the_motion_of_a_cell_is_followed_to_the_pitchfork_that_ends_it(pitchfork):
    """A coarse map's cycles are followed across its class boundaries."""
    model = symmetric_family.replace(omega=1.05)
    orbit = coverage._orbit_of(model, 1, 2)
    assert orbit.symmetric
    end, lasts = coverage._end_of_orbit(orbit, "omega", (1.05, 1.15))
    assert (end.kind, lasts) == ("pitchfork", False)
    assert end.value == pytest.approx(pitchfork.value, rel=1e-12)


def test_what_was_looked_for_is_said():
    found = Boundaries()
    curves._describe(found, None, [1], ["fold", "pitchfork"], kinds_of(ball), finished=True)
    assert found.message == (
        "fold and pitchfork only; searched for period-1 impact-1, and symmetric orbits with an impact in each half, on "
        "lines across the plane only; other motions end elsewhere"
    )
