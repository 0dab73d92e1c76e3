"""Advice softens the impacts from every initial condition, and a verdict agrees with itself and with the others."""

import math
import os
from dataclasses import replace

import numpy as np
import pytest

import vibroimpact as vi
from contents import named
from designs import random_designs
from systems import STEEL, cabinet, changed, on_springs, one_mass, pushed, pushed_pair, random_pair
from texts import hardest_hit, text_of
from vibroimpact import models
from vibroimpact.backends import ImpactWindow, StroboscopicWindow
from vibroimpact.coexistence.measuring import Runner
from vibroimpact.verdict import Verdict
from vibroimpact.verdict.advice import advise
from vibroimpact.verdict.branches import Branches
from vibroimpact.verdict.present import coexisting_motions, present_motion
from vibroimpact.verdict.ranges import range_of

DESIGNS, PARTS = 200 if "FUZZ" in os.environ else 72, 8  # `make fuzz` asks for more
SAMPLE = ImpactWindow(2000, 2000)
TUBE = vi.ImpactOscillator(
    mass=2.1, stiffness=26860.0, damping_ratio=0.01, amplitude=5.0, frequency=20.0, restitution=0.7, gap=0.5e-3
)
HARDER = 1.001  # chaos is compared over different samples


def without_boundaries(osc, parameter):
    """Return the verdict on a design but for its boundaries, which have property tests of their own."""
    runner = Runner(workers=1)
    present = present_motion(osc, runner)
    motions = coexisting_motions(present, runner)
    return Verdict(
        model=osc,
        oscillator=osc,
        kind=present.measured.kind,
        motion=present.motion,
        orbit=present.orbit,
        status=present.measured.status.word,
        indices=present.measured.indices,
        transient=present.final.before.name if present.final.before else "",
        attractors=motions,
        stops=present.attractor.stops if present.attractor else (),
        advice=advise(present, motions, [range_of(osc, parameter, 3.0)], runner, Branches()),
    )


def hits(runner, cells):
    """Return the hardest hit of the motion that each cell settles to."""
    return np.array([motion.hardest for motion in runner.measure(cells, SAMPLE)])


def impacts(osc, rng, number=256):
    """Return random impacts of up to 4 V."""
    return osc.cells({}).copies(number).struck(rng.integers(1 << 10, 1 << 20, number))


def switched(osc, changed, n_periods, runner):
    """Return the motion from rest at 128 instants of its cycle, as initial conditions of a changed design."""
    often = math.ceil(128 / min(n_periods or 32, 32))
    window = StroboscopicWindow(3000, often * min(n_periods or 32, 32), 0.37 / often, often)
    (samples,) = runner.samples(osc.cells({}), window)
    there = changed.cells({}).copies(len(samples.look_phase))
    return there.carried(samples.look_displacement, samples.look_velocity, samples.look_phase)


def continued(orbit, advice):
    """Return the hardest hits of the stable orbits on an orbit's branch at an advised value."""
    if orbit is None or orbit.sticks:
        return []
    ends = sorted([orbit.value(advice.parameter), advice.value])
    branch = vi.continue_orbit(orbit, advice.parameter, tuple(ends), step=0.05, virtual=False)
    there = [one for one in branch.orbits if one.value(advice.parameter) == pytest.approx(advice.value, rel=1e-12)]
    return [max(one.velocities) for one in there if one.stable and one.admissible]


def check_advice(verdict, rng):
    """No more than 2 % of 256 initial conditions, nor any of 128 instants, hit harder than what is softened.

    Nor does the orbit of the motion from rest, continued to the value.
    """
    osc, runner = verdict.oscillator, Runner(workers=1)
    for advice in verdict.advice:
        changed = osc.replace(**{advice.parameter: advice.value})
        assert advice.before == verdict.worst.max_velocity
        spread = hits(runner, impacts(changed, rng))
        assert (spread > advice.before * HARDER).mean() <= 0.02, (osc, advice)
        then = hits(runner, switched(osc, changed, verdict.motion.n_periods, runner))
        assert (then <= advice.before * HARDER).all(), (osc, advice)
        along = continued(verdict.orbit, advice)
        assert all(hit <= advice.before * HARDER for hit in along), (osc, advice)
        if advice.benefit == "no_impact":
            assert not along, (osc, advice)
            assert (spread > 0.0).mean() <= 0.02, (osc, advice)
            assert not then.any(), (osc, advice)


def check_agreement(verdict):
    """Map, attractors and verdict say the same; a transient that is all of a map's window is named as one."""
    osc = verdict.oscillator
    sweep = vi.parameter_map(osc, omega=[osc.omega], indices=("lyapunov_per_impact", "n_periods", "n_impacts"))
    kind, name = named(sweep)
    assert name == (verdict.transient or verdict.motion.name), osc
    assert name in " ".join(str(verdict).split()), osc
    assert verdict.transient or verdict.kind == kind.word, osc
    mine, *_ = verdict.attractors
    assert mine.from_rest
    letter = mine.name.removeprefix(verdict.motion.name).strip()  # of several of one name
    twins = [one for one in verdict.attractors if one.name.removesuffix(f" {one.name[-1]}") == verdict.motion.name]
    assert mine.name == f"{verdict.motion.name} {letter}".strip(), osc
    assert (len(letter) == 1) == (len(twins) > 1), osc
    assert mine.max_velocity == verdict.max_velocity, osc


def check_attractors(verdict):
    """The motions that a verdict lists are those that `attractors` finds, told apart by letters if of one name."""
    osc, names = verdict.oscillator, [one.name for one in verdict.attractors]
    found = sorted((one.name, one.share) for one in vi.attractors(osc, workers=1))
    assert found == sorted((one.attractor.name, one.share) for one in verdict.attractors), osc
    assert len(set(names)) == len(names), osc


@pytest.mark.long(but=1)
@pytest.mark.parametrize("part", range(PARTS))
def test_advice_makes_nothing_worse_from_anywhere_and_all_that_is_said_agrees(part):
    rng = np.random.default_rng([1311, part])
    count = 0
    for number, osc in enumerate(random_designs(rng, DESIGNS // PARTS)):
        verdict = without_boundaries(osc, str(rng.choice(list(osc.values))))
        check_advice(verdict, rng)
        check_agreement(verdict)
        if number % 10 == 0:
            check_attractors(verdict)
        count += len(verdict.advice)
    assert count > DESIGNS // PARTS // 2


def two_masses(seed):
    return random_pair(seed), np.random.default_rng([1312, seed])


def at_stops_that_give(seed):
    rng = np.random.default_rng([1314, seed])
    return on_springs(rng), rng


@pytest.mark.long(but=1)
@pytest.mark.parametrize(
    ("drawn", "seed"),
    [
        *((two_masses, seed) for seed in range(4, 8)),
        *((at_stops_that_give, seed) for seed in (range(200) if "FUZZ" in os.environ else (0, 5))),
    ],
)
def test_advice_makes_nothing_worse_for_systems_from_anywhere_and_all_that_is_said_agrees(drawn, seed):
    system, rng = drawn(seed)
    verdict = without_boundaries(system, str(rng.choice(list(system.values))))
    check_advice(verdict, rng)
    check_agreement(verdict)
    check_attractors(verdict)


@pytest.mark.long
@pytest.mark.parametrize(
    ("model", "parameter"), [(models.idle_gear, "omega"), (models.bilinear_oscillator, "spring_gap")]
)
def test_advice_on_a_machine_makes_nothing_worse_from_anywhere(model, parameter):
    verdict = without_boundaries(model(), parameter)
    assert verdict.advice
    check_advice(verdict, np.random.default_rng(1313))


@pytest.mark.long(but=1)
@pytest.mark.parametrize(
    ("osc", "parameters"),
    [
        (vi.ImpactOscillator(omega=2.6), None),
        (TUBE, None),
        (TUBE.replace(frequency=25.0), None),
        (
            vi.ImpactOscillator(
                mass=164.0, damping=2290.0, stiffness=3.62e7, amplitude=78.3, omega=1430.0, restitution=0.64
            ),
            None,
        ),
    ],
)
def test_advice_that_made_it_worse_from_other_initial_conditions_is_not_given(osc, parameters):
    verdict = vi.describe(osc, parameters=parameters)
    assert verdict.advice
    check_advice(verdict, np.random.default_rng(5))


@pytest.mark.long(but=1)
@pytest.mark.parametrize(
    ("model", "parameters"),
    [
        *((vi.ImpactOscillator(omega=omega), ["omega", "mass", "gap"]) for omega in (2.0, 1.4, 2.8, 0.1)),
        (random_pair(0), ["omega"]),
    ],
    ids=["one impact", "one impact, slower", "chaos", "sticking", "two masses"],
)
def test_advice_that_is_followed_does_what_it_says(model, parameters):
    verdict = vi.describe(model, parameters=parameters)
    now = hardest_hit(model)
    assert verdict.advice
    for advice in verdict.advice:
        changed = model.replace(**{advice.parameter: advice.value})
        then = hardest_hit(changed)
        assert then <= advice.max_velocity * (1.0 + 1e-6 if "chaotic" not in advice.motion else 1.02)
        if advice.benefit == "softer":
            assert then <= 0.801 * now
        elif advice.benefit == "no_chaos":
            assert vi.recognise(vi.impact_section(changed, transient_impacts=3000)).kind in ("periodic", "sticking")
        else:
            assert then == 0.0
    changes = [abs(advice.change) for advice in verdict.advice]
    assert changes == sorted(changes)


# The smallest change


def test_the_smallest_change_that_softens_the_hits_is_no_smaller_than_needed():
    """Period-1 impact-1 has a closed form: half the advised change of w must not soften the hits by a fifth."""
    osc = vi.ImpactOscillator(omega=2.0)
    (advice,) = vi.describe(osc, parameters=["omega"]).advice
    between = osc.replace(omega=2.0 + 0.95 * (advice.value - 2.0))
    assert hardest_hit(between) > 0.8 * hardest_hit(osc)


def test_the_smallest_change_is_found_in_a_window_narrower_than_the_steps():
    """At w = 2.6 a motion of three periods hits hardest; from 2.636 to 2.654 only the closed-form orbit is left."""
    advice = without_boundaries(vi.ImpactOscillator(omega=2.6), "omega").advice[0]
    (orbit,) = vi.find_orbit(vi.ImpactOscillator(omega=advice.value))
    assert advice.change == pytest.approx(0.014, rel=1e-9)
    assert advice.max_velocity == pytest.approx(max(orbit.velocities), rel=1e-9)


@pytest.mark.long
def test_impacts_are_not_said_to_end_before_the_fold_of_their_orbit():
    """In N, mm and t: swept up from gap 0 the motion hits until its fold at 0.672389 mm, which few starts show."""
    system = changed(STEEL, mass=1e-3, length=1e3)
    ends = [one for one in without_boundaries(system, "stop_1_gap").advice if one.benefit == "no_impact"]
    assert [0.672389 < one.value < 0.7 for one in ends] == [True]


def test_a_long_transient_is_not_the_motion_that_advice_promises():
    """Without loss every start stays irregular; with damping all initial conditions end clear of the stop."""
    osc = vi.ImpactOscillator(restitution=1.0, damping=0.0, amplitude=1.0, gap=0.5)
    (advice,) = without_boundaries(osc, "damping").advice
    changed = osc.replace(damping=advice.value)
    late = Runner(workers=1).measure(impacts(changed, np.random.default_rng(3), 64), ImpactWindow(35_000, 5000))
    assert (advice.benefit, advice.max_velocity) == ("no_impact", 0.0)
    assert {motion.name for motion in late} == {"no impact"}


def test_a_ball_is_told_where_its_hard_bounces_end():
    # Its one-impact orbits begin at a fold at amplitude w^2/g = pi (1 - r)/(1 + r); below rests follow from anywhere.
    ball = vi.family(models.bouncing_ball)
    (advice,) = vi.describe(ball, parameters=["restitution"]).advice
    driving = ball.values["amplitude"] * ball.at().omega ** 2 / 9.81
    fold = (math.pi - driving) / (math.pi + driving)
    assert advice.motion == "period-1 sticking"
    assert fold - 0.01 < advice.value < fold


def test_preload_and_wider_gaps_are_tried():
    """k |g| > f holds the tube at its stop at any speed; only what may be changed is varied."""
    for frequency in (15.0, 20.0, 25.0):
        verdict = vi.describe(TUBE.replace(frequency=frequency, gap=0.1e-3), parameters=["gap"])
        quiet = [advice for advice in verdict.advice if advice.benefit == "no_impact"]
        assert {advice.parameter for advice in verdict.advice} == {"gap"}
        assert quiet
        assert quiet[0].value < -TUBE.amplitude / TUBE.stiffness or quiet[0].value > 0.2e-3
    assert any(advice.value < 0.0 for advice in verdict.advice)


@pytest.mark.long(but=1)
@pytest.mark.parametrize(
    ("model", "force"),
    [
        (vi.ImpactOscillator(omega=2.1, damping=0.0005, restitution=0.99), "amplitude"),  # settles slowly
        (vi.ImpactOscillator(omega=2.8), "amplitude"),  # chaotic
        (vi.ImpactOscillator(omega=0.5), "amplitude"),  # sticks
        (vi.ImpactOscillator(damping=0.0044, omega=2.935, restitution=0.895), "amplitude"),
        (pushed, "force"),
        (pushed_pair, "force"),
    ],
    ids=["slow", "chaos", "sticking", "chaos again", "as a system", "two masses"],
)
def test_without_a_gap_all_hits_are_proportional_to_the_force(model, force):
    verdict = vi.describe(model, parameters=[force])
    (advice,) = verdict.advice
    assert advice.value == 0.8 * model.values[force]
    assert advice.max_velocity == pytest.approx(0.8 * verdict.worst.max_velocity, rel=1e-12)
    motions = vi.attractors(model.replace(**{force: advice.value}))
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


# What is softened, and where nothing is


def test_the_head_names_the_motion_that_hits_hardest_and_advice_aims_at_it():
    """From rest the tube does not hit at 25 Hz; from seven of eight initial conditions it does."""
    verdict = vi.describe(TUBE.replace(frequency=25.0), parameters=["gap", "omega"])
    assert verdict.motion.name == "no impact"
    assert verdict.worst.share == pytest.approx(0.88, abs=0.02)
    assert verdict.worst.max_velocity == pytest.approx(0.1054, rel=1e-3)
    head = text_of(verdict).partition("boundaries")[0]
    assert f"{100 * verdict.worst.share:.2g} % of the initial conditions: period-1 impact-1, 0.1054 m/s" in head
    assert {advice.before for advice in verdict.advice} == {verdict.worst.max_velocity}


@pytest.mark.usefixtures("modal_engine")
@pytest.mark.parametrize("kind", [lambda osc: osc, one_mass], ids=["one mass", "as a system"])
def test_where_nothing_hits_there_is_nothing_to_calm(kind):
    verdict = vi.describe(kind(vi.ImpactOscillator(gap=0.5)), parameters=["omega"])
    assert verdict.advice == ()
    assert "no impacts from rest" in text_of(verdict)


@pytest.mark.parametrize(
    ("model", "names"),
    [
        (vi.ImpactOscillator(omega=2.6), ["mass", "stiffness"]),
        (vi.ImpactOscillator(omega=2.6), ["restitution"]),
        (random_pair(10), ["omega", "right_gap"]),
    ],
    ids=["one mass", "a stop", "two masses"],
)
def test_where_nothing_helps_the_parameters_that_were_tried_are_named(model, names):
    verdict = vi.describe(model, parameters=names, within=1e-3)
    assert not verdict.advice
    assert f"no change of {' or '.join(names)} alone within its range" in text_of(verdict)


def test_advice_waits_for_motions_that_settle_slowly():
    """Perturbations halve in 70 periods: 3,000 impacts leave their motions undecided, which is no chaos."""
    design = vi.family(lambda force=15.0: cabinet(force, 0.04))
    (advice,) = vi.describe(design, parameters=["force"]).advice
    assert advice.benefit == "softer"
    assert advice.value > 8.0
    (settled,) = vi.attractors(cabinet(advice.value, 0.04))
    assert settled.max_velocity == pytest.approx(advice.max_velocity, rel=1e-3)
    assert settled.max_velocity <= 0.8 * vi.attractors(cabinet(15.0, 0.04))[0].max_velocity
