"""Maps, classes, verdicts, attractors and orbits of one model say the same of it."""

import os

import numpy as np
import pytest

import vibroimpact as vi
from contents import named
from designs import random_oscillator
from systems import a_random_machine
from vibroimpact.coexistence.striking import alike
from vibroimpact.motion import MotionClass
from vibroimpact.orbits import same_orbit

SLOW = 7, 9  # a minute or two each
SEEDS = range(200) if "FUZZ" in os.environ else sorted({*range(12)} - {*SLOW})  # `make fuzz` asks for all
INDICES = ("lyapunov", "lyapunov_per_impact", "n_periods", "n_impacts")
WINDOW = 5100  # impacts that a map makes
NEAR = 1e-5  # of cycles found by iteration and by Newton's method
SETTLES = 0.98  # multipliers beyond settle too slowly for a sample to show it


def check_the_map(model, verdict):
    """A motion that both decide has one name, and an exponent that agrees to 1 % of its decay.

    A verdict watches for longer than a map: what it is certain of only then may look chaotic there.
    """
    sweep = vi.parameter_map(model, omega=[model.omega], indices=INDICES)
    kind, name = named(sweep)
    kinds = kind.stored, verdict.motion.motion_class.stored
    decided = MotionClass.UNDECIDED not in kinds and verdict.watched <= WINDOW
    if decided and verdict.motion.motion_class.hits:
        assert name == verdict.motion.name
    elif decided:
        assert kinds[0] == kinds[1]
    if verdict.orbit is not None and kind == MotionClass.PERIODIC:
        exponent = verdict.orbit.lyapunov
        assert float(sweep["lyapunov"][0]) == pytest.approx(exponent, rel=0.01), name


def check_the_orbits(model, found):
    """Every cycle that is reached is an orbit that `find_orbit` knows, and every stable one-contact orbit is told."""
    cycles = [one for one in found if one.kind == MotionClass.PERIODIC.word]
    for one in cycles:
        assert one.orbit is not None, one.name
        assert one.orbit.stable
        assert one.orbit.admissible
        if one.n_impacts == 1:
            orbits = vi.find_orbit(model, n_periods=one.n_periods)
            assert any(same_orbit(orbit, one.orbit, tolerance=NEAR) for orbit in orbits), (one.name, orbits.message)
    for orbit in (orbit for n in (1, 2) for orbit in vi.find_orbit(model, n_periods=n)):
        if orbit.stable and orbit.admissible and orbit.spectral_radius < SETTLES:
            assert any(same_orbit(orbit, one.orbit, tolerance=NEAR) for one in cycles), (orbit.name, orbit.velocities)


def check_the_starts(model, found):
    """A state on an attractor leads to it; one on a motion that was watched for long may lead to another in the end."""
    for one in found:
        (again,) = vi.attractors(model, [one.start], workers=1)
        if one.kind == MotionClass.CHAOTIC.word and again.kind != one.kind:
            assert any(alike(again, other) for other in found if other is not one), again.name
            continue
        assert again.kind == one.kind, one.name
        assert one.kind != MotionClass.PERIODIC.word or alike(again, one), one.name


@pytest.mark.long
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("make", [a_random_machine, random_oscillator])
def test_all_that_is_said_of_a_random_model_agrees(make, seed):
    model = make(np.random.default_rng([38, seed]))
    verdict, motions = vi.describe(model, parameters=[], workers=1), vi.attractors(model, workers=1)
    assert {(one.start, one.share) for one in motions} <= {(one.start, one.share) for one in verdict.attractors}
    check_the_map(model, verdict)
    check_the_orbits(model, motions)
    check_the_starts(model, motions)
