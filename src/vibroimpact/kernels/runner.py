"""Run many cells in lockstep lanes; a lane that ends takes the next cell."""

from __future__ import annotations

import math
from typing import NamedTuple

from vibroimpact.kernels import lanes as lane
from vibroimpact.kernels.advance import IMPACT, LOOK, RELEASE, STUCK, walk
from vibroimpact.kernels.cell import FILLED, QUIET_FOR, RUNNING, SPENT, budgets, cell_of, ending, phase_of, prepare
from vibroimpact.kernels.closing import close
from vibroimpact.kernels.cycle import RETURNED, UNREPEATED, forget
from vibroimpact.kernels.flight import NONE
from vibroimpact.kernels.leaps import doubled
from vibroimpact.kernels.observers import DEVIATION, Deviation, Misses, Recurrence, Swings, swings
from vibroimpact.kernels.recorder import END, overhear, room
from vibroimpact.kernels.results import (
    ADDED,
    FLIGHT,
    GRANTED,
    RATIO,
    RELEASES,
    SCALE,
    STEPS,
    TURN,
    H,
    harvest,
    harvest_thoroughly,
)
from vibroimpact.kernels.shared.machine import compiled, copy, inner, next_ticket, whole
from vibroimpact.kernels.shared.vectors import LANES as BLOCK
from vibroimpact.kernels.shared.vectors import anywhere, most, put_at, select
from vibroimpact.kernels.state import Flow, accessors

# Of the squares of rates: closer to resonance, or with a softer spring, the closed forms lose more than four digits.
RESONANT, SOFT = 5e-3, 1e-4
NEAR = 2e-11  # of V: how close an impact must come back to be looked at


@inner
def begin(lanes, i, note, cell, total, chatter, flight_periods, steps_per_impact):
    """Put a cell at its start into lane i, and begin its note."""
    h, motion, constants = prepare(cell, chatter)
    scale = constants.cut / chatter
    for row in range(lane.ROWS):
        lanes[row * lane.LANES + i] = 0.0
    lane.store_motion(lanes, i, motion)
    lane.store_constants(lanes, i, constants)
    lane.store_recurrence(lanes, i, Recurrence(-math.inf, 0.0, 32.0, NEAR * scale, 0.0))  # no reference yet
    lane.store_deviation(lanes, i, Deviation(DEVIATION[0], DEVIATION[1], 0.0))
    lane.store_misses(lanes, i, Misses(NONE))
    longest, granted = budgets(cell, flight_periods, steps_per_impact, total)
    note[H], note[SCALE], note[FLIGHT], note[GRANTED] = h, scale, longest, granted
    note[STEPS], note[RATIO], note[ADDED], note[RELEASES], note[TURN] = 0.0, 0.0, 0.0, 0.0, -1.0


@inner
def move(lanes, owner, notes, facts, i, j):
    """Move the cell in lane i to lane j, which is free."""
    for row in range(lane.ROWS):
        lanes[row * lane.LANES + j] = lanes[row * lane.LANES + i]
    copy(notes[i], notes[j])
    if facts is not None:
        copy(facts[i], facts[j])
    owner[j], owner[i] = owner[i], -1


@inner
def seated(cells, tickets, lanes, owner, notes, facts, total, chatter, flight_periods, steps_per_impact):
    """Give every free lane the next cell, while there is one; return how many lanes are busy, which come first."""
    busy = 0
    for i in range(len(owner)):
        if owner[i] < 0:
            following = next_ticket(tickets)
            if following < len(cells):
                cell = cell_of(cells[following])
                begin(lanes, i, notes[i], cell, total, chatter, flight_periods, steps_per_impact)
                owner[i] = following
                if facts is not None:
                    forget(facts[i])
        if owner[i] >= 0:
            if busy < i:  # no cells wait any more: those that are left close ranks
                move(lanes, owner, notes, facts, i, busy)
            busy += 1
    return busy


@inner(forceinline=True)
def may_end(lanes, i, note, total):
    """Return whether lane i may end here: a look at few of its numbers, before all that `ending_of` asks."""
    motion, k, age = lane.load_motion(lanes, i), lane.load_constants(lanes, i), lane.load_rests(lanes, i).age
    spent = (lane.load_sums(lanes, i).hits >= total) | (note[STEPS] > note[GRANTED])
    return spent | (motion.p == 0.0) | (k.A == 0.0) | (age > min(QUIET_FOR, note[FLIGHT]))


@inner
def ending_of(lanes, i, note, total):
    """Return the reason why the cell in lane i ends here, or RUNNING."""
    if lane.load_sums(lanes, i).hits >= total:
        return FILLED
    age = lane.load_rests(lanes, i).age
    return ending(
        lane.load_motion(lanes, i), lane.load_constants(lanes, i), age, note[FLIGHT], note[STEPS], note[GRANTED]
    )


@inner(forceinline=True)
def may_close(lanes, i, note, total, facts):
    """Return whether lane i has been released anew, or may have closed another cycle.

    Thorough lanes need every cycle that does not stick: `facts` is None in others.
    """
    count, releases = lane.load_sums(lanes, i).hits, lane.load_rests(lanes, i).releases
    recurs = (note[RATIO] == 0.0) & (releases < 2.0) & (lane.load_recurrence(lanes, i).candidate > 0.0)
    return (releases > note[RELEASES]) | (recurs & ((count < total) | (facts is not None)))


@compiled("maps", 7)
def run_cells(
    cells, results, finals, ends, tickets, seat, finished, transient, total, chatter, flight_periods, steps_per_impact,
    early_closing, looks, facts,
):  # fmt: skip
    """Step the lanes of one thread until it has looked at them `looks` times, or no cell is left.

    `cells`, `results` and `ends` (why each cell ended) are shared by threads, each of which takes the next cell by
    ticket into its own `seat`: lanes, their owners, notes, room for a cycle and for a trace. `finished` receives the
    cells that ended, `finals` their motion and constants unless it is empty. `facts` is None, or room for what thorough
    lanes learn of cycles. Return how many cells ended, and how many lanes are busy. Nothing in a cell depends on its
    lane, its neighbours or its thread.
    """
    lanes, owner, notes, cycle, trace = seat
    number = 0
    for _ in range(looks):
        busy = seated(cells, tickets, lanes, owner, notes, facts, total, chatter, flight_periods, steps_per_impact)
        if busy == 0 or number + len(owner) > len(finished):
            return number, busy
        if facts is None:
            lane.step_lanes(lanes, busy, LOOK, transient, total)
        else:
            lane.step_thorough_lanes(lanes, busy, LOOK, transient, total)
        for i in range(busy):
            notes[i, STEPS] += LOOK
            closes = may_close(lanes, i, notes[i], total, facts)
            if not (closes | may_end(lanes, i, notes[i], total)):
                continue
            j = owner[i]
            if closes:
                facts_of_cell = None if facts is None else facts[i]
                close(lanes, i, notes[i], transient, total, early_closing, cycle, facts_of_cell, trace, None)
            ends[j] = ending_of(lanes, i, notes[i], total)
            if ends[j] != RUNNING:
                keep = total - transient
                harvest(lanes, i, notes[i], keep, results[j])
                if facts is not None:
                    harvest_thoroughly(lanes, i, notes[i], facts[i], cell_of(cells[j]), keep, results[j], trace)
                finished[number] = j
                number += 1
                owner[i] = -1
                for row in range(finals.shape[1]):
                    finals[j, row] = lanes[row * lane.LANES + i]
    return number, busy


@compiled("motions with their indices", 7)
def follow_cell(
    cells, results, ends, seat, transient, total, chatter, flight_periods, steps_per_impact, early_closing, looks,
    facts, recorder,
):  # fmt: skip
    """Measure the only cell as `run_cells` does, while its recorder reads every step.

    Return after `looks` at it, when it ends, or when a buffer of the recorder is to be emptied; what either has still
    to see, it then sees alone.
    """
    lanes, owner, notes, cycle, trace = seat
    note, cell = notes[0], cell_of(cells[0])
    facts_of_cell = None if facts is None else facts[0]
    if owner[0] < 0:
        begin(lanes, 0, note, cell, total, chatter, flight_periods, steps_per_impact)
        owner[0] = 0
    k = lane.load_constants(lanes, 0)
    for _ in range(looks):
        if ends[0] != RUNNING or (room(recorder) <= LOOK and recorder.memory[END] == RUNNING):
            return
        steps = 0
        while steps < LOOK:
            start = lane.load_motion(lanes, 0)
            rows = walk(start, k, trace, LOOK - steps, 0.0)
            overhear(recorder, start, trace, rows)
            for row in range(rows):
                lane.observe_walked(lanes, 0, k, trace, row, transient, total, facts)
            steps += rows
        note[STEPS] += LOOK
        if may_close(lanes, 0, note, total, facts_of_cell):
            close(lanes, 0, note, transient, total, early_closing, cycle, facts_of_cell, trace, recorder)
        ends[0] = ending_of(lanes, 0, note, total)
        if ends[0] != RUNNING:
            harvest(lanes, 0, note, total - transient, results[0])
            if facts is not None:
                harvest_thoroughly(lanes, 0, note, facts[0], cell, total - transient, results[0], trace)


class Begun(NamedTuple):
    """The contact from which swings are added up: rate, phase and period; how many have followed, and how many may.

    `first` is the period of the first one of all.
    """

    p: float
    s: float
    c: float
    n: float
    since: float
    most: float
    first: float


(load_swings, store_swings), (load_begun, store_begun), (load_two, store_two), SWINGING = accessors(
    lane.CELL, lane.LANES, Swings, Begun, Flow
)


@inner(forceinline=True)
def _returned(motion, begun, k):
    """Return whether a contact is that at which the sums began."""
    late = (motion.s * begun.c - motion.c * begun.s) / k.th
    apart = abs(motion.p - begun.p) + (abs(motion.p) + k.A + abs(k.G)) * abs(late)
    return (apart < RETURNED * most(k.A, abs(k.G)) / math.sqrt(k.K)) & (motion.s * begun.s + motion.c * begun.c > 0.0)


@inner(forceinline=True)
def _swing(lanes, i, wide):
    """Take lanes on; return whether there is something to do where a contact came back, or enough of them passed."""
    before, sums = lane.load_motion(lanes, i, wide), load_swings(lanes, i, wide)
    k, motion, event, v, x, _ = lane.take_on(lanes, i, wide)
    store_swings(lanes, i, swings(sums, before, motion, k, load_two(lanes, i, wide), event, v, x), wide)
    old, hit = load_begun(lanes, i, wide), (event == IMPACT) | (event == RELEASE)
    begun = Begun(old.p, old.s, old.c, old.n, old.since + select(hit, 1.0, 0.0), old.most, old.first)
    store_begun(lanes, i, begun, wide)
    passed = motion.n - begun.first
    due = (begun.since >= begun.most) | (passed >= UNREPEATED) | _returned(motion, begun, k)
    due = (hit & due) | (passed > 2.0 * UNREPEATED) | (event == STUCK)
    put_at(lanes, SWINGING * lane.LANES + i, wide, select(due, 1.0, 0.0))
    return anywhere(due)


@inner
def _keep(lanes, i, result, returned):
    """Add the sums since a contact to a result, or let them take its place: a return takes whole periods."""
    k, motion, begun, sums = (
        lane.load_constants(lanes, i), lane.load_motion(lanes, i), load_begun(lanes, i), load_swings(lanes, i)
    )  # fmt: skip
    length, gap = sums.flown, k.G / k.K
    if sums.rests > 0.0:
        periods = motion.n - begun.n + phase_of(motion.s, motion.c) - phase_of(begun.s, begun.c)
        length = (whole(periods) if returned else periods) * 2.0 * math.pi / k.th
    rest = length - sums.flown
    sums = length, sums.mean + gap * rest, sums.square + gap * gap * rest, sums.sine, sums.cosine
    for j in range(len(sums)):
        result[j] = sums[j] + (0.0 if returned else result[j])
    lowest = gap - load_swings(lanes, i).deepest
    result[len(sums)] = lowest if returned else min(lowest, result[len(sums)])
    result[len(sums) + 1] = gap


@inner
def _begin(lanes, i, most, first):
    """Begin the sums at a contact, which takes the place of the one before; with `most` 0 on the way to the first."""
    motion, deepest = lane.load_motion(lanes, i), 0.0 if most > 0.0 else math.inf
    store_swings(lanes, i, Swings(0.0, 0.0, 0.0, 0.0, 0.0, deepest, 0.0))
    store_begun(lanes, i, Begun(motion.p, motion.s, motion.c, motion.n, 0.0, most, first))


@inner
def _turn(lanes, i, result):
    """Return the reason why a cell ends at a contact, or RUNNING: the sums then begin anew."""
    motion, begun, k = lane.load_motion(lanes, i), load_begun(lanes, i), lane.load_constants(lanes, i)
    stuck = motion.u == 0.0 and motion.p == 0.0 and k.G <= -k.A
    if stuck or motion.n - begun.first > 2.0 * UNREPEATED:  # without an impact to come
        return SPENT
    first = motion.n
    if begun.most > 0.0:
        returned, over = _returned(motion, begun, k), motion.n - begun.first >= UNREPEATED
        _keep(lanes, i, result, returned)
        if returned or over:
            return FILLED
        first = begun.first
    _begin(lanes, i, max(2.0 * begun.most, 1.0), first)
    return RUNNING


@inner
def _seat(finals, wanted, ends, tickets, lanes, i):
    """Put the next wanted cell into a lane; return its number among them, or -2 if there is none."""
    while True:
        cell = next_ticket(tickets)
        if cell >= len(wanted):
            return -2
        for row in range(lane.CELL):
            lanes[row * lane.LANES + i] = finals[wanted[cell], row]
        k, motion = lane.load_constants(lanes, i), lane.load_motion(lanes, i)
        store_two(lanes, i, doubled(k.short.flow))
        if math.hypot(k.K - k.Q, k.C * k.th) > RESONANT and k.K > SOFT:
            _begin(lanes, i, 1.0 if motion.u == 0.0 else 0.0, motion.n)
            return cell
        ends[cell] = SPENT


@compiled("swings of one mass", 7)
def run_swings(finals, wanted, results, ends, tickets, lanes, owner, looks):
    """Follow the wanted cells from their final motions until they return or UNREPEATED periods have passed.

    Return how many lanes are busy.
    """
    busy = 0
    for _ in range(looks):
        busy = 0
        for i in range(BLOCK):
            if owner[i] == -1:
                owner[i] = _seat(finals, wanted, ends, tickets, lanes, i)
            busy += owner[i] >= 0
        if busy == 0:
            break
        if _swing(lanes, 0, 0):
            for i in range(BLOCK):
                if owner[i] >= 0 and lanes[SWINGING * lane.LANES + i] > 0.0:
                    end = _turn(lanes, i, results[owner[i]])
                    if end != RUNNING:
                        ends[owner[i]] = end
                        owner[i] = -1
    return busy
