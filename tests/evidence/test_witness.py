"""The engine against the independent witness: impacts, samples and indices of random oscillators and systems."""

import math
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st
from scipy.linalg import expm

import vibroimpact as vi
from cells import make_cells
from designs import random_oscillator
from systems import a_random_machine, free_masses, sticking, system
from vibroimpact.backends import ImpactWindow, Measurement, StroboscopicWindow, get_backend
from vibroimpact.indices import FORCES, INDICES
from vibroimpact.model.elements import Contact

EXAMPLES, SHARES, IMPACTS = 2000, 8, 20
BASE = 1e-13  # of the velocity scale, and of the fastest time scale, before any growth
WEAK = 1e-6  # of the velocity scale: below it two correct codes may count differently


def logarithmic(low, high):
    return st.floats(math.log10(low), math.log10(high)).map(lambda exponent: 10.0**exponent)


def plain(low, high):
    # Eight decimals: zero and one are drawn, numbers such as 1e-308 and a speed of 1e-9 V, on the cut itself, are not.
    return st.floats(low, high).map(lambda number: round(number, 8))


@st.composite
def motions(draw):
    """Draw an oscillator, over- and underdamped, gaps of both signs, restitution 0 to 1, and a start in front of it."""
    mass, stiffness, amplitude = (
        draw(logarithmic(0.01, 100)),
        draw(logarithmic(0.01, 100)),
        draw(logarithmic(0.01, 100)),
    )
    critical = 2 * math.sqrt(mass * stiffness)
    reach = amplitude / stiffness
    osc = vi.ImpactOscillator(
        mass=mass,
        stiffness=stiffness,
        amplitude=amplitude,
        damping=critical * draw(logarithmic(1e-4, 5.0)),
        omega=math.sqrt(stiffness / mass) * draw(logarithmic(0.05, 20)),
        restitution=draw(plain(0.0, 1.0)),
        gap=reach * draw(plain(-1.5, 1.5)),
    )
    back = reach * draw(plain(0.0, 3.0))
    start = vi.State(osc.gap - back, osc.velocity_scale * draw(plain(-2.0, 2.0)), osc.period * draw(plain(0.0, 3.0)))
    return osc, start


def turns(hits):
    return hits.impact_periods + hits.impact_phase


def fastest_rate(osc):
    half = osc.damping / (2 * osc.mass)
    over = max(half**2 - osc.natural_frequency**2, 0.0)
    return max(osc.omega, osc.natural_frequency, half + math.sqrt(over) if over else 0.0)


def error_growth(osc, start, hits):
    """Return by how much an error of one rounding may have grown at each impact.

    The impact map's Jacobian from (t0, v0) to (t1, v1) is [[-1/v1, 0], [-a1/v1, 1]] Phi(tau) [[r v0, 0], [-a0, -r]];
    time is measured in 1/L and speed in V, and each flight adds a rounding per 1/L, seen through its last contact.
    """
    rate, scale = fastest_rate(osc), osc.velocity_scale
    flow = np.array([[0.0, 1.0], [-osc.stiffness / osc.mass, -osc.damping / osc.mass]])
    units = np.diag([rate, 1 / scale])
    times, speeds = turns(hits) * osc.period, hits.impact_velocity

    def acceleration(time, velocity):
        force = osc.amplitude * math.sin(osc.omega * time) - osc.stiffness * osc.gap - osc.damping * velocity
        return force / osc.mass

    error = 1.0
    growth = []
    for at, (time, speed) in enumerate(zip(times, speeds, strict=True)):
        if at:
            r, before = osc.restitution, speeds[at - 1]
            a0, a1 = acceleration(times[at - 1], -r * before), acceleration(time, speed)
            landing = np.array([[-1 / speed, 0.0], [-a1 / speed, 1.0]])
            leaving = np.array([[r * before, 0.0], [-a0, -r]])
            jacobian = landing @ expm(flow * (time - times[at - 1])) @ leaving
            error *= np.linalg.norm(units @ jacobian @ np.linalg.inv(units), 2)
        flight = time - times[at - 1] if at else time - start.time
        error += (1.0 + rate * flight) * (
            1.0 + scale / speed * max(1.0, abs(acceleration(time, speed)) / (rate * scale))
        )
        growth.append(error)
    return np.array(growth)


def compare(osc, start):
    cells, window, limits = make_cells(osc, start), ImpactWindow(0, IMPACTS), vi.Tolerances(flight_periods=100)
    (ours,), (theirs,) = (
        get_backend(name).samples(cells, Measurement(window, limits)) for name in ("cpu", "reference")
    )
    weak = [np.flatnonzero(code.impact_velocity < WEAK * osc.velocity_scale) for code in (ours, theirs)]
    weak = np.sort(np.concatenate(weak))
    sure = weak[0] if weak.size else len(theirs.impact_velocity)
    allowed = BASE * error_growth(osc, start, theirs)[:sure]
    known = allowed < 1e-3
    if not weak.size and known.all():
        assert len(ours.impact_velocity) == len(theirs.impact_velocity)
        # Where the steady motion just touches the stop, rounding decides whether that is known to be out of reach.
        assert ours.status == theirs.status or math.isclose(osc.steady_amplitude, osc.gap, rel_tol=1e-12)
    sure = int(np.append(known, False).argmin())  # growth may later be small again, but not what has grown
    allowed = allowed[:sure]
    assert min(len(ours.impact_velocity), len(theirs.impact_velocity)) >= sure
    late = np.abs(
        (ours.impact_periods[:sure] - theirs.impact_periods[:sure])
        + (ours.impact_phase[:sure] - theirs.impact_phase[:sure])
    )
    late *= osc.period * fastest_rate(osc)
    fast = np.abs(ours.impact_velocity[:sure] - theirs.impact_velocity[:sure]) / osc.velocity_scale
    assert (late <= allowed).all()
    assert (fast <= allowed).all()


@pytest.mark.long(but=1)
@pytest.mark.parametrize("share", range(SHARES))
def test_the_first_20_impacts_of_random_oscillators_are_the_witness_s(share):
    @seed(share)
    @settings(max_examples=EXAMPLES // SHARES, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(motions())
    def agree(motion):
        compare(*motion)

    agree()


@pytest.mark.parametrize(("backend", "examples"), [("cpu", 300), ("reference", 25)])
def test_the_mass_is_never_beyond_the_stop_by_more_than_rounding(backend, examples):
    @seed(99)
    @settings(max_examples=examples, deadline=None, database=None)
    @given(motions())
    def stays_in_front(motion):
        osc, start = motion
        orbit = vi.simulate(osc, start=start, periods=5, samples_per_period=37, backend=backend)
        reach = float(np.abs(orbit["displacement"]).max())
        assert float(orbit["displacement"].max()) <= osc.gap + 4e-16 * max(reach, abs(osc.gap))

    stays_in_front()


# As a back end


def machine(seed):
    """Return a chain of masses between rigid or compliant stops, some of which move."""
    return a_random_machine(np.random.default_rng([5, seed]))


def one_mass(seed):
    """Return a random oscillator."""
    return random_oscillator(np.random.default_rng([5, seed]))


def both(method, model, measurement):
    """Return what the engine and the witness say of a model's motion from rest."""
    cells = model.cells({})
    return [getattr(get_backend(name), method)(cells, measurement) for name in ("cpu", "reference")]


@pytest.mark.parametrize("window", [ImpactWindow(2, 8), StroboscopicWindow(1, 8, 0.25, 2)], ids=["impacts", "times"])
@pytest.mark.parametrize(
    ("make", "seed"),
    [
        *((machine, seed) for seed in range(10)),
        *((free_masses, seed) for seed in range(6)),
        *((one_mass, seed) for seed in range(6)),
    ],
)
def test_both_codes_sample_random_models_alike(make, seed, window):
    (ours,), (theirs,) = both("samples", make(seed), Measurement(window))
    assert vi.Status(ours.status) == vi.Status(theirs.status)
    names = [each.name for each in fields(ours) if each.name.startswith(("impact", "look", "rest"))]
    for name in (*names, *Contact._fields):
        parts = [getattr(code if name in names else code.contacts, name) for code in (ours, theirs)]
        mine, its = (np.asarray(part, float) for part in parts)
        assert mine.shape == its.shape or name not in names, name  # of a contact one number may stand for all
        size = np.abs(mine[np.isfinite(mine)]).max(initial=1e-3)
        np.testing.assert_allclose(mine, its, rtol=0.0, atol=1e-9 * size, err_msg=name)


@pytest.mark.parametrize("by_stop", [False, True])
@pytest.mark.parametrize(
    ("make", "seed"), [*((machine, seed) for seed in (0, 3, 9, 11, 15, 20)), *((one_mass, seed) for seed in range(6))]
)
def test_both_codes_sum_up_impacts_and_forces_of_chaos_alike(make, seed, by_stop):
    """Over few impacts, before chaos parts two codes; exponents and times at rest need longer windows."""
    names = {*INDICES, *FORCES} - {"lyapunov", "lyapunov_per_impact", "stick_fraction"}
    ours, theirs = both("indices", make(seed), Measurement(ImpactWindow(3, 10), indices=(*names,), by_stop=by_stop))
    for name in (*names, "status"):
        near = 1e-6 if make is one_mass and name == "grazing_margin" else 1e-9  # of a leap of one mass it is estimated
        np.testing.assert_allclose(ours[name], theirs[name], rtol=1e-7, atol=near, err_msg=name)


@pytest.mark.parametrize(
    ("make", "seed"),
    [
        *((machine, seed) for seed in (1, 10, 17, 30, 33)),
        pytest.param(machine, 34, marks=pytest.mark.long),
        *((one_mass, seed) for seed in (19, 22, 27)),
    ],
)
def test_both_codes_name_cycles_alike_and_find_the_same_exponents_and_forces(make, seed):
    """The engine takes an exponent from one cycle where it closes early, so not with forces; then sums are over 56."""
    model, names = make(seed), {"n_periods", "n_impacts", "lyapunov", "lyapunov_per_impact", "grazing_margin"}
    closing = get_backend("cpu").indices(model.cells({}), Measurement(ImpactWindow(500, 2000), indices=(*INDICES,)))
    assert closing["status"] == vi.Status.CLOSED
    assert closing["n_periods"] > 0
    assert 56 % closing["n_impacts"] == 0
    for by_stop in (False, True):
        every = Measurement(ImpactWindow(150, 57), indices=(*INDICES, *FORCES), by_stop=by_stop, early_closing=False)
        ours, theirs = both("indices", model, every)
        for name in names - ({"grazing_margin"} if by_stop else set()):
            np.testing.assert_allclose(theirs[name], closing[name], rtol=1e-7, err_msg=name)
        for name in {*INDICES, *FORCES} - (names - {"grazing_margin"}):
            np.testing.assert_allclose(theirs[name], ours[name], rtol=1e-6, atol=1e-7, err_msg=name)


@pytest.mark.parametrize(("make", "seed"), [(sticking, None), (machine, 6), (machine, 29)])
def test_both_codes_tell_of_a_cycle_with_rests_how_long_those_are_and_what_is_left_of_a_deviation(make, seed):
    model = make() if seed is None else make(seed)
    cells, measured = model.cells({}), {"indices": (*INDICES, "mean_force")}
    ours = get_backend("cpu").indices(cells, Measurement(ImpactWindow(300, 5000), **measured))
    theirs = get_backend("reference").indices(cells, Measurement(ImpactWindow(100, 400), **measured))
    for name in ("status", "n_periods", "n_impacts", "stick_fraction", "lyapunov", "grazing_margin"):
        np.testing.assert_allclose(theirs[name], ours[name], rtol=1e-4, atol=1e-7, err_msg=name)
    assert theirs["stick_fraction"] > 0.0
    np.testing.assert_allclose(theirs["mean_force"], ours["mean_force"], rtol=2e-3)


@pytest.mark.parametrize("seed", [14, 34])
def test_the_exponent_of_a_cycle_is_that_of_the_multipliers_of_its_orbit(seed):
    """On two compliant stops, and on two rigid ones."""
    model, how = machine(seed), {"backend": "reference", "transient_impacts": 250, "sample_impacts": 60}
    found = vi.parameter_map(model, omega=[model.omega], indices=["lyapunov", "n_periods", "n_impacts"], **how)
    hits = vi.impact_section(model, **how)
    p, n = int(found["n_impacts"][0]), int(found["n_periods"][0])
    assert p == 2
    times, stops = hits["time"].values[-p:], hits["stop"].values[-p:].tolist()
    (orbit,) = vi.find_orbit(model, stops=stops, n_periods=n, near=times)
    largest = np.abs(orbit.multipliers).max()
    assert float(found["lyapunov"][0]) == pytest.approx(np.log(largest) / (n * model.period), rel=1e-7)


def test_a_law_of_restitution_is_that_of_the_cell():
    """Two laws of one kind differ by a number alone."""
    for law in (vi.contact.hunt_crossley(damping=0.2), vi.contact.hunt_crossley(damping=0.5), lambda v: 0.5 / (1 + v)):
        stop = vi.Stop(direction=1, gap=0.1, restitution=law)
        model = system(1.0, 0.05, 1.0, 1.3, [stop], {1: 1.0})
        (ours,), (theirs,) = both("samples", model, Measurement(ImpactWindow(0, 12)))
        np.testing.assert_allclose(theirs.impact_velocity, ours.impact_velocity, rtol=1e-9)
