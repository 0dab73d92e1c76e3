"""The boundaries of a whole plane: each of them is one, each once, and they reach most of what a coarse map shows."""

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

import vibroimpact as vi
from contents import special_points
from vibroimpact.continuation.lines import without_grazing_impacts
from vibroimpact.continuation.results import BifurcationPoint
from vibroimpact.continuation.sticking import Sticking
from vibroimpact.dataset import bundle
from vibroimpact.orbits.equations import parameters_of
from vibroimpact.orbits.one_mass import make_orbit, solution_of, solve
from vibroimpact.orbits.sticking import periods_from_release
from vibroimpact.orbits.sticking_end import scaling_exponent
from vibroimpact.report import sentences_of

OSC = vi.ImpactOscillator()
RANGES = {
    "omega": (0.7, 4.0), "gap": (-0.8, 1.2), "restitution": (0.3, 0.95), "mass": (0.2, 4.0), "amplitude": (0.2, 3.0),
    "damping": (0.002, 0.2), "stiffness": (0.3, 3.0),
}  # fmt: skip
NEAR = (3e-4, 1e-4, 3e-5, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)  # of the ranges: strips of stable orbits may be as narrow


def random_plane(seed):
    rng = np.random.default_rng(seed)
    names = tuple(map(str, rng.choice(list(RANGES), 2, replace=False)))
    numbers = {name: float(rng.uniform(*ends)) for name, ends in RANGES.items()}
    box = []
    for name in names:
        low, high = RANGES[name]
        width = (high - low) * rng.uniform(0.2, 0.8)
        first = float(rng.uniform(low, high - width))
        box.append((first, first + float(width)))
        numbers[name] = first
    return vi.ImpactOscillator(**numbers), names, tuple(box), rng


@pytest.fixture(scope="module", params=[3, 6])  # run with some dozens of seeds after a change
def plane(request):
    osc, names, box, rng = random_plane(request.param)
    return names, box, rng, vi.boundary_curves(osc, names, box, lines=2, step=0.04)


@pytest.mark.long
def test_at_random_points_of_each_curve_its_motion_attracts_on_one_side_and_not_on_the_other(plane):
    names, box, rng, curves = plane
    spans = np.array([high - low for low, high in box])
    for curve in curves:
        places = curve.values / spans
        for i in rng.integers(1, len(places) - 1, 2) if len(places) > 2 else ():
            along = places[i + 1] - places[i - 1]
            normal = np.array([-along[1], along[0]]) / np.hypot(*along)
            sides = []
            for distance in NEAR:
                models = [
                    curve.orbits[i].model.replace(**dict(zip(names, (places[i] + side * normal) * spans, strict=True)))
                    for side in (-distance, distance)
                ]
                sides.append([attracts(curve, curve.orbits[i], model.at(), distance) for model in models])
                if sides[-1][0] != sides[-1][1]:
                    break
            assert sorted(sides[-1]) == [False, True], (curve.kind, curve.orbits[i].name, curve.values[i], sides)


def attracts(curve, at, osc, distance):
    """Whether the motion that a curve bounds is stable at an oscillator beside it."""
    n, p = at.n_periods, at.n_impacts
    if curve.kind == "end_of_sticking":
        return periods_from_release(osc, n) == n
    if max(at.velocities) == 0.0:
        return osc.gap > osc.steady_amplitude
    orbits = vi.find_orbit(osc, n_periods=n) if p == 1 else beside(curve, at, osc, distance)
    far = max(0.2, 10.0 * math.sqrt(distance)) * (max(at.velocities) + osc.velocity_scale)
    near = [orbit for orbit in orbits if abs(max(orbit.velocities) - max(at.velocities)) < far]
    return any(orbit.stable and orbit.admissible for orbit in near)


def beside(curve, at, osc, distance):
    """Return the orbits beside one on a boundary; at a fold two of them leave it along the null vector."""
    cycle, z = solution_of(at)
    rows, columns = cycle.scales(at.oscillator, max(at.velocities))
    matrix = cycle.linearised(parameters_of(at.oscillator), z)[1] * columns / rows[:, None]
    null = np.linalg.svd(matrix)[2][-1] * columns
    sizes = [side * part * math.sqrt(distance) for part in (0.1, 0.3, 1.0, 3.0) for side in (-1, 1)]
    for size in sizes if curve.kind == "fold" else [0.0]:
        found = solve(osc, cycle, z + size * null)
        if found.converged and found.z[cycle.n_impacts :].min() > 0.0:
            yield make_orbit(osc, cycle, found.z)


@pytest.mark.long
def test_no_two_curves_are_the_same_and_no_point_is_listed_twice(plane):
    _, box, _, curves = plane
    spans = np.array([high - low for low, high in box])
    for at, curve in enumerate(curves):
        if curve.outcome != ("closed", "closed"):
            assert np.hypot(*np.diff(curve.values / spans, axis=0).T).min() > 0.0
        speeds = [max(orbit.velocities, default=0.0) for orbit in curve.orbits]
        for other in curves[:at]:
            if other.kind == curve.kind and other.orbits[0].name == curve.orbits[0].name:
                theirs = [max(orbit.velocities, default=0.0) for orbit in other.orbits]
                places = [np.column_stack([c.values / spans, v]) for c, v in ((curve, speeds), (other, theirs))]
                assert (cKDTree(places[1]).query(places[0])[0] < 1e-4).sum() < 3


def test_what_was_followed_and_reached_is_said(plane):
    _, _, _, curves = plane
    assert 0.0 < curves.share <= 1.0
    assert "48 x 48 cells, from rest" in curves.message
    assert f"{100 * curves.share:.0f} % of that map's" in curves.message
    assert "islands smaller than a cell are missed" in curves.message
    assert curves.motions["motion"].shape == (48, 48)
    joined = bundle([curve.dataset for curve in curves], "boundary_curves", {"message": curves.message})
    assert sentences_of(joined)[-1] == curves.message.split("; ")[-1]


def test_orbits_with_several_impacts_are_followed_where_a_map_shows_them():
    osc, names, box, _ = random_plane(6)
    kinds = ("fold", "period_doubling", "grazing")
    curves = vi.boundary_curves(osc, names, box, kinds=kinds, lines=2, step=0.1)
    known = vi.boundary_curves(osc, names, box, n_periods=(1, 2), kinds=kinds, lines=2, step=0.1)
    assert curves.share > 0.7
    assert {curve.orbits[0].n_impacts for curve in curves} > {curve.orbits[0].n_impacts for curve in known}
    assert math.isnan(known.share)
    assert "other motions end elsewhere" in known.message


@pytest.mark.long
def test_the_steady_motion_touches_the_stop_along_one_curve_alone():
    """With velocity 0 each period-n impact-1 orbit is the steady motion, which repeats after every period."""
    curves = vi.boundary_curves(
        OSC, ("omega", "gap"), ((1.2, 2.4), (0.1, 1.5)), n_periods=(1, 2), kinds=("grazing",), lines=2, step=0.05
    )
    touching = [curve for curve in curves if max(orbit.velocities[0] for orbit in curve.orbits) == 0.0]
    assert [curve.orbits[0].n_periods for curve in touching] == [1]
    (words,) = {line.split(":")[0] for line in sentences_of(bundle([touching[0].dataset], "boundary_curves", {}))[1:]}
    assert words == "  grazing of the motion without impacts, which first touches the stop"


def test_a_graze_at_velocity_zero_is_one_of_the_orbit_without_that_impact():
    stable = vi.find_orbit(OSC.replace(omega=0.9, gap=0.0), n_impacts=2)[0]
    branch = vi.continue_orbit(stable, "gap", (-0.5, 0.5), virtual=False)
    for point in special_points(branch, "grazing"):
        kept = [v for v in point.orbit.velocities if v > 0.0]
        without = without_grazing_impacts(point)
        assert isinstance(without, BifurcationPoint)
        assert sorted(without.orbit.velocities) == sorted(kept)
        assert without.orbit.admissible


def test_an_island_of_sticking_has_a_closed_curve(monkeypatch):
    def in_a_disc(plane, at):
        inside = 0.1 - math.dist(at, (0.1, 0.0))
        return inside ** scaling_exponent(OSC.restitution) if inside >= 0.0 else math.nan

    monkeypatch.setattr(Sticking, "stuck", in_a_disc)
    point = vi.end_of_sticking(OSC, "omega", (0.3, 0.4))
    curve = vi.continue_boundary(point, ("omega", "mass"), ((0.2, 0.6), (0.5, 1.5)))
    assert curve.outcome == ("closed", "closed")
    np.testing.assert_array_equal(curve.values[0], curve.values[-1])
    unit = (curve.values - (point.value, 1.0)) / (0.4, 1.0)
    assert np.hypot(*(unit - (0.1, 0.0)).T) == pytest.approx(0.1, rel=1e-12)


def test_curves_are_displayed_in_a_line_each():
    plane = ("omega", "restitution"), ((2.0, 3.0), (0.5, 0.9))
    curves = vi.boundary_curves(vi.ImpactOscillator(), *plane, n_periods=(1,), lines=2)
    head, *lines = repr(curves).splitlines()
    assert head == "1 curve"
    ranges = "omega [rad/s] 2.653 to 2.66, restitution 0.5 to 0.9"
    assert lines[0] == f"  period doubling of period-1 impact-1: {len(curves[0].orbits)} points, {ranges}"
    assert lines[1] == curves.message
    assert all(text in curves._repr_html_() for text in ("period doubling of period-1 impact-1", ranges))
    assert repr(type(curves)()) == "0 curves"
