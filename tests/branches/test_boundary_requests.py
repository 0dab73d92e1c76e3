"""Curves of bifurcations in planes of families and machines: results, labels, and what is refused."""

import numpy as np
import pytest

import vibroimpact as vi
from balls import ball
from branching import shaker
from contents import special_points
from systems import one_mass
from vibroimpact.continuation import BifurcationPoint, curves_through
from vibroimpact.dataset import bundle, unbundle

pytestmark = pytest.mark.usefixtures("modal_engine")

OSC = vi.ImpactOscillator()


MODELS = {"one mass": OSC.replace(omega=2.6), "one mass as a system": one_mass(OSC.replace(omega=2.6))}


@pytest.fixture(scope="module", params=MODELS)
def doubling(request):
    (orbit,) = vi.find_orbit(MODELS[request.param])
    (point,) = vi.continue_orbit(orbit, "omega", (2.5, 2.7), step=0.1).special
    return point


def named(point, ending):
    """Return the parameter of a point's model with such an ending."""
    return next(name for name in point.orbit.model.values if name.endswith(ending))


def test_the_dataset_of_a_boundary_is_labelled_and_survives_files(tmp_path, doubling):
    restitution = named(doubling, "restitution")
    curve = vi.continue_boundary(doubling, ("omega", restitution), ((2.4, 2.9), (0.6, 0.95)), step=0.1)
    data = curve.dataset
    assert data["omega"].attrs["units"] == "rad/s"
    assert data[restitution].dims == ("point",)
    assert float(data["residual"].max()) < 1e-10
    for path in (tmp_path / "curve.zarr", tmp_path / "curve.nc"):
        assert vi.load(vi.save(data, path)).identical(data)


def test_a_boundary_may_leave_the_motions_of_the_mass_and_says_so(doubling):
    plane, box = ("omega", named(doubling, "gap")), ((1.5, 4.0), (-1.0, 1.0))
    whole, real = (vi.continue_boundary(doubling, plane, box, step=0.08, virtual=virtual) for virtual in (True, False))
    assert len(real.orbits) < len(whole.orbits)
    assert "inadmissible" in real.outcome
    assert "inadmissible" in real.message
    assert not all(orbit.admissible for orbit in whole.orbits)


@pytest.mark.parametrize(
    ("names", "ranges", "words"),
    [
        (("omega",), ((1, 3),), "`parameters` must be two names"),
        (("omega", "omega"), ((1, 3), (1, 3)), "two different parameters"),
        (("omega", "frequency"), ((1, 3), (0.1, 3)), "two different parameters"),
        (("omega", "omegas"), ((1, 3), (0.1, 3)), "unknown parameter 'omegas'"),
        (("omega", "gap"), ((1, 2), (-1, 3)), "`range` must be .* contains"),
        (("omega", "gap"), ((1, 3),), "`ranges` must be two pairs"),
    ],
)
def test_a_wrong_plane_is_refused_by_name(doubling, names, ranges, words):
    names = [named(doubling, "gap") if name == "gap" else name for name in names]
    with pytest.raises(ValueError, match=words):
        vi.continue_boundary(doubling, names, ranges)


def test_a_point_that_is_no_boundary_is_refused(doubling):
    orbit, restitution = doubling.orbit, named(doubling, "restitution")
    away = vi.find_orbit(orbit.model.replace(omega=2.6))[0]
    plane = ("omega", restitution), ((2, 3), (0.5, 0.9))
    for kind in ("fold", "period_doubling", "grazing"):
        with pytest.raises(ValueError, match="`point` does not satisfy the condition"):
            vi.continue_boundary(BifurcationPoint(kind, "omega", 2.6, away), *plane)
    with pytest.raises(ValueError, match="`point` must be a BifurcationPoint, got 3"):
        vi.continue_boundary(3, *plane)


def test_an_end_of_sticking_of_a_system_is_refused():
    with pytest.raises(ValueError, match="end_of_sticking"):
        vi.boundary_curves(ball, ("amplitude", "omega"), ((0.01, 0.02), (10, 20)), kinds=["end_of_sticking"])


@pytest.mark.long
def test_an_end_of_sticking_is_a_boundary_like_the_others(tmp_path):
    ranges = (0.3, 0.5), (0.6, 0.85)  # a second tongue lies above
    (curve,) = vi.boundary_curves(
        OSC, ("omega", "restitution"), ranges, n_periods=[1], kinds=["end_of_sticking"], lines=2, step=0.04
    )
    assert max(curve.residuals) < 1e-10
    assert {orbit.name for orbit in curve.orbits if orbit.velocities} == {"period-1 sticking"}
    point = vi.end_of_sticking(OSC, "omega", (0.3, 0.4))
    alone = vi.continue_boundary(point, ("omega", "restitution"), ranges)
    # One and the same curve, sampled at other points.
    low, high = (np.array(sorted(map(tuple, c.values[:, ::-1]))) for c in (curve, alone))
    np.testing.assert_allclose(np.interp(high[:, 0], *low.T), high[:, 1], atol=2e-3)
    for path in (tmp_path / "curve.zarr", tmp_path / "curve.nc"):
        assert vi.load(vi.save(curve.dataset, path)).equals(curve.dataset)


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


@vi.family
def between_two_stops(omega=2.2, gap=0.5, left_gap=0.0):
    """A mass between two equal stops; the left one may be further away."""
    stops = [
        vi.Stop(direction=1, gap=gap, restitution=0.7, name="right"),
        vi.Stop(direction=-1, gap=gap + left_gap, restitution=0.7, name="left"),
    ]
    return vi.ImpactSystem(
        mass=1.0, damping=0.05, stiffness=1.0, force=vi.Force(omega=omega, harmonics={1: 1.0}), stops=stops
    )


def test_a_curve_of_grazes_of_symmetric_orbits_is_the_same_when_loaded(tmp_path):
    """A multiplier of half the cycle is infinite there, and so is its square, that of the cycle."""
    damper = vi.family(vi.models.impact_damper)
    orbit = next(each for each in vi.find_orbit(damper, stops="left", symmetric=True) if each.admissible)
    graze, *_ = special_points(vi.continue_orbit(orbit, "frequency", (22.0, 35.0), virtual=False), "grazing")
    curve = vi.continue_boundary(graze, ("frequency", "damping_ratio"), ((22.0, 35.0), (0.005, 0.015)), step=0.1)
    assert vi.load(vi.save(curve, tmp_path / "curve.nc")) == curve
    assert curve.orbits[0].multipliers[0] == complex(np.inf)


def test_orbits_that_strike_different_stops_have_curves_of_their_own():
    """They cross where the gaps are equal, at equal velocities; if both gaps vary alike, mirror images have one."""
    grazes = []
    for stop in ("right", "left"):
        orbit = next(each for each in vi.find_orbit(between_two_stops, stops=stop, n_periods=2) if each.admissible)
        branch = vi.continue_orbit(orbit, "omega", (0.4, 4.0), virtual=False)
        grazes.append(special_points(branch, "grazing")[0])
    for plane, number in (
        ((("omega", "left_gap"), ((0.4, 4.0), (-0.3, 0.4))), 2),
        ((("omega", "gap"), ((0.4, 4.0), (0.2, 0.9))), 1),
    ):
        each = [curves_through([graze], *plane) for graze in grazes]
        assert [len(curves) for curves in each] == [1, 1]
        together = curves_through(grazes, *plane)
        assert len(together) == number
        for (alone,), curve in zip(each, together, strict=False):
            np.testing.assert_array_equal(curve.values, alone.values)


SOUGHT = {
    "one mass": (
        OSC,
        ("omega", "restitution"),
        ((2.0, 2.1), (0.75, 0.85)),
        ["fold", "grazing"],
        "fold and grazing only; searched for period-1 impact-1 on lines across the plane only",
    ),
    "a ball on a table": (
        ball,
        ("amplitude", "restitution"),
        ((0.0205, 0.024), (0.48, 0.52)),
        ["fold", "pitchfork"],
        "fold and pitchfork only; searched for period-1 impact-1, and symmetric orbits with an impact in each half, on "
        "lines across the plane only",
    ),
}


@pytest.mark.parametrize("name", SOUGHT)
def test_what_was_looked_for_is_said(name):
    model, names, ranges, kinds, words = SOUGHT[name]
    found = vi.boundary_curves(model, names, ranges, n_periods=(1,), kinds=kinds, lines=2, step=0.2)
    assert found.message == f"{words}; other motions end elsewhere"


# Families


@vi.family
def identity(mass=1.0, damping=0.01, omega=2.6, restitution=0.8, gap=0.0):
    return vi.ImpactOscillator(mass=mass, damping=damping, omega=omega, restitution=restitution, gap=gap)


@vi.family
def identity_of_a_system(omega=2.6, stop_1_restitution=0.8):
    return one_mass(vi.ImpactOscillator(omega=omega, restitution=stop_1_restitution))


IDENTITIES = {
    "one mass": (OSC, identity, ("period_doubling", "end_of_sticking"), 0.05),
    "one mass as a system": (MODELS["one mass as a system"], identity_of_a_system, ("period_doubling",), 0.1),
}


@pytest.mark.parametrize("name", IDENTITIES)
def test_an_identity_family_has_the_models_own_curves(name):
    # Beyond restitution 1 the family refuses its values; the oscillator's equations go on. Both end at the edge.
    model, family, kinds, step = IDENTITIES[name]
    restitution = next(own for own in model.values if own.endswith("restitution"))
    plane = ("omega", restitution), ((2.2, 3.0), (0.6, 1.0))
    more = {"n_periods": (1,), "kinds": kinds, "lines": 2, "step": step}
    plain, tied = (vi.boundary_curves(each, *plane, **more) for each in (model, family))
    assert plain
    assert [(c.kind, c.outcome) for c in plain] == [(c.kind, c.outcome) for c in tied]
    for one, other in zip(plain, tied, strict=True):
        np.testing.assert_allclose(one.values, other.values, rtol=1e-12)
        assert [orbit.oscillator for orbit in other.orbits] == [orbit.model.at() for orbit in other.orbits]


def test_ends_of_sticking_are_followed_along_a_familys_parameters():
    ends = [vi.end_of_sticking(model, "omega", (0.3, 0.4)) for model in (vi.ImpactOscillator(), identity)]
    assert ends[0].value == ends[1].value
    plain, tied = (vi.continue_boundary(end, ("omega", "mass"), ((0.3, 0.4), (0.8, 1.2))) for end in ends)
    np.testing.assert_array_equal(plain.values, tied.values)


def test_boundaries_in_a_familys_own_units_hold_for_the_oscillators_that_it_makes():
    curves = vi.boundary_curves(
        shaker, ("rpm", "clearance_mm"), ((1200.0, 1800.0), (0.1, 0.9)), n_periods=(1,), lines=2, step=0.1
    )
    assert {curve.kind for curve in curves} >= {"period_doubling", "grazing"}
    for curve in curves:
        assert max(curve.residuals) < 1e-10
        for (rpm, clearance), orbit in zip(curve.values, curve.orbits, strict=True):
            assert orbit.oscillator == shaker.at(rpm=rpm, clearance_mm=clearance)
            if curve.kind == "period_doubling":
                orbits = vi.find_orbit(orbit.oscillator)
                assert min(abs(1 + o.trace + o.determinant) for o in orbits) < 1e-9
        assert curve.dataset["rpm"].attrs["units"] == "1/min"
        assert '"family": "shaker"' in curve.dataset.attrs["model"]
