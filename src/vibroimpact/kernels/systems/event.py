"""A step of cells and what ends it, summed up: of lanes, or of one cell alone with the same bits."""

from __future__ import annotations

from vibroimpact.kernels.shared.deferred import deferred
from vibroimpact.kernels.shared.held import without
from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.vectors import LANES, anywhere, get, put, select
from vibroimpact.kernels.systems.elements import CLOSED
from vibroimpact.kernels.systems.law import bounce, closed
from vibroimpact.kernels.systems.layout import CONTACT, NOTHING
from vibroimpact.kernels.systems.leap import LEAPS, leap, leap_far, leap_within, look, may_leap
from vibroimpact.kernels.systems.march import (
    CHATTERED,
    HITS,
    NEXT,
    NUMBER,
    RETURNED,
    STICKS,
    WATCHED,
    WHICH,
    add,
    add_all,
    conclude,
    happen,
    note_drain,
    note_misses,
    note_open,
    note_rests,
)
from vibroimpact.kernels.systems.push import meet
from vibroimpact.kernels.systems.reach import look_around
from vibroimpact.kernels.systems.step import step
from vibroimpact.kernels.systems.tangent import before, cross_one, has_lost_all, measure_growth, pass_over, recur

ALIKE = 2e-12  # of V: how near the speed of an impact must come back to be looked at
FIRST_LOOK = 32.0  # impacts until one is watched for


@inner
def lift(lanes, lane, cell, number):
    """Copy so many numbers of a lane into a cell."""
    for row in range(number):
        cell[row] = lanes[row * LANES + lane]


@inner
def lower(lanes, lane, cell, number):
    """Copy so many numbers of a cell into a lane."""
    for row in range(number):
        lanes[row * LANES + lane] = cell[row]


@inner
def lower_alike(lanes, cell, number):
    """Copy so many numbers of a cell into all lanes: none of them then does what the cell does not."""
    for row in range(number):
        put(lanes, row, 0, cell[row])


@deferred("impacts beside the usual", 3, by_kind=True)
def _occur(rows, k, room, note, window):
    """Make what ended the step of one cell, and sum it up."""
    shut = closed(rows, k)
    if k.thorough:
        before(rows, k, room)
    struck, closing = happen(rows, k, room)
    z = int(rows[k.which])
    if k.thorough:
        pass_over(rows, k, room, struck, closing)
        if struck or has_lost_all(rows, k):  # growth counts from the first impact of the window on
            measure_growth(rows, note, k, None, note[HITS] < window.total, note[HITS] > window.transient)
    recorded = add_all(rows, k, room, note, struck, window)
    if window.closes and recorded:
        _watch(note, rows, k, None, note[HITS] > 0.0, rows[k.which], room.speed[z])
    if k.thorough:
        note_rests(rows, k, room, note, shut, closing, recorded and note[HITS] <= window.total)
        if struck:
            note_misses(rows, note, k, None, True, window)
        if recorded:
            recur(rows, note, k, None, note[HITS] <= window.total, window.total)
    if k.thorough and closing:
        for y in range(k.stops):
            note[CHATTERED] += closing >> y & 1 and room.tail[y] > 0.0
    if k.compliant or k.forceful:
        for y in range(k.stops):
            if rows[k.kind + y] < CLOSED:
                conclude(note, rows, k, None, rows[k.kind + y] < CLOSED, y, window)
    note[STICKS] += rows[k.closed] > 0.0 and window.transient < note[HITS] < window.total


# The code of what is not observed is not compiled, and neither is that of compliant stops where there are none.
rigid = without("compliant")
_unobserved = without("wary", "draining", "swinging")
_plain = without("thorough", "wary", "forceful", "draining", "swinging")


@inner(forceinline=True)
def _is_plain(k):
    return not (k.thorough or k.wary or k.forceful or k.draining or k.swinging)


@deferred("steps of systems", 4, by_kind=True)
def _walk_on(rows, k, wide):
    """Make leaps as far as they are certified, half a one before and after whole ones, and a step."""
    if not k.wary:  # near-misses are those of all stops
        look_around(rows, k, wide)
    willing = leapt = may_leap(rows, k, wide)
    if anywhere(willing):
        look(rows, k, wide)
    number = 0
    while number < LEAPS + 2 and anywhere(willing):
        willing = leap(rows, k, wide, 0 < number <= LEAPS, willing)
        if number == 0:
            leapt = willing
            if k.far:
                leap_far(rows, k, wide, willing)
        number += 1
        if number > LEAPS or not anywhere(willing):
            number, willing = max(number, LEAPS + 1), leapt
    if k.compliant and k.modes == 1 and not k.swinging:
        leap_within(rows, k, wide)
    step(rows, k, wide)


@inner
def walk_on(rows, k, wide):
    """Make leaps and a step, by the part that observes what is needed; a deviation is carried along."""
    if k.compliant:
        if k.wary or k.draining or k.swinging:
            _walk_on(rows, k, wide)
        else:
            _walk_on(rows, _unobserved(k), wide)
    elif k.wary or k.draining or k.swinging:
        _walk_on(rows, rigid(k), wide)
    else:
        _walk_on(rows, rigid(_unobserved(k)), wide)


@deferred("impacts of systems", 2, by_kind=True)
def _add_usual(lanes, notes, k, window):
    """Make the usual impacts and contacts that ended steps; they are then no hits any more."""
    struck, v, impulse, r = bounce(lanes, k, 0)
    if anywhere(struck):
        energy = 0.5 * (1.0 - r) * v * impulse
        if k.thorough:
            cross_one(lanes, k, 0, struck, v, impulse)
            hits = get(notes, HITS, 0)
            measure_growth(lanes, notes, k, 0, struck & (hits < window.total), hits > window.transient)
        _add(notes, lanes, k, struck, v, energy, impulse, window)
        if k.thorough:
            kept = struck & (get(notes, HITS, 0) <= window.total)
            note_open(notes, k, 0, kept)
            note_misses(lanes, notes, k, 0, struck, window)
            recur(lanes, notes, k, 0, kept, window.total)
        put(lanes, k.hit, 0, select(struck, NOTHING, get(lanes, k.hit, 0)))
    if k.thorough:
        return  # contacts with compliant stops are made on the cell alone
    hit, which = get(lanes, k.hit, 0), get(lanes, k.which, 0)
    if not (k.compliant and anywhere(hit == CONTACT)):
        return
    begins, ends, v = meet(lanes, k, 0, hit == CONTACT)
    for y in range(k.stops if anywhere(ends) else 0):
        conclude(notes, lanes, k, 0, ends & (which == float(y)), y, window)
    if anywhere(begins):
        _add(notes, lanes, k, begins, v, 0.0 * v, 0.0 * v, window)
    put(lanes, k.hit, 0, select(begins | ends, NOTHING, hit))


@inner
def go_on(lanes, notes, k, window):
    """Make leaps and a step of all lanes and the usual impacts that end it, all summed up."""
    walk_on(lanes, k, 0)
    if not anywhere(get(lanes, k.hit, 0) == CONTACT):
        return
    if k.compliant:
        if _is_plain(k):
            _add_usual(lanes, notes, _plain(k), window)
        else:
            _add_usual(lanes, notes, k, window)
    elif _is_plain(k):
        _add_usual(lanes, notes, rigid(_plain(k)), window)
    else:
        _add_usual(lanes, notes, rigid(k), window)


@inner
def occur(rows, k, room, note, window):
    """Make what ended the step of one cell, and sum it up."""
    if _is_plain(k):
        _occur(rows, _plain(k), room, note, window)
    else:
        _occur(rows, k, room, note, window)


@inner(forceinline=True)
def _add(notes, lanes, k, hit, v, energy, impulse, window):
    """Sum up recorded impacts of all lanes."""
    if k.draining:
        note_drain(notes, lanes, k, 0, hit, get(notes, HITS, 0), window)
    z = get(lanes, k.which, 0)
    sine, cosine, periods = get(lanes, k.turn, 0), get(lanes, k.turn + 1, 0), get(lanes, k.turn + 2, 0)
    add(notes, k, 0, hit, z, v, energy, impulse, sine, cosine, periods, window)
    if window.closes:
        _watch(notes, lanes, k, 0, hit, z, v)


@inner(forceinline=True)
def _watch(notes, rows, k, wide, hit, z, v):
    """Compare an impact with the one that is watched for; it is replaced every 32 impacts, later more rarely."""
    hits, near = get(notes, HITS, wide), ALIKE * get(rows, k.speed, wide)
    speed, number = get(notes, WATCHED, wide), get(notes, NUMBER, wide)
    back = hit & (abs(v - speed) < near) & (get(notes, WHICH, wide) == z)
    returned = get(notes, RETURNED, wide)
    put(notes, RETURNED, wide, select(back & (returned == 0.0), hits - number, returned))
    later = get(notes, NEXT, wide)
    moves, stride = hit & (hits >= later), 0.125 * hits
    put(notes, WATCHED, wide, select(moves, v, speed))
    put(notes, WHICH, wide, select(moves, z, get(notes, WHICH, wide)))
    put(notes, NUMBER, wide, select(moves, hits, number))
    put(notes, NEXT, wide, select(moves, hits + select(stride > FIRST_LOOK, stride, FIRST_LOOK), later))
