"""The final motion of an initial condition: chaos that does not last, slow cycles, rests that rounding repeats."""

import numpy as np
import pytest

import vibroimpact as vi
from designs import RESTS, TRANSIENTS, random_oscillator
from vibroimpact.backends import ImpactWindow
from vibroimpact.coexistence.final import WATCHED, final_motion, irregular, rests
from vibroimpact.coexistence.measuring import PAPER, Runner
from vibroimpact.indices import INDICES
from vibroimpact.motion.recognition import recognise

SEEN = ImpactWindow(1000, 400)
RUNNER = Runner()


def final(osc):
    return final_motion(RUNNER, osc.cells({}), SEEN)


@pytest.mark.parametrize("name", TRANSIENTS)
def test_chaos_that_ends_is_a_transient_of_the_cycle_that_it_ends_in(name):
    found = final(TRANSIENTS[name])
    assert (found.measured.name, found.before.name) == (name, "chaotic")
    assert PAPER.keep < found.watched < WATCHED
    # Its samples and indices are those of the cycle alone.
    hits = found.samples.impact_velocity
    p = found.measured.n_impacts
    np.testing.assert_allclose(hits[p:], hits[:-p], rtol=1e-9)
    assert found.measured.indices["max_velocity"] == pytest.approx(hits.max(), rel=1e-12)
    # A map means over 5000 impacts, no multiple of p.
    assert found.measured.indices["mean_velocity"] == pytest.approx(hits[:p].mean(), rel=1e-3)


def test_a_slow_motion_is_followed_to_its_cycle():
    found = final(vi.ImpactOscillator(damping=0.0181, omega=0.93, restitution=0.898, gap=3.77))
    assert (found.measured.name, found.before.name) == ("period-3 impact-1", "undecided")
    assert 50_000 < found.watched < WATCHED
    assert found.measured.impacts < PAPER.transient  # measured again on the cycle, where nothing is left of the way


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


def test_chaos_that_lasts_is_watched_for_1e5_impacts_and_keeps_the_indices_of_a_map():
    osc = vi.ImpactOscillator(omega=2.8)
    found = final(osc)
    assert (found.measured.name, found.before) == ("chaotic", None)
    assert found.watched >= WATCHED
    assert found.measured.indices == RUNNER.measure(osc.cells({}), names=tuple(INDICES))[0].indices


@pytest.mark.parametrize("hardest", RESTS)
def test_a_rest_that_rounding_repeats_is_left_for_where_most_moved_releases_go(hardest):
    found = final(RESTS[hardest])
    assert (found.measured.name, found.before.name) == ("period-1 impact-1", "intermittent sticking")
    assert found.measured.indices["max_velocity"] == pytest.approx(hardest, abs=1e-3)
    assert sum(found.ends.values()) == 32
    assert max(found.ends, key=found.ends.get) == "period-1 impact-1"


def test_rests_without_end_are_intermittent_sticking_watched_for_1e5_impacts():
    found = final(vi.ImpactOscillator(omega=2.9))
    assert (found.measured.name, found.before) == ("intermittent sticking", None)
    assert found.watched >= WATCHED
    assert set(found.ends) == {"intermittent sticking"}


@pytest.mark.parametrize("omega", [2.0, 0.1])
def test_what_is_certain_within_a_map_is_computed_once(omega, monkeypatch):
    runner = Runner()
    found = final_motion(runner, vi.ImpactOscillator(omega=omega).cells({}), SEEN)
    assert runner.measured == 1
    assert found.before is None
    assert found.watched < PAPER.keep


def otherwise(osc, found, moved=1e-9):
    """Return what an irregular motion, carried on for 1e5 impacts from a state moved a little, ends in; or None."""
    hit = found.samples.impact_velocity[-1], found.samples.impact_phase[-1]
    start = vi.State(osc.gap, -osc.restitution * hit[0] * (1.0 - moved), hit[1] * osc.period)
    section = vi.impact_section(osc, start=start, transient_impacts=WATCHED - 4000, sample_impacts=4000)
    motion = recognise(section, longest=512)
    return None if not motion.n_periods and motion.kind in ("chaotic", "sticking", "undecided") else motion.name


@pytest.mark.long
def test_what_is_named_irregular_still_is_so_1e5_impacts_later():
    # 500 irregular motions were tried once: 5 had ended by then, chaotic transients of 1e5 impacts and more.
    random, tried = np.random.default_rng(2026), 0
    while tried < 6:
        osc = random_oscillator(random)
        found = final(osc)
        if irregular(found.measured) and not rests(found.measured):
            tried += 1
            assert otherwise(osc, found) is None, osc
