"""The final motion of an initial condition: chaos that does not last, and slow cycles."""

import numpy as np
import pytest

import vibroimpact as vi
from designs import TRANSIENTS, random_oscillator
from vibroimpact.backends import ImpactWindow
from vibroimpact.coexistence.final import WATCHED, final_motion, irregular, rests
from vibroimpact.coexistence.measuring import PAPER, Runner

SEEN = ImpactWindow(1000, 400)
RUNNER = Runner()


def final(osc):
    return final_motion(RUNNER, osc, SEEN)


@pytest.mark.parametrize("name", TRANSIENTS)
def test_chaos_that_ends_is_a_transient_of_the_cycle_that_it_ends_in(name):
    motion = final(TRANSIENTS[name])
    assert (motion.measured.name, motion.before.name) == (name, "chaotic")
    assert PAPER.keep < motion.watched < WATCHED
    # Its samples and indices are those of the cycle alone.
    hits = motion.samples.impact_velocity
    p = motion.measured.n_impacts
    np.testing.assert_allclose(hits[p:], hits[:-p], rtol=1e-9)
    assert motion.measured.indices["max_velocity"] == pytest.approx(hits.max(), rel=1e-12)
    # A map means over 5000 impacts, no multiple of p.
    assert motion.measured.indices["mean_velocity"] == pytest.approx(hits[:p].mean(), rel=1e-3)


def test_a_slow_motion_is_followed_to_its_cycle():
    motion = final(vi.ImpactOscillator(damping=0.0181, omega=0.93, restitution=0.898, gap=3.77))
    assert (motion.measured.name, motion.before.name) == ("period-3 impact-1", "undecided")
    assert 50_000 < motion.watched < WATCHED
    assert motion.measured.impacts < PAPER.transient  # measured again on the cycle, where nothing is left of the way


def test_a_motion_that_settles_late_is_sampled_on_its_cycle():
    osc = vi.ImpactOscillator(
        mass=0.07543070504734908, damping=1.1387959613949123, stiffness=991672.4026994141, amplitude=34.68078778448276,
        omega=9038.370890906606, restitution=0.9664401941826454, gap=3.717165516440625e-06,
    )  # fmt: skip
    verdict = vi.describe(osc, parameters=["gap"])
    (orbit,) = (one for one in vi.find_orbit(osc, n_periods=3, n_impacts=4) if one.stable and one.admissible)
    assert SEEN.transient + SEEN.keep < final(osc).watched < WATCHED
    np.testing.assert_allclose(np.sort(verdict.motion.velocities), np.sort(orbit.velocities), rtol=1e-9)
    assert [edge.kind for edge in verdict.boundaries] == ["period_doubling", "fold"]


def otherwise(osc, found, moved=1e-9):
    """Return what an irregular motion, carried on for 1e5 impacts from a state moved a little, ends in; or None."""
    hit = found.samples.impact_velocity[-1], found.samples.impact_phase[-1]
    start = vi.State(osc.gap, -osc.restitution * hit[0] * (1.0 - moved), hit[1] * osc.period)
    section = vi.impact_section(osc, start=start, transient_impacts=WATCHED - 4000, sample_impacts=4000)
    motion = vi.recognise(section, longest=512)
    return None if not motion.n_periods and motion.kind in ("chaotic", "sticking", "undecided") else motion.name


@pytest.mark.long
def test_what_is_named_irregular_still_is_so_1e5_impacts_later():
    # 500 irregular motions were tried once: 5 had ended by then, chaotic transients of 1e5 impacts and more.
    random, tried = np.random.default_rng(2026), 0
    while tried < 6:
        osc = random_oscillator(random)
        motion = final(osc)
        if irregular(motion.measured) and not rests(motion.measured):
            tried += 1
            assert otherwise(osc, motion) is None, osc
