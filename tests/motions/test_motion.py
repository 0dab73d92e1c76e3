"""Motions are named by the recurrence of their impacts."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq

import vibroimpact as vi
from vibroimpact.dataset import impact_speed, provenance, status_variable, variable
from vibroimpact.motion import Motion
from vibroimpact.motion.recognition import cycle_length

OSC = vi.ImpactOscillator(omega=2.0 * np.pi)  # T = 1 s


def section(time, velocity, *, release=(), status=vi.Status.OK, osc=OSC):
    time = np.asarray(time, dtype=float)
    release = np.asarray(release, dtype=float)
    return xr.Dataset(
        {
            "time": variable("time", "impact", time),
            "phase": variable("phase", "impact", (time / osc.period) % 1.0),
            "velocity": impact_speed("impact", np.asarray(velocity, dtype=float)),
            "stick_time": variable("stick_time", "stick", release - 0.1),
            "release_time": variable("release_time", "stick", release),
            "status": status_variable((), status),
        },
        attrs=provenance("impact_section", osc, {}),
    )


def repeated(times, velocities, n_periods, cycles=100):
    starts = n_periods * np.arange(cycles)
    return (starts[:, None] + np.asarray(times)).ravel(), np.tile(velocities, cycles)


@pytest.mark.parametrize(
    ("times", "velocities", "n_periods", "name"),
    [
        ([0.3], [1.0], 1, "period-1 impact-1"),
        ([0.3], [1.0], 2, "period-2 impact-1"),
        ([0.3, 0.8], [1.48, 1.13], 1, "period-1 impact-2"),
        ([0.3, 1.3], [1.0, 1.1], 2, "period-2 impact-2"),
        ([0.1, 1.4, 2.5], [0.5, 0.5, 0.7], 3, "period-3 impact-3"),
    ],
)
def test_a_repeating_section_is_named_by_its_smallest_cycle(times, velocities, n_periods, name):
    motion = vi.recognise(section(*repeated(times, velocities, n_periods)))
    assert motion.name == name
    assert motion.kind == "periodic"
    assert sorted(motion.velocities) == sorted(velocities)


def test_a_cycle_is_told_from_its_hardest_hit_on():
    motion = vi.recognise(section(*repeated([0.3, 0.8], [1.13, 1.48], 1)))
    assert motion.velocities == (1.48, 1.13)
    assert motion.phases == pytest.approx((0.8, 0.3), abs=1e-12)
    assert motion.sentence(7.0) == "period-1 impact-2, hits at 1.48 and 1.13 m/s every 7 s"


def test_phases_on_both_sides_of_the_wrap_are_the_same_phase():
    time, velocity = repeated([0.0], [1.0], 1)
    wobble = np.where(np.arange(len(time)) % 2, 1e-9, -1e-9)
    assert vi.recognise(section(time + 1.0 + wobble, velocity)).name == "period-1 impact-1"


def test_equal_velocities_at_other_phases_are_another_impact():
    assert vi.recognise(section(*repeated([0.3, 0.8], [1.0, 1.0], 1))).name == "period-1 impact-2"


def test_equal_impacts_after_unequal_waits_do_not_make_a_cycle():
    waits = np.random.default_rng(1).integers(1, 3, 300)
    assert vi.recognise(section(np.cumsum(waits) + 0.3, np.ones(300))).n_periods == 0


def test_differences_below_the_tolerance_repeat_and_above_it_do_not():
    time, velocity = repeated([0.3], [2.0], 1, 300)
    wobble = np.random.default_rng(2).uniform(-1.0, 1.0, 300)
    assert vi.recognise(section(time, velocity + 1e-7 * wobble)).name == "period-1 impact-1"
    assert vi.recognise(section(time, velocity + 1e-4 * wobble)).name == "undecided"


def test_a_transient_in_the_first_half_does_not_hide_the_cycle():
    time, velocity = repeated([0.3], [1.0], 1, 400)
    velocity = velocity + 0.1 * 0.9 ** np.arange(400)
    assert vi.recognise(section(time, velocity)).name == "period-1 impact-1"


def test_irregular_impacts_have_no_cycle():
    rng = np.random.default_rng(3)
    motion = vi.recognise(section(np.cumsum(rng.uniform(0.2, 2.0, 500)), rng.uniform(0.1, 2.0, 500)))
    assert motion.kind in ("chaotic", "undecided")
    assert (motion.n_periods, motion.n_impacts, motion.velocities) == (0, 0, ())


def test_too_few_impacts_are_not_called_chaotic():
    rng = np.random.default_rng(4)
    motion = vi.recognise(section(np.cumsum(rng.uniform(0.2, 2.0, 12)), rng.uniform(0.1, 2.0, 12)))
    assert motion.name == "undecided"
    assert "sample more" in motion.sentence(1.0)


def chatter(cycles, n_periods):
    times, velocities = 0.1 + 0.05 * (1 - 0.8 ** np.arange(30)), 0.8 ** np.arange(30)
    return repeated(times, velocities, n_periods, cycles)


@pytest.mark.parametrize("n_periods", [1, 3])
def test_a_complete_chatter_counts_as_impacts_minus_one(n_periods):
    time, velocity = chatter(20, n_periods)
    hits = section(time, velocity, release=0.5 + n_periods * np.arange(20), status=vi.Status.STICKING)
    motion = vi.recognise(hits)
    assert motion.name == f"period-{n_periods} sticking"
    assert motion.n_impacts == -1
    assert max(motion.velocities) == 1.0
    assert len(motion.velocities) == 30
    assert "hardest hit 1 m/s" in motion.sentence(1.0)


def test_a_sticking_cycle_may_hold_several_releases():
    time, velocity = chatter(30, 1)
    release = np.cumsum(np.tile([1.0, 2.0], 15))
    motion = vi.recognise(section(time, velocity, release=release, status=vi.Status.STICKING))
    assert motion.name == "period-3 sticking"


def test_releases_after_irregular_waits_are_intermittent_sticking():
    release = np.cumsum(np.random.default_rng(5).integers(1, 4, 30).astype(float))
    hits = section(*chatter(30, 1), release=release, status=vi.Status.STICKING)
    assert vi.recognise(hits) == Motion("sticking", 0, -1)


def test_two_releases_are_enough_to_close_a_sticking_cycle():
    hits = section(*chatter(5, 1), release=[0.5, 2.5], status=vi.Status.STICKING)
    assert vi.recognise(hits).name == "period-2 sticking"


def test_without_restitution_a_sticking_cycle_has_as_many_impacts_as_are_recorded():
    osc = OSC.replace(restitution=0.0)
    time, velocity = repeated([0.2], [1.0], 1, 20)
    hits = section(time, velocity, release=0.5 + np.arange(20), status=vi.Status.STICKING, osc=osc)
    assert (vi.recognise(hits).n_periods, vi.recognise(hits).n_impacts) == (1, 1)


def test_a_single_stick_at_the_start_does_not_hide_the_cycle_that_follows():
    time, velocity = repeated([0.7], [1.0], 1)
    assert vi.recognise(section(time, velocity, release=[0.5], status=vi.Status.STICKING)).name == "period-1 impact-1"


@pytest.mark.parametrize(
    ("status", "name"),
    [
        (vi.Status.NO_IMPACT, "no impact"),
        (vi.Status.STOPPED_IMPACTING, "no impact"),
        (vi.Status.STUCK_FOREVER, "permanently in contact"),
        (vi.Status.DECAYING, "decaying"),
        (vi.Status.BUDGET, "not followed to the end"),
    ],
)
def test_a_motion_that_ended_is_named_by_how_it_ended(status, name):
    motion = vi.recognise(section([], [], status=status))
    assert motion.name == name
    assert status.sentence in motion.sentence(1.0)


def test_what_is_no_impact_section_is_refused():
    with pytest.raises(ValueError, match="`section` must be an impact section; it holds no 'phase'"):
        vi.recognise(section([0.5], [1.0]).drop_vars("phase"))
    with pytest.raises(ValueError, match="`tolerance` must be a number > 0, got 0"):
        vi.recognise(section([0.5], [1.0]), tolerance=0)
    with pytest.raises(ValueError, match="`longest` must be a whole number >= 1, got 0"):
        vi.recognise(section([0.5], [1.0]), longest=0)


@pytest.mark.parametrize("cycles", [2, 3])
def test_a_section_of_two_cycles_is_enough_to_name_them(cycles):
    assert (
        vi.recognise(section(*repeated([0.3, 0.8, 1.2], [1.0, 0.7, 0.4], 2, cycles=cycles))).name == "period-2 impact-3"
    )


def test_a_cycle_longer_than_half_the_samples_is_not_claimed():
    assert cycle_length(np.array([1.0, 2.0, 3.0, 1.0]), np.zeros(4)) == 0


@pytest.mark.parametrize("multiplier", [-0.98, -0.996, -0.9995])
def test_a_motion_that_turns_from_one_side_to_the_other_is_not_named_double(multiplier):
    """Before a period doubling, from near and far, over short and long samples."""

    def orbit_at(omega):
        orbits = vi.find_orbit(vi.ImpactOscillator(omega=omega), n_periods=1)
        return min((one for one in orbits if one.admissible), key=lambda one: one.multipliers[0].real)

    omega = brentq(lambda at: min(m.real for m in orbit_at(at).multipliers) - multiplier, 2.65, 2.65392, xtol=1e-12)
    start, names = orbit_at(omega).start, set()
    for kick in (1e-2, 1e-4, 1e-5, 1e-6, 1e-7):
        begun = vi.State(start.displacement, start.velocity * (1.0 - kick), start.time)
        for sample in (50, 200, 500, 1000, 2000):
            window = {"transient_impacts": sample // 2, "sample_impacts": sample}
            names.add(vi.recognise(vi.impact_section(vi.ImpactOscillator(omega=omega), start=begun, **window)).name)
    assert names == {"period-1 impact-1", "undecided"}
