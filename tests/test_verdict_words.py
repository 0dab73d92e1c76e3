"""Each sentence of a verdict is true, and none contradicts another: transients, scaling, sticking, what lies beyond."""

import math
from dataclasses import replace

import numpy as np
import pytest

import vibroimpact as vi
from designs import random_oscillator
from vibroimpact.backends import ImpactWindow
from vibroimpact.cells import cells_at
from vibroimpact.coexistence.measuring import Runner
from vibroimpact.orbits.sticking import periods_from_release
from vibroimpact.verdict.advice import advise
from vibroimpact.verdict.boundaries import _end_of_sticking
from vibroimpact.verdict.branches import Branches
from vibroimpact.verdict.changes import ends_of
from vibroimpact.verdict.edges import Side
from vibroimpact.verdict.present import coexisting_motions, present_motion
from vibroimpact.verdict.ranges import range_of

# The mass rests at the stop again and again, and rounding decides when that ends; it does after some 1e4 impacts.
RESTLESS = vi.ImpactOscillator(damping=0.2015, omega=2.4248, restitution=0.9009, gap=0.2097)
# A third of the initial conditions hit twice as hard for some 2e4 impacts, no rounding involved.
SLOW = vi.ImpactOscillator(
    mass=0.4399088962834013,
    damping=0.4892130134999437,
    stiffness=12233.232186823981,
    amplitude=0.028886743761128916,
    omega=37.03357437899465,
    restitution=0.9496439504642897,
)
STICKS = vi.ImpactOscillator(
    damping=0.036507953860658415, omega=2.436481885540036, restitution=0.5131638170127344, gap=0.26418326107434165
)
NARROW = vi.ImpactOscillator(
    damping=0.002547303444481522, omega=2.0101148729054947, restitution=0.7246201786416921, gap=-0.6627901124900919
)


def text_of(verdict):
    return " ".join(str(verdict).split())


@pytest.mark.long(but=1)
@pytest.mark.parametrize(
    "osc",
    [
        vi.ImpactOscillator(omega=2.1, damping=0.0005, restitution=0.99),  # settles slowly
        vi.ImpactOscillator(omega=2.8),  # chaotic
        vi.ImpactOscillator(omega=0.5),  # sticks
        vi.ImpactOscillator(damping=0.0044, omega=2.935, restitution=0.895),
    ],
)
def test_without_a_gap_all_hits_are_proportional_to_the_force(osc):
    verdict = vi.describe(osc, parameters=["amplitude"])
    (advice,) = verdict.advice
    assert advice.value == 0.8 * osc.amplitude
    assert advice.max_velocity == pytest.approx(0.8 * verdict.worst.max_velocity, rel=1e-12)
    motions = vi.attractors(osc.replace(amplitude=advice.value))
    repeats = all(motion.repeats for motion in verdict.attractors)
    hardest = max(motion.max_velocity for motion in motions)
    assert hardest == pytest.approx(advice.max_velocity, rel=1e-8 if repeats else 0.05)


def test_advice_without_a_gap_is_measured_by_the_hardest_motion_that_is_reached():
    osc = vi.ImpactOscillator(omega=2.8, gap=0.0)
    runner = Runner("cpu")
    present = present_motion(osc, runner)
    motions = coexisting_motions(present, runner)
    hardest = max(motion.max_velocity for motion in motions)
    never = replace(motions[0], from_rest=False, share=0.0, max_velocity=10.0 * hardest)
    (advice,) = advise(present, [*motions, never], [range_of(osc, "amplitude", 3.0)], runner, Branches())
    assert advice.before == pytest.approx(hardest, rel=1e-12)


def test_no_impacts_are_claimed_of_initial_conditions_that_are_undecided():
    """Without loss nothing attracts; from rest the spring presses the mass to the stop."""
    verdict = text_of(
        vi.describe(vi.ImpactOscillator(amplitude=0.0, damping=0.0, restitution=1.0, gap=-0.5), parameters=[])
    )
    assert "100 % of the initial conditions: motions of constant energy" in verdict
    assert "no impacts from rest, but 100 % of the initial conditions keep the energy with which they hit" in verdict
    assert "from any of" not in verdict


def test_where_nothing_helps_the_parameters_that_were_tried_are_named():
    osc = vi.ImpactOscillator(omega=2.6)
    for names in (["mass", "stiffness"], ["restitution"]):
        verdict = vi.describe(osc, parameters=names, within=1e-3)
        assert not verdict.advice
        assert f"no change of {' or '.join(names)} alone within its range" in text_of(verdict)


@pytest.mark.long
def test_long_transients_are_told_with_their_length_and_their_hits():
    for osc in (RESTLESS, SLOW):
        verdict = vi.describe(osc, parameters=["omega"])
        motion, *late = verdict.attractors
        assert sum(each.share for each in late) < 0.02  # still on their way after 1e5 impacts
        random = np.random.default_rng(7)
        starts = cells_at(osc, np.zeros(64), 4.0 * osc.velocity_scale * random.random(64), random.random(64))
        hardest = max(motion.hardest for motion in Runner().measure(starts, ImpactWindow(5100, 500)))
        assert hardest > 1.5 * motion.max_velocity
        assert hardest == pytest.approx(motion.transient_velocity, rel=0.01)
        assert motion.transient_impacts > 10_000
        assert "some after up to" in text_of(verdict)


def test_where_rounding_decides_how_long_impacts_last_no_value_is_given_from_which_they_do():
    verdict = vi.describe(RESTLESS, parameters=["mass", "gap"])
    assert sum(verdict.releases.values()) == 32
    assert "lasting impacts" not in text_of(verdict)


def test_intermittent_sticking_is_not_called_predictable():
    verdict = vi.describe(vi.ImpactOscillator(omega=2.9), parameters=["omega"])
    assert (verdict.motion.name, verdict.transient) == ("intermittent sticking", "")
    assert verdict.watched >= 100_000
    assert set(verdict.releases) == {"intermittent sticking"}
    assert "perturbations vanish" not in text_of(verdict)
    assert "no longer chaotic" not in text_of(verdict)


@pytest.mark.parametrize(
    ("osc", "name"), [(STICKS, "omega"), (STICKS, "gap"), (vi.ImpactOscillator(omega=0.3), "omega")]
)
def test_up_to_its_end_sticking_is_of_the_same_period(osc, name):
    n, present = periods_from_release(osc, 64), getattr(osc, name)
    for edge in vi.describe(osc, parameters=[name]).boundaries:
        last = edge.value if edge.found else edge.searched_to
        for share in np.linspace(0.0, 1.0, 13)[:-1]:
            there = osc.replace(**{name: present + share * (last - present)})
            assert periods_from_release(there, 64) == n, (share, edge)


def test_an_orbit_that_ends_where_it_was_born_is_said_to_halve():
    down, _ = vi.describe(vi.ImpactOscillator(omega=2.68), parameters=["omega"]).boundaries
    assert (down.kind, round(down.value, 8)) == ("period_halving", 2.65392352)
    assert down.beyond == "period-1 impact-1"


def test_what_was_seen_beyond_is_given_with_the_value_at_which_it_was():
    verdict = vi.describe(vi.ImpactOscillator(omega=2.6), parameters=["omega"])
    for edge in verdict.boundaries:
        ((_, what),) = ends_of(verdict, edge)
        assert what == f"period doubling;\nperiod-2 impact-2 at {edge.beyond_at:.6g}"
        assert f"period-2 impact-2 at {edge.beyond_at:.6g}" in text_of(verdict)


def test_a_boundary_is_printed_with_as_many_digits_as_part_it_from_the_present_value():
    verdict = vi.describe(NARROW, parameters=["amplitude"])
    text = text_of(verdict)
    for edge in verdict.boundaries:
        assert 0.0 < abs(edge.change) < 1e-8
        ((place, _),) = ends_of(verdict, edge)
        assert float(place.split()[0]) != 1.0
    assert "expect those around it in a machine" in text


def test_one_hit_is_printed_with_the_same_digits_throughout():
    verdict = vi.describe(vi.ImpactOscillator(omega=2.6), parameters=["omega"])
    hardest = f"{verdict.worst.max_velocity:.4g} m/s"
    head, _, rest = text_of(verdict).partition("boundaries")
    assert hardest in head
    assert rest.count(hardest) >= 2


@pytest.mark.long
def test_sticking_of_random_designs_hardly_ever_ends_before_its_boundary():
    """At 12 values spaced evenly up to it, and at 24 that come ever closer to the present one."""
    random, wrong, tried = np.random.default_rng(1313), [], 0
    shares = [*np.linspace(0.0, 1.0, 13)[1:-1], *0.5 ** np.arange(1, 25)]
    while tried < 12:
        osc = random_oscillator(random)
        present = present_motion(osc, Runner(workers=1))
        if present.orbit is None or not present.orbit.sticks:
            continue
        tried += 1
        n = present.orbit.n_periods
        for name in ("omega", "damping"):
            for direction in (-1, 1):
                varied = range_of(osc, name, 3.0)
                found = _end_of_sticking(present, Side(varied, direction))
                last = found.end if math.isnan(found.value) else found.value
                there = [varied.at(varied.between(varied.value, last, share)) for share in shares]
                if any(periods_from_release(design, n) != n for design in there):
                    wrong.append((osc, found.kind, n))
    assert len(wrong) <= 1, wrong


@pytest.mark.parametrize(("gap", "restitution"), [(0.1, 0.8), (0.1, 1.0), (0.0, 1.0), (-0.1, 1.0)])
def test_a_free_undamped_mass_has_no_boundaries(gap, restitution):
    """No motion attracts others, whatever the parameters: a table of them would say nothing."""
    design = vi.ImpactOscillator(damping=0.0, amplitude=0.0, gap=gap, restitution=restitution)
    text = " ".join(str(vi.describe(design, parameters=["gap"], workers=1)).split())
    assert "boundaries not sought: without load and damping, energies are kept between impacts" in text
    assert "no boundary" not in text
