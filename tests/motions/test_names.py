"""Motions are named by their cycles, by their rests, as chaos, or as quasi-periodic."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from codes import ONE_MASS, index_of, name_of
from systems import (
    between_stops,
    bouncing_ball,
    one_mass,
    two_masses,
)
from vibroimpact.motion import MotionClass, decide, motion_name

pytestmark = pytest.mark.usefixtures("modal_engine")

OSC = vi.ImpactOscillator()
NAMED = ("n_periods", "n_impacts", "lyapunov_per_impact")


# Cycles


def test_a_lossless_oscillator_neither_closes_nor_loses(way):
    indices = way.indices(vi.ImpactOscillator(restitution=1.0, damping=0.0, omega=2.7), transient=20, sample=150)
    assert (*name_of(indices), indices["dissipation"]) == (0, 0, 0.0)
    assert math.isfinite(indices["lyapunov"])


@pytest.mark.long(but=6)
@pytest.mark.parametrize("omega", [0.2, 0.5, 1.2, 2.8, 3.0, 3.4, 4.9])
def test_motions_are_called_what_their_sections_show(way, omega):
    osc = vi.ImpactOscillator(omega=omega)
    indices, motion = (
        way.indices(osc, transient=300, sample=200),
        vi.recognise(way.section(osc, 300, 200), tolerance=1e-9),
    )
    assert name_of(indices) == (motion.n_periods, motion.n_impacts)


def test_a_motion_has_the_name_that_a_map_gives_it():
    """Also from an initial condition, which the section holds; periodic, sticking, chaotic ones and none."""
    window, names = {"transient_impacts": 1000, "sample_impacts": 3000}, set()
    needed = ("lyapunov_per_impact", "n_periods", "n_impacts")
    driven = [two_masses(force=vi.Force(omega=omega, harmonics={1: [5.0, 0.0]})) for omega in np.linspace(4.0, 14.0, 8)]
    one_mass = [vi.ImpactOscillator(omega=omega) for omega in (0.1, 0.95, 2.0, 2.8)]
    for model in [*driven, vi.models.bouncing_ball(), *one_mass]:
        start = (
            None
            if model in driven[::2] or model.forgets
            else vi.State([0.01] * len(model.mass), [0.2] * len(model.mass), 0.3)
        )
        motion = vi.recognise(vi.impact_section(model, start=start, **window))
        sweep = vi.parameter_map(model, omega=[model.omega], start=start, indices=needed, **window)
        named = vi.classify(sweep)
        name = motion_name(*(int(named[part][0]) for part in ("motion", "n_periods", "n_impacts")))
        assert name in (motion.name, motion.motion_class.stored.label)
        assert not motion.n_impacts > 0 or len(motion.velocities) == len(motion.phases) == motion.n_impacts
        names.add(motion.kind)
    assert {"periodic", "sticking", "chaotic"} <= names


@pytest.mark.long(but=6)
@pytest.mark.parametrize("early_closing", [False, True])
@pytest.mark.parametrize(("restitution", "n_periods"), [(0.5, 1), (0.8, 1), (0.25, 2)])
@pytest.mark.parametrize("multiplier", [-0.98, -0.996, -0.9995, -1.0005, -1.004])
def test_a_cycle_that_is_reached_by_turns_from_either_side_is_not_named_double(
    multiplier, restitution, n_periods, early_closing
):
    """Of the bouncing ball: multipliers of product r^2 and sum 1 + r^2 - (1 + r)^2 sqrt(gamma^2 - fold^2)."""
    squared, fold = restitution**2, n_periods * math.pi * (1.0 - restitution) / (1.0 + restitution)
    slope = (1.0 + squared - multiplier - squared / multiplier) / (1.0 + restitution) ** 2
    ball = bouncing_ball(math.hypot(fold, slope), restitution)
    orbit = vi.find_orbit(ball, n_periods=n_periods)[0]
    assert min(abs(one - multiplier) for one in orbit.multipliers) < 1e-9
    named = set()
    for kick in (1e-2, 1e-4, 1e-5, 1e-6, 1e-7):
        start = vi.State(orbit.start.displacement, (1.0 - kick) * np.array(orbit.start.velocity), orbit.start.time)
        for sample in (200, 500, 1000, 2000):
            (found,) = index_of(
                ball,
                "n_periods",
                start=start,
                transient_impacts=sample // 2,
                sample_impacts=sample,
                early_closing=early_closing,
            )
            named.add(int(found))
    assert named <= ({0, n_periods} if multiplier > -1.0 else {0, 2 * n_periods})
    assert abs(multiplier + 1.0) < 1e-3 or len(named) == 2  # it is named where it is near


# Rests


RESTING = {"omega": np.linspace(0.1, 0.9, 9), "mass": np.linspace(0.2, 1.0, 9)}


def test_a_sticking_motion_is_named_only_if_one_digit_more_or_less_leaves_its_name():
    names = ("n_periods", "n_impacts", "lyapunov_per_impact")
    sweep = vi.parameter_map(OSC, indices=names, sample_impacts=1000, **RESTING)
    beside = {name: np.nextafter(values, 9.0) for name, values in RESTING.items()}
    cells = vi.parameter_map(OSC, indices=names, sample_impacts=1000, **beside)
    named = (sweep["n_impacts"].values == -1) & (sweep["n_periods"].values > 0)
    assert named.sum() > 30
    assert np.array_equal(sweep["n_periods"].values[named], cells["n_periods"].values[named])


@ONE_MASS
def test_rests_at_times_that_rounding_decides_have_no_period(way):
    tube = vi.ImpactOscillator(
        mass=0.5, damping=0.63246, stiffness=2000.0, amplitude=2.0, omega=44.0 * np.pi, restitution=0.7, gap=0.0003
    )
    gaps, resting = np.unique(tube.gap * (1.0 + 1e-16 * np.arange(-9, 10)))[:: 100 if way.slow else 1], 0
    for gap in gaps:
        indices = way.indices(tube.replace(gap=gap), ("n_periods", "n_impacts", "lyapunov_per_impact"), sample=1000)
        assert indices["n_periods"] == 0
        if indices["status"] == vi.Status.STICKING:
            resting += 1
            assert (indices["n_impacts"], indices["lyapunov_per_impact"]) == (-1, -math.inf)
    assert resting > len(gaps) / 2 or way.slow


def test_a_mass_that_hits_and_stays_is_named_by_its_count(way):
    osc = OSC.replace(restitution=0.0, omega=0.4)
    indices, times = way.indices(osc, sample=200), way.section(osc, 100, 50)["time"].values
    assert (indices["n_periods"], indices["lyapunov"]) == (1, -math.inf)
    assert indices["n_impacts"] == (times > times[-1] - osc.period + 1e-6).sum()


# Quasi-periodic motions: an exponent of 0, and no cycle


def averages(system):
    """Return the mean of exp(2 pi i phase) over each of two long windows, by weights that vanish smoothly at the ends.

    Along a quasi-periodic motion such means converge faster than any power of the number of impacts.
    """
    phases = vi.impact_section(system, transient_impacts=4000, sample_impacts=4000)["phase"].values[::2]
    at = (np.arange(1000) + 0.5) / 1000
    weights = np.exp(-1.0 / (at * (1.0 - at)))
    return [weights @ np.exp(2j * np.pi * part) / weights.sum() for part in np.split(phases, 2)]


def test_beyond_a_neimark_sacker_point_motions_are_quasi_periodic():
    omegas = [0.945, 0.95, 0.96, 0.965, 0.969, 0.98]
    before, after = (
        min(vi.find_orbit(between_stops(omega), n_impacts=2), key=lambda orbit: orbit.spectral_radius)
        for omega in (0.969, 0.965)
    )
    assert before.spectral_radius < 1.0 < after.spectral_radius
    assert abs(after.multipliers[0].imag) > 0.1
    sweep = vi.parameter_map(
        between_stops(1.0), omega=omegas, indices=NAMED, transient_impacts=2000, sample_impacts=3000
    )
    classes = vi.classify(sweep)["motion"]
    words = [classes.attrs["flag_meanings"].split()[code] for code in classes.values]
    assert words == ["chaotic", *["quasi_periodic"] * 3, *["periodic"] * 2]
    for omega, word in zip(omegas, words, strict=True):
        first, last = averages(between_stops(omega))
        assert (abs(first - last) < 1e-9) == (word != "chaotic")


def test_the_growth_over_many_impacts_decides_what_is_quasi_periodic():
    growths = [-1.1, -0.9, 0.0, math.log(3000) - 0.1, math.log(3000) + 0.1, 0.0, 0.0, math.nan]
    status = [*[vi.Status.OK] * 5, vi.Status.SHORT_WINDOW, vi.Status.STICKING, vi.Status.BUDGET]
    known = [MotionClass(code).label for code in decide(status, growths, 0, 0, 3000)]
    yes, no = "quasi-periodic", "undecided"
    assert known == [no, yes, yes, yes, no, no, yes, "not followed to the end"]
    assert MotionClass(int(decide(vi.Status.OK, 0.0, 0, 0, 999))) == MotionClass.UNDECIDED
    assert MotionClass(int(decide(vi.Status.OK, 0.0, 3, 2, 3000))) == MotionClass.PERIODIC


def test_one_mass_never_moves_quasi_periodically_not_even_without_loss():
    elastic = vi.ImpactOscillator(restitution=1.0, damping=0.0, omega=3.3)
    for model in (elastic, one_mass(elastic)):
        sweep = vi.parameter_map(model, omega=[3.3], start=vi.State(-0.4), indices=NAMED, sample_impacts=3000)
        assert vi.classify(sweep)["motion"].values == MotionClass.UNDECIDED
        assert "quasi_periodic" not in vi.classify(sweep)["motion"].attrs["flag_meanings"]
