"""Systems followed over whole driving periods until they repeat, for what they swing.

The state after each period is compared with that after 0, 1, 3, 7, ... periods (R. P. Brent's search of cycles), and
the sums begin anew there: those of a cycle cover exactly one, and of a motion that does not repeat all are added up.
"""

from __future__ import annotations

import math

from vibroimpact.kernels.advance import LOOK
from vibroimpact.kernels.cell import FILLED, LAWLESS, RUNNING, SPENT
from vibroimpact.kernels.cycle import RETURNED, UNREPEATED
from vibroimpact.kernels.leaps import TURN
from vibroimpact.kernels.shared.machine import compiled, inner
from vibroimpact.kernels.shared.vectors import LANES, anywhere, get
from vibroimpact.kernels.systems.event import go_on
from vibroimpact.kernels.systems.lanes import seat, unusual
from vibroimpact.kernels.systems.layout import NOTHING, SWING
from vibroimpact.kernels.systems.march import GRANTED, IMPACTS, PERIODS, REFERENCE
from vibroimpact.kernels.systems.swing import LARGEST, LEAST, LEFT


@inner
def _begin(lanes, lane, k):
    """Begin the sums and the search for a return at the present state."""
    for row in range(SWING):
        lanes[(k.swing + row) * LANES + lane] = 0.0
    for z in range(k.stops):
        lanes[(k.strength + z) * LANES + lane] = 0.0
    lanes[(k.swing + LEAST) * LANES + lane], lanes[(k.swing + LARGEST) * LANES + lane] = math.inf, -math.inf
    lanes[(k.swing + LEFT) * LANES + lane] = TURN / lanes[k.theta * LANES + lane]
    for j in range(2 * k.modes):
        lanes[(k.reference + j) * LANES + lane] = lanes[(k.eta + j) * LANES + lane]


@inner
def _returned(lanes, lane, k):
    """Return whether the state is again that at which the sums began; a free centre counts if y moves with it."""
    away = 0.0
    for j in range(2 * k.modes):
        felt = lanes[(k.along + j % k.modes) * LANES + lane] != 0.0
        if felt or not (k.free and lanes[(k.neutral + j) * LANES + lane] > 0.0):
            away += abs(lanes[(k.eta + j) * LANES + lane] - lanes[(k.reference + j) * LANES + lane])
    return away < RETURNED * lanes[k.speed * LANES + lane]


@inner
def _keep(lanes, lane, k, result, all_of_it):
    """Add the sums to a result, or let them take its place."""
    for row in range(SWING + k.stops):
        value = lanes[(k.swing + row) * LANES + lane]
        if not all_of_it:
            result[row] = value
        elif row == LEAST:
            result[row] = min(result[row], value)
        elif row == LARGEST:
            result[row] = max(result[row], value)
        else:
            result[row] += value


@inner
def _turn(lanes, lane, notes, k, result):
    """End a driving period; return whether all is known."""
    since, total = IMPACTS * LANES + lane, PERIODS * LANES + lane
    notes[since] += 1.0
    notes[total] += 1.0
    returned, over = _returned(lanes, lane, k), notes[total] >= UNREPEATED
    if returned or over or notes[since] >= notes[REFERENCE * LANES + lane]:
        _keep(lanes, lane, k, result, not returned)
    if returned or over:
        return True
    lanes[(k.swing + LEFT) * LANES + lane] = TURN / lanes[k.theta * LANES + lane]
    if notes[since] >= notes[REFERENCE * LANES + lane]:
        notes[REFERENCE * LANES + lane] *= 2.0
        notes[since] = 0.0
        _begin(lanes, lane, k)
    return False


@compiled("swings of systems", 2)
def run_swings(
    table, budgets, results, ends, tickets, lanes, owner, notes, cells, note, k, room, window, looks
):  # fmt: skip
    """Step lanes until so many looks are made or no cell is left; return how many lanes are busy."""
    busy = 0
    for look in range(looks * LOOK):
        busy = 0
        for lane in range(LANES):
            if owner[lane] == -1:
                owner[lane] = seat(table, budgets, tickets, lanes, lane, notes, cells[lane], note, k, room, window)
                if owner[lane] >= 0:
                    notes[REFERENCE * LANES + lane] = 1.0
                    results[owner[lane], LEAST], results[owner[lane], LARGEST] = math.inf, -math.inf
                    _begin(lanes, lane, k)
                else:
                    lanes[(k.swing + LEFT) * LANES + lane] = math.inf
            busy += owner[lane] >= 0
        if busy == 0:
            break
        go_on(lanes, notes, k, window)
        if anywhere(get(lanes, k.hit, 0) > NOTHING):
            for lane in range(LANES):
                if lanes[k.hit * LANES + lane] != NOTHING and owner[lane] >= 0:
                    unusual(lanes, lane, notes, cells[lane], note, k, room, window)
        due = look % LOOK == 0
        if not (due or anywhere(get(lanes, k.swing + LEFT, 0) <= 0.0)):
            continue
        for lane in range(LANES):
            if owner[lane] < 0:
                continue
            end = RUNNING
            if lanes[k.lawless * LANES + lane] > 0.0:
                end = LAWLESS
            elif lanes[(k.swing + LEFT) * LANES + lane] <= 0.0:
                end = FILLED if _turn(lanes, lane, notes, k, results[owner[lane]]) else RUNNING
            elif lanes[k.steps * LANES + lane] > notes[GRANTED * LANES + lane]:
                end = SPENT
            if end != RUNNING:
                ends[owner[lane]] = end
                owner[lane] = -1
    return busy
