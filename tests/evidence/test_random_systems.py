"""Random systems, with rigid stops or of any kind: the engine makes the impacts of the witness."""

import math
import os
from itertools import pairwise

import numpy as np
import pytest

import vibroimpact as vi
from systems import difference, drawn, impacts, linear, system
from witness import follow

SEEDS, BLOCK = (1000, 500) if "FUZZ" in os.environ else (100, 100), 25  # `make fuzz` asks for all


def until_rounding_decides(model, q, speed):
    """Return how many impacts are made before rounding decides which stop is struck next, and whether there are rests.

    Or None where a stop that moves squeezes a mass against another.
    """
    try:
        trajectory = follow(linear(model), q, speed, impacts=20, most_periods=30, cut=1e-9 * model.velocity_scale)
    except ValueError:
        return None, False
    pairs, apart = enumerate(pairwise(trajectory.impacts), start=1), 1e-9 * model.period
    sure = next((at for at, (a, b) in pairs if a.stop != b.stop and b.time - a.time < apart), len(trajectory.impacts))
    return sure, any(event.kind == "stick" for event in trajectory.events)


@pytest.mark.long(but=1)
@pytest.mark.parametrize("first", range(0, SEEDS[0], BLOCK))
def test_the_first_20_impacts_on_rigid_stops_are_those_of_the_witness(first):
    compared = squeezed = sticks = 0
    for seed in range(first, first + BLOCK):
        model, q, speed = drawn(np.random.default_rng([7, seed]))
        sure, rests = until_rounding_decides(model, q, speed)
        if sure is None:
            squeezed += 1
            continue
        number, wrong, what = difference(seed, model, q, speed, sure)
        assert wrong < 1e-11, (seed, what)
        compared, sticks = compared + number, sticks + rests
    assert compared > 12 * BLOCK
    assert squeezed <= 1
    assert sticks > 0.1 * BLOCK


@pytest.mark.long(but=1)
@pytest.mark.parametrize("first", range(0, SEEDS[1], BLOCK))
def test_the_first_20_impacts_on_stops_of_any_kind_are_those_of_the_witness(first):
    seeds = range(first, first + BLOCK)
    found = [difference(seed, *drawn(np.random.default_rng([17, seed]), of_any_kind=True)) for seed in seeds]
    compared, wrong, _ = zip(*found, strict=True)
    failed = {first + i: found[i] for i in np.flatnonzero(np.array(wrong) >= 1e-11)}
    assert failed.keys() <= {273}, failed
    assert max(wrong) < 2e-11  # that one makes 1e5 steps between springs that never let go, and errs by an ulp a step
    assert sum(compared) > 12 * BLOCK


@pytest.mark.long(but=1)
@pytest.mark.parametrize("first", range(0, 5 * SEEDS[0], BLOCK))
def test_the_first_20_impacts_on_6_to_20_stops_are_those_of_the_witness(first):
    """Rigid ones, or of any kind: none is missed, and none invented."""
    compared = 0
    for seed in range(first, first + BLOCK):
        rng = np.random.default_rng([37, seed])
        model, q, speed = drawn(rng, bool(seed % 2), int(rng.integers(6, 21)))
        sure, _ = until_rounding_decides(model, q, speed)
        if sure is None:
            continue
        number, wrong, what = difference(seed, model, q, speed, sure)
        assert wrong < 1e-10, (seed, what)
        compared += number
    assert compared > 12 * BLOCK


@pytest.mark.parametrize(("beads", "restitution"), [(4, 0.5), (7, 0.0), (9, 0.5)])
def test_a_column_of_beads_that_land_at_once_is_struck_as_the_witness_says(beads, restitution):
    """All its contacts are closed or struck together: over all their sets up to six, by pivoting beyond."""
    masses, at = np.linspace(1.0, 2.0, beads), np.full(beads, 0.5)
    directions = np.eye(beads, k=-1) - np.eye(beads)
    stops = [vi.Stop(direction=row, gap=0.0, restitution=restitution) for row in directions]
    load = {1: 0.3 * np.ones(beads)}
    model = system(
        np.diag(masses), 1e-3 * np.eye(beads), 1e-3 * np.eye(beads), 3.0, stops, load, constant=-9.81 * masses
    )
    known = follow(linear(model), at, 0.0 * at, impacts=12, most_periods=6, cut=1e-9 * model.velocity_scale).impacts
    hits = impacts(model, 12, start=vi.State(at.tolist(), [0.0] * beads))
    assert [model.stop_names[event.stop] for event in known[:12]] == hits["stop"].values.tolist()
    for name in ("time", "velocity", "impulse"):
        np.testing.assert_allclose(hits[name].values, [getattr(e, name) for e in known[:12]], rtol=1e-12)


@pytest.mark.parametrize("gap", [0.05, 1.0, 20.0])
@pytest.mark.parametrize("load", [50.0, 1e4])
@pytest.mark.parametrize("drag", [0.5, 2.0])
def test_a_stop_is_reached_by_what_a_constant_load_on_a_free_mass_drags_along(gap, load, drag):
    """The load's work has no bound: no energy at the beginning says that a stop cannot be reached."""
    stops = [vi.Stop(direction=[0.0, 1.0], gap=gap, restitution=0.6)]
    dashpot = drag * np.array([[1.0, -1.0], [-1.0, 1.0]])
    model = system(np.eye(2), dashpot, np.diag([0.0, 1.0]), 1.0, stops, {1: [1e-3, 0.0]}, constant=[load, 0.0])
    rest = np.zeros(2)
    seen = follow(linear(model), rest, rest, impacts=5, most_periods=20, cut=1e-9 * model.velocity_scale).impacts
    hits = impacts(model, len(seen[:5]), start=vi.State([0.0, 0.0], [0.0, 0.0]))
    np.testing.assert_allclose(hits["time"].values, [event.time for event in seen[:5]], rtol=1e-9)


def of_whole_numbers(rng):
    """Return a chain of small whole numbers and a speed: gaps of 0, r of 0 and 1, masses that nothing holds."""
    n = int(rng.integers(1, 4))
    stiffness = np.diag(rng.integers(0, 3, n)).astype(float)
    for i in range(n - 1):
        stiffness[i : i + 2, i : i + 2] += rng.integers(0, 3) * np.array([[1.0, -1.0], [-1.0, 1.0]])
    stops, known = [], set()
    for _ in range(rng.integers(1, 4)):
        direction = rng.integers(-1, 2, n)
        if direction.any() and tuple(direction) not in known:  # which of two at one place is struck, rounding decides
            known.add(tuple(direction))
            moves = {1: float(rng.integers(-1, 2))} if rng.random() < 0.3 else {}
            gap, ratio = float(rng.choice([0, 0, 1, 2])), float(rng.choice([0, 1, 0.5]))
            stops.append(vi.Stop(direction=direction, gap=gap, restitution=ratio, motion=moves))
    damping = rng.choice([0.0, 0.1, 1.0]) * np.diag(rng.integers(0, 2, n))
    mass, load, constant = np.diag(rng.integers(1, 4, n)), rng.integers(-2, 3, n), rng.integers(-1, 2, n)
    model = system(mass, damping, stiffness, rng.choice([1.0, 2.0, 0.5]), stops, {1: load}, constant=constant)
    return model, (rng.integers(-1, 2, n) * rng.integers(0, 2)).astype(float)


@pytest.mark.long
def test_systems_of_whole_numbers_make_the_impacts_of_the_witness():
    """Two motions stay together until rounding decides: a stop is just touched, or struck just after another."""
    compared = 0
    for seed in range(80):
        model, speed = of_whole_numbers(np.random.default_rng([23, seed]))
        start, cut = np.zeros(len(speed)), 1e-9 * model.velocity_scale
        try:
            seen = follow(linear(model), start, speed, impacts=12, most_periods=20, cut=cut).impacts[:12]
        except ValueError:  # a stop that moves squeezes a mass against another
            continue
        hits = impacts(model, 12, start=vi.State(start.tolist(), speed.tolist()))
        hard = 1e-6 * max([model.velocity_scale, *(event.velocity for event in seen)])
        touched = [event.time for event in seen if event.velocity < hard]
        touched += hits["time"].values[hits["velocity"].values < hard].tolist()
        after = [(b.time, b.time - a.time) for a, b in pairwise(seen) if a.stop != b.stop]
        touched += [time for time, since in after if 0.0 < since < 1e-3 * model.period]
        until = min([*touched, math.inf]) - 1e-6
        known = sorted((e.time, model.stop_names[e.stop], e.velocity) for e in seen if e.time < until)
        found = sorted(zip(*(hits[name].values.tolist() for name in ("time", "stop", "velocity")), strict=True))
        assert len(found) >= len(known), seed
        for one, other in zip(known, found, strict=False):
            assert one[1] == other[1], seed
            assert (one[0], one[2]) == pytest.approx((other[0], other[2]), rel=1e-7, abs=hard), seed
        compared += len(known)
    assert compared > 300
