"""Response curves: how far motions swing, with and without contact, against closed forms and published numbers."""

from __future__ import annotations

import cmath
import math
from functools import partial

import numpy as np
import pytest
from scipy.interpolate import barycentric_interpolate
from scipy.linalg import eigh

import vibroimpact as vi
from compliant import bilinear
from systems import cantilever
from vibroimpact.orbits.systems.response import extremes, steady_motion

FIELDS = ("amplitude", "rms", "mean", "harmonic_amplitude", "harmonic_phase")


def a_mass(seed):
    """Return a random mass in front of a rigid stop on one side or both, whose impacts repeat, and its orbit."""
    rng = np.random.default_rng([43, seed])
    while True:
        stops = [vi.Stop(direction=1.0, gap=rng.uniform(-0.3, 1.0), restitution=rng.uniform(0.3, 0.9), name="above")]
        force = vi.Force(omega=rng.uniform(0.6, 3.0), harmonics={1: 1.0, 3: rng.uniform(0.0, 0.3)})
        system = vi.ImpactSystem(mass=rng.uniform(0.5, 2.0), damping=0.2, stiffness=1.0, force=force, stops=stops)
        orbits = [orbit for orbit in vi.find_orbit(system) if orbit.stable]
        if orbits:
            return system, orbits[0]


@pytest.mark.parametrize("seed", range(12))
def test_impulses_give_the_mean_and_the_first_harmonic_of_one_mass(seed):
    """The equation of motion, averaged over a period alone and with e^{-iwt}, holds the impulses as its only load."""
    system, orbit = a_mass(seed)
    mass, damping, stiffness = (float(part[0, 0]) for part in (system.mass, system.damping, system.stiffness))
    response = vi.response_of(orbit)
    impulses, angles = np.array(orbit.impulses), 2.0 * math.pi * np.array(orbit.turns)
    assert stiffness * response.mean == pytest.approx(-impulses.sum() / system.period, rel=1e-9)
    impedance = stiffness - mass * system.omega**2 + 1j * damping * system.omega
    load = complex(system.force.harmonics[1][0]) - 2j / system.period * (impulses * np.exp(-1j * angles)).sum()
    phasor = cmath.rect(response.harmonic_amplitude, response.harmonic_phase)
    assert phasor * impedance == pytest.approx(load, rel=1e-9)


@pytest.mark.parametrize(
    "model",
    [
        vi.ImpactOscillator(damping=0.1, omega=2.5),
        vi.models.bilinear_oscillator(),
        vi.models.two_sided_oscillator(frequency=15.0),
        vi.models.impact_damper(),
    ],
    ids=["oscillator", "compliant", "two sides", "damper"],
)
def test_the_response_of_an_orbit_is_that_of_its_simulated_motion(model):
    found = [*vi.find_orbit(model), *([] if model.at().forgets else vi.find_orbit(model, symmetric=True))]
    orbit = next(orbit for orbit in found if orbit.stable)
    design = model.at()
    if design.forgets:
        start = vi.State(design.gap, -design.restitution * orbit.velocities[0], orbit.phases[0] * design.period)
    else:
        start = orbit.start
    motion = vi.simulate(design, start=start, periods=1, samples_per_period=40_000)
    time, y = motion["time"].values, motion["displacement"].values.reshape(len(motion["time"]), -1)[:, -1]

    def mean(values):
        return np.trapezoid(values, time) / (time[-1] - time[0])

    phasor = 2j * mean(y * np.exp(-1j * design.omega * time))
    sampled = 0.5 * np.ptp(y), math.sqrt(mean(y**2)), mean(y), abs(phasor), np.angle(phasor)
    response = vi.response_of(orbit, of=None if design.forgets else design.coordinates - 1)
    assert np.allclose(response, sampled, rtol=2e-6, atol=2e-6 * response.amplitude)


@pytest.mark.parametrize("orders", [(1,), (1, 2), (1, 3, 4), (2, 5)])
def test_extremes_of_harmonics_are_those_of_a_fine_grid(orders):
    rng = np.random.default_rng(orders)
    phasors = rng.normal(size=len(orders)) + 1j * rng.normal(size=len(orders))
    x = np.linspace(0.0, 2.0 * math.pi, 400_001)
    values = 0.3 + (phasors @ np.exp(1j * np.multiply.outer(orders, x))).imag
    assert extremes(0.3, phasors, np.array(orders)) == pytest.approx((values.min(), values.max()), abs=1e-9)


soft = partial(bilinear, stiffness=0.5, damping=0.0, gap=1.0, omega=1.0, push=0.1)


def test_without_contact_the_curve_is_that_of_the_linear_oscillator():
    curve = vi.response_curve(soft(gap=10.0), omega=(0.5, 1.5), step=0.1).dataset
    omega = curve["omega"].values
    phasor = 0.1 / (1.0 - omega**2 + 0.05j * omega)
    assert np.allclose(curve["amplitude"], abs(phasor), rtol=1e-13)
    assert np.allclose(curve["rms"], abs(phasor) / math.sqrt(2.0), rtol=1e-13)
    assert np.allclose(curve["harmonic_phase"], np.angle(phasor), rtol=1e-12)
    assert np.isclose(curve["amplitude"].max(), 0.1 / 0.05, rtol=1e-3)  # values lie close around the resonance


def test_the_part_with_contact_begins_and_ends_where_the_linear_motion_touches():
    curve = vi.response_curve(soft(), omega=(0.8, 1.4), step=0.02)
    touches = np.sort([root for root in np.roots([1.0, 0.0, 0.05**2 - 2.0, 0.0, 1.0 - 0.1**2]).real if root > 0.0])
    assert [part[at] for part, at in zip(curve.steady, (-1, 0), strict=True)] == pytest.approx(touches, rel=1e-12)
    (branch,) = curve.branches
    assert np.sort(branch.values[[0, -1]]) == pytest.approx(touches, rel=1e-9)
    data = curve.dataset
    ends = [
        (float(data["omega"][i]), float(data["amplitude"][i]))
        for part in range(3)
        for i in np.flatnonzero(data["part"].values == part)[[0, -1]]
    ]
    for touch in touches:  # the curve is joined there
        heights = [height for omega, height in ends if math.isclose(omega, touch, rel_tol=1e-9)]
        assert len(heights) == 2
        assert heights[0] == pytest.approx(heights[1], rel=1e-6)
    kinds = [(point.kind, round(point.value, 6)) for point in curve.special]
    assert kinds == [("grazing", 0.955059), ("fold", 1.046094), ("fold", 1.040426), ("grazing", 1.041807)]


def test_a_branch_is_followed_beyond_a_graze_and_not_back_the_way_it_came():
    """The damped stop loses its second contact at 2.2008 Hz; a branch that came from below went back from there."""
    machine = vi.family(vi.models.bilinear_oscillator)
    special = []
    for frequency in (2.02, 2.3):
        orbit = next(orbit for orbit in vi.find_orbit(machine.replace(frequency=frequency)) if orbit.admissible)
        branch = vi.continue_orbit(orbit, "frequency", (2.0, 2.4), step=0.02)
        assert (branch.outcome, branch.values[0], branch.values[-1]) == (("range", "range"), 2.0, 2.4)
        special.append([(point.kind, round(point.value, 9)) for point in branch.special])
    assert special[0] == special[1]
    assert len(set(special[0])) == len(special[0]) == 6


def test_the_phase_resonance_of_the_beam_with_a_spring_is_that_of_harmonic_balance():
    """Cantilever of seven elements, spring behind 1 mm at .3 m, .8 % in its modes with the spring, 20 N at the tip."""
    length, section = 0.1, 0.03
    rigidity, per_length = 185e9 * section**4 / 12.0, 7830.0 * section**2
    mass, stiffness = cantilever(7, length)
    mass, stiffness = per_length * mass, rigidity * stiffness
    hertz = np.sqrt(eigh(stiffness, mass, eigvals_only=True)) / (2.0 * math.pi)
    assert hertz[:5].round(1).tolist() == [48.1, 301.3, 844.4, 1659.2, 2758.0]
    spring, tip = np.eye(14)[4], np.eye(14)[12]
    squares, modes = eigh(stiffness + 1.3e6 * np.outer(spring, spring), mass)
    damping = mass @ modes @ np.diag(2.0 * 0.008 * np.sqrt(squares)) @ modes.T @ mass
    stops = [vi.Stop(direction=spring, gap=1e-3, stiffness=1.3e6, name="spring")]
    force = vi.Force(omega=305.0, harmonics={1: 20.0 * tip})
    beam = vi.ImpactSystem(mass=mass, damping=damping, stiffness=stiffness, force=force, stops=stops)

    curve = vi.response_curve(beam, omega=(305.0, 321.0), of=12, step=0.05)
    contact = curve.dataset.isel(point=curve.dataset["impacts"] > 0)
    lag = contact["harmonic_phase"].values + 0.5 * math.pi
    around = np.argsort(abs(lag))[:6]  # the branch is smooth over the phase, also where it folds
    omega, rms = (float(barycentric_interpolate(lag[around], contact[name].values[around], 0.0))
                  for name in ("omega", "rms"))  # fmt: skip
    assert (omega, rms) == (pytest.approx(317.8723110, abs=2e-7), pytest.approx(5.32237458e-3, abs=2e-11))
    # Published are 317.869 rad/s and 5.321e-3 m, of 40 harmonics. With 200 samples of the spring's force in a period
    # such a balance gives 317.8691 and 5.3217e-3, with 1024 samples 317.8724 and 5.32238e-3.
    assert (omega, rms) == (pytest.approx(317.869, rel=1.1e-5), pytest.approx(5.321e-3, rel=3e-4))

    (branch,) = curve.branches
    orbit = branch.orbits[around[0]]
    samples = 1 << 14
    places = orbit.motion(orbit.period / samples * np.arange(samples))[0]
    force = np.fft.fft(-1.3e6 * np.maximum(places[:, 4] - 1e-3, 0.0)) / samples
    balanced = []  # the linear beam under 40 harmonics of the spring's force, and of the load
    for order in range(41):
        rate = order * orbit.model.omega
        load = force[order] * spring - (0.5j * 20.0 * tip if order == 1 else 0.0)
        balanced.append(np.linalg.solve(stiffness - rate**2 * mass + 1j * rate * damping, load)[12])
    response = vi.response_of(orbit, of=12)
    assert balanced[0].real == pytest.approx(response.mean, rel=1e-6)
    assert 2j * balanced[1] == pytest.approx(cmath.rect(response.harmonic_amplitude, response.harmonic_phase), rel=1e-6)
    assert math.sqrt(abs(balanced[0]) ** 2 + 2.0 * (np.abs(balanced[1:]) ** 2).sum()) == pytest.approx(
        response.rms, rel=1e-6
    )


def test_one_mass_has_the_same_curve_as_an_oscillator_and_as_a_system():
    oscillator = vi.ImpactOscillator(damping=0.1, gap=1.5)
    one, other = (vi.response_curve(model, omega=(0.3, 3.0), step=0.05) for model in (oscillator, oscillator.system))
    assert [part[[0, -1]].tolist() for part in one.steady] == [part[[0, -1]].tolist() for part in other.steady]
    assert [(p.kind, round(p.value, 9)) for p in one.special] == [(p.kind, round(p.value, 9)) for p in other.special]
    largest = [float(curve.dataset["amplitude"].max()) for curve in (one, other)]
    assert largest[0] == pytest.approx(largest[1], rel=1e-3)


def test_a_gap_may_be_varied_through_zero_and_below():
    curve = vi.response_curve(vi.ImpactOscillator(damping=0.1, omega=1.5), gap=(-1.0, 0.0), step=0.1)
    assert curve.steady == []
    assert curve.dataset["gap"].values.max() == 0.0
    assert [(point.kind, round(point.value, 9)) for point in curve.special] == [("grazing", -0.257699957)]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: vi.response_curve(soft()), "exactly one parameter with its range"),
        (lambda: vi.response_curve(soft(), omega=(2.0, 1.0)), "a lower number before a higher one"),
        (lambda: vi.response_curve(vi.ImpactSystem(mass=1, stiffness=1), omega=(0.5, 1.0)), "no periodic load"),
        (lambda: vi.response_curve(vi.ImpactOscillator(gap=-50.0), omega=(0.05, 0.06), step=0.2), "no periodic motion"),
        (lambda: vi.response_curve(soft(), of="tip", omega=(0.5, 1.0)), "unknown point or stop 'tip'"),
        (lambda: vi.response_curve(soft(), of=3, omega=(0.5, 1.0)), "`of`"),
        (lambda: vi.response_curve(vi.models.impact_damper(), omega=(5.0, 6.0)), "`of` must say what is observed"),
    ],
)
def test_what_cannot_be_followed_is_refused(call, words):
    with pytest.raises(ValueError, match="|".join([words])):
        call()


def test_a_branch_tells_how_far_its_orbits_swing():
    model = soft()
    orbit = next(orbit for orbit in vi.find_orbit(model.replace(omega=1.03)) if orbit.stable)
    branch = vi.continue_orbit(orbit, "omega", (1.0, 1.04))
    swings = branch.response(of=0)
    assert np.array_equal(swings["omega"], branch.values)
    mapped = vi.parameter_map(model, omega=branch.values[:3], indices=FIELDS, sample_impacts=300)
    for name in FIELDS:
        assert np.allclose(mapped[name], swings[name][:3], rtol=1e-8)


def test_a_harmonic_that_passes_a_resonance_reaches_the_stop_there():
    stop = vi.Stop(direction=1, gap=1.0, restitution=0.7)
    force = vi.Force(omega=0.3, harmonics={1: 0.1, 3: 0.004})
    system = vi.ImpactSystem(mass=1.0, damping=0.002, stiffness=1.0, force=force, stops=[stop])
    curve = vi.response_curve(system, omega=(0.2, 0.6))
    assert len(curve.steady) == 2
    below, above = curve.steady[0][-1], curve.steady[1][0]
    assert below < 1 / 3 < above
    for omega in (below, above):
        assert steady_motion(system.replace(omega=omega)).clearances() == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("share", [0.999, 1.001])
@pytest.mark.parametrize("name", ["rpm", "stiffness"])
def test_a_resonance_is_found_along_any_parameter_just_if_it_reaches_the_stop(name, share):
    """The swing U r^2 / sqrt((1 - r^2)^2 + (2 z r)^2) of an unbalance is largest at r = 1 / sqrt(1 - 2 z^2)."""

    @vi.family
    def machine(rpm=3000.0, stiffness=1e4, gap=1.0):
        omega, damping_ratio = rpm * math.pi / 30, 2e-4
        damping = 2 * damping_ratio * math.sqrt(stiffness)
        load = vi.Force(omega=omega, harmonics={1: 1e-3 * omega**2})
        return vi.ImpactSystem(
            mass=1.0, damping=damping, stiffness=stiffness, force=load, stops=[vi.Stop(direction=1, gap=gap)]
        )

    largest = 1e-3 / (2 * 2e-4 * math.sqrt(1 - 2e-4**2))
    values = {"rpm": (400.0, 1900.0), "stiffness": (3e4, 5e5)}
    curve = vi.response_curve(machine.replace(gap=share * largest), **{name: values[name]})
    assert len(curve.steady) == 1 + (share < 1.0)


@pytest.mark.parametrize(("gap", "kept"), [(1.5, True), (0.1, False)])
def test_a_stopped_curve_keeps_what_was_found_and_says_where_that_is_nothing(gap, kept):
    design = vi.ImpactOscillator(damping=0.1, gap=gap)
    calls = []

    def stop(*_):
        calls.append(1)
        return False

    if kept:  # the motion without contact is known in closed form
        curve = vi.response_curve(design, omega=(0.9, 3.0), progress=stop)
        assert curve.branches == []
        assert len(curve.dataset["point"]) > 9
    else:
        with pytest.raises(ValueError, match="stopped by `progress` before a motion was found"):
            vi.response_curve(design, omega=(0.9, 3.0), progress=stop)
    assert len(calls) <= 2


def grazes_of(curve):
    """Return where the parts without contact begin and end within the range, which is where the motion grazes."""
    ends = np.array([part[[0, -1]] for part in curve.steady]).ravel()
    return ends[(ends > curve.arguments["range"][0]) & (ends < curve.arguments["range"][1])]


def test_a_narrow_part_without_contact_parts_the_curve():
    """At an antiresonance the mass in front of the stop hardly moves: between two values of the grid it keeps clear."""
    springs, gap = np.array([[2.0, -1.0], [-1.0, 1.0]]), 0.002
    stop = vi.Stop(direction=[1, 0], gap=gap, stiffness=5.0, damping=0.1)
    pair = vi.ImpactSystem(
        mass=np.eye(2),
        stiffness=springs,
        damping=1e-3 * springs,
        force=vi.Force(omega=1.0, harmonics={1: [1.0, 0.0]}),
        stops=[stop],
    )
    curve = vi.response_curve(pair, of=0, omega=(0.7, 1.52))
    low, high = grazes_of(curve)
    assert low < 1.0 < high < low + 0.002
    for omega in (low, high):
        dynamic = springs * (1.0 + 1e-3j * omega) - omega**2 * np.eye(2)
        assert abs(np.linalg.solve(dynamic, [1.0, 0.0])[0]) == pytest.approx(gap, rel=1e-9)
    assert sorted(np.sort(branch.values[[0, -1]]).tolist() for branch in curve.branches) == [
        pytest.approx([0.7, low], rel=1e-9),
        pytest.approx([high, 1.52], rel=1e-9),
    ]


@pytest.mark.parametrize("lowest", [0.895, 0.995], ids=["in the range", "between its first two values"])
@pytest.mark.parametrize("gap", [1.0007, 1.0012])
def test_a_shallow_touch_is_one_branch_wherever_the_range_begins(gap, lowest):
    """The amplitude at resonance exceeds the gap by a thousandth."""
    stop, force = vi.Stop(direction=1.0, gap=gap, stiffness=1.0), vi.Force(omega=1.0, harmonics={1: 0.1})
    one = vi.ImpactSystem(mass=1.0, stiffness=1.0, damping=0.1, force=force, stops=[stop])
    curve = vi.response_curve(one, omega=(lowest, 1.5))
    (branch,) = curve.branches
    grazes = grazes_of(curve)
    assert 0.1 / abs(1.0 - grazes**2 + 0.1j * grazes) == pytest.approx([gap, gap], rel=1e-9)
    assert np.sort(branch.values[[0, -1]]) == pytest.approx(grazes, rel=1e-6)
