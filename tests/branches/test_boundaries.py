"""Curves of bifurcations: identities, closed forms, and how the motion changes across them."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from balls import GRAVITY, ball, of_the_ball
from contents import special_points
from oracles.one_impact import response, trace, transition
from systems import chain, one_mass
from vibroimpact.orbits import orbit_distance

pytestmark = pytest.mark.usefixtures("modal_engine")

PLANES = {  # the second axis of the paper's maps; omega is the first
    "mass": (0.1, 5.0),
    "damping": (0.005, 1.0),
    "stiffness": (0.1, 5.0),
    "amplitude": (0.1, 5.0),
    "restitution": (0.1, 0.99),
}
OMEGA = (0.025, 5.0)
IMPACTING = ("fold", "period_doubling", "grazing")


@pytest.fixture(scope="module")
def curves():
    """Return the curves of a plane, computed once."""
    known = {}

    def of(name):
        if name not in known:
            box, lengths = ((OMEGA, PLANES[name]), (1, 2)) if name != "gap" else (((1.5, 4.0), (-1.0, 1.0)), (1,))
            known[name] = vi.boundary_curves(
                vi.ImpactOscillator(), ("omega", name), box, n_periods=lengths, kinds=IMPACTING, lines=2, step=0.04
            )
        return known[name]

    return of


def kinds_of(found):
    return {(curve.kind, curve.orbits[0].n_periods) for curve in found}


@pytest.mark.long(but=1)
@pytest.mark.parametrize("name", [*PLANES, "gap"])
def test_every_point_of_every_curve_satisfies_its_own_condition(curves, name):
    for curve in curves(name):
        assert max(curve.residuals) < 1e-10
        assert all(orbit.admissible for orbit in curve.orbits)


@pytest.mark.long(but=1)
@pytest.mark.parametrize("name", PLANES)
def test_each_plane_of_the_paper_has_its_doubling_and_grazing_curves_and_no_fold(curves, name):
    expected = {("period_doubling", 1), ("period_doubling", 2), ("grazing", 1), ("grazing", 2)}
    assert kinds_of(curves(name)) == expected


@pytest.mark.long(but=1)
@pytest.mark.parametrize("name", PLANES)
def test_doublings_obey_the_closed_form_of_the_trace(curves, name):
    """-2 r E cos(wd n T) + (1 + r)(q/v)(f sin(phase) - k g)/m = -1 - r^2 E^2, with E = exp(-c n T/2m)."""
    for curve in curves(name):
        if curve.kind != "period_doubling":
            continue
        for orbit in curve.orbits[::5]:
            o, time = orbit.oscillator, orbit.period
            fade, _, _ = transition(o, time)
            known = trace(o, time, orbit.phases[0], orbit.velocities[0])
            assert known == pytest.approx(-1 - (o.restitution * fade) ** 2, abs=1e-10)


def test_the_curves_pass_through_the_values_known_with_50_digits(values, as_model):
    known = [float(point["w"]) for point in values["period_doubling_w_of_n=1"]]
    for w in known:
        (orbit,) = vi.find_orbit(as_model(vi.ImpactOscillator(omega=w + 1e-3)))
        restitution = next(name for name in orbit.model.values if name.endswith("restitution"))
        point = min(
            vi.continue_orbit(orbit, "omega", (w - 0.01, w + 0.01), step=0.1).special, key=lambda p: abs(p.value - w)
        )
        curve = vi.continue_boundary(point, ("omega", restitution), ((0.5, 4.0), (0.8, 0.9)), step=0.05)
        at = int(np.argmin(np.abs(curve.values[:, 1] - 0.8) + np.abs(curve.values[:, 0] - w)))
        assert curve.values[at] == pytest.approx((w, 0.8), rel=1e-12)


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


def test_a_neimark_sacker_curve_ends_where_its_pair_meets_at_1_whatever_the_step():
    system = vi.ImpactSystem(
        mass=np.diag([1.0, 0.288]),
        damping=[[0.0351, -0.0227], [-0.0227, 0.0227]],
        stiffness=[[2.826, -1.826], [-1.826, 1.826]],
        force=vi.Force(omega=0.941, harmonics={1: [1.479, 0.0]}),
        stops=[vi.Stop(direction=[1.0, 0.0], gap=0.0317, restitution=0.74, name="a")],
    )
    orbit = vi.find_orbit(system, near=vi.State([0.0, 0.0]))[0]
    (point, *_) = special_points(vi.continue_orbit(orbit, "omega", (0.47, 1.42), step=0.02), "neimark_sacker")
    ends = []
    for step in (0.05, 0.01):
        plane = ("omega", "a_restitution"), ((0.47, 1.42), (0.44, 1.0))
        curve = vi.continue_boundary(point, *plane, virtual=False, step=step)
        (at,) = (index for index, end in zip((0, -1), curve.outcome, strict=True) if end == "resonance")
        assert sum(abs(value - 1.0) < 1e-3 for value in curve.orbits[at].multipliers) == 2
        ends.append(curve.values[at])
    assert ends[0] == pytest.approx(ends[1], rel=1e-6)


def test_without_a_gap_the_force_only_scales_the_motion_so_no_curve_bends(curves):
    for curve in curves("amplitude"):
        assert np.ptp(curve.values[:, 0]) < 1e-11
        scaled = [orbit.velocities[0] / orbit.oscillator.amplitude for orbit in curve.orbits]
        assert np.array(scaled) == pytest.approx(scaled[0], rel=1e-10)


@pytest.mark.parametrize(
    ("name", "pace"), [("mass", lambda o: math.sqrt(o.mass)), ("stiffness", lambda o: 1 / math.sqrt(o.stiffness))]
)
def test_curves_over_mass_and_stiffness_are_curves_over_damping_in_another_unit_of_time(curves, name, pace):
    """(m/s^2, c/s, k, f, s w) moves alike in time t/s, and (m, c, k) by a common factor moves alike at all."""
    for curve in curves(name):
        for orbit in curve.orbits[::10]:
            o = orbit.oscillator
            s = pace(o)
            twin = vi.ImpactOscillator(omega=s * o.omega, damping=o.damping / math.sqrt(o.mass * o.stiffness))
            (same,) = vi.find_orbit(twin, n_periods=orbit.n_periods)
            assert same.phases[0] == pytest.approx(orbit.phases[0], abs=1e-10)
            assert same.trace == pytest.approx(orbit.trace, abs=1e-9)


def test_folds_with_a_gap_obey_their_closed_form(curves):
    """g^2 = R^2 (1 + (alpha w/beta)^2): the discriminant of the quadratic for the velocity of one impact vanishes."""
    folds = [curve for curve in curves("gap") if curve.kind == "fold"]
    assert len(folds) == 2
    for curve in folds:
        for orbit in curve.orbits[::3]:
            o = orbit.oscillator
            alpha, beta = response(o, orbit.period)
            expected = o.steady_amplitude * math.sqrt(1 + (alpha * o.omega / beta) ** 2)
            assert abs(o.gap) == pytest.approx(expected, rel=1e-9)


def test_one_impact_grazes_with_velocity_zero_exactly_where_the_free_motion_touches_the_stop(curves):
    touching = [
        curve
        for curve in curves("gap")
        if curve.kind == "grazing" and max(o.velocities[0] for o in curve.orbits) < 1e-9
    ]
    assert touching
    for curve in touching:
        for orbit in curve.orbits:
            assert orbit.oscillator.gap == pytest.approx(orbit.oscillator.steady_amplitude, rel=1e-11)


def test_on_a_grazing_curve_the_engine_sees_the_mass_touch_the_stop(curves):
    """Just before and after the touch the gap is as small as the bend allows, and no impact is in between."""
    for curve in curves("restitution"):
        if curve.kind != "grazing":
            continue
        orbit = curve.orbits[len(curve.orbits) // 2]
        o, touch = orbit.oscillator, curve.touch_phases[len(curve.orbits) // 2]
        turns, n = (touch - orbit.phases[0]) % 1, orbit.n_periods
        flight = vi.simulate(o, start=orbit.start, periods=n - 1 + 1.02 * turns, samples_per_period=20000)
        passed = (flight["time"].values - orbit.start.time) / o.period
        # The phase does not say in which of the cycle's periods the touch is.
        around = [flight["displacement"].values[np.abs(passed - turns - k) < 2e-3] for k in range(n)]
        near = min(around, key=lambda displacement: np.abs(displacement).max())
        assert np.abs(near).max() < 1e-4
        assert near.max() > -1e-8


@pytest.mark.parametrize("name", [*PLANES, "gap"])
def test_the_motion_changes_across_every_curve(curves, name):
    """Sampled in the middle of each curve, as near to it as the strip is narrow in which the orbit attracts.

    On one side the engine stays on the period-n impact-1 orbit, on the other it goes elsewhere. Curves beside which
    no orbit attracts, where a graze follows a period doubling, are no boundary of an attractor.
    """
    kinds = set()
    for curve in curves(name):
        for share in (0.3, 0.6):
            sides = sampled_sides(curve, ("omega", name), share)
            if sides is None:
                continue
            stays, leaves = sides
            own = f"period-{curve.orbits[0].n_periods} impact-1"
            assert stays == own
            assert leaves != own
            kinds.add((curve.kind, curve.orbits[0].n_periods))
    assert {("period_doubling", 1)} <= kinds
    assert name == "gap" or ("period_doubling", 2) in kinds
    assert name not in ("damping", "restitution") or ("grazing", 1) in kinds
    assert name != "gap" or ("fold", 1) in kinds


def sampled_sides(curve, names, share):
    """Return what the engine calls the motion on the side where the orbit attracts, and on the other."""
    spans = np.ptp(curve.values, axis=0)
    spans[spans < 1e-6] = 1.0
    places = curve.values / spans
    i = int(share * len(places))
    if not 0 < i < len(places) - 1:
        return None
    along = places[i + 1] - places[i - 1]
    normal = np.array([-along[1], along[0]]) / np.hypot(*along)
    at = curve.orbits[i]
    for distance in (1e-2, 3e-3, 1e-3, 3e-4):
        found = []
        for side in (-distance, distance):
            values = (places[i] + side * normal) * spans
            osc = at.oscillator.replace(**dict(zip(names, values, strict=True)))
            orbits = vi.find_orbit(osc, n_periods=at.n_periods)
            near = min(
                orbits, key=lambda orbit: (not orbit.stable, abs(orbit.velocities[0] - at.velocities[0])), default=None
            )
            found.append((near is not None and near.stable and near.admissible, osc, near or at))
        if found[0][0] != found[1][0]:
            (_, *good), (_, *bad) = sorted(found, key=lambda side: not side[0])
            return motion(*good), motion(*bad)
    return None


def motion(osc, orbit):
    start = vi.State(osc.gap, orbit.velocities[0] * (1 + 1e-4), orbit.phases[0] * osc.period)
    return vi.recognise(vi.impact_section(osc, start=start, transient_impacts=6000, sample_impacts=300)).name
