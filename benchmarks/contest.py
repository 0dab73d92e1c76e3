"""Every contender on the same oscillators: what an impact costs, and whether it is right."""

from __future__ import annotations

from statistics import median
from typing import Any

from benchmarks.effort import Effort
from benchmarks.event_solver import EventSolver
from benchmarks.measure import interleaved, ratio
from benchmarks.ours import contenders as ours
from benchmarks.problem import CASES, Contender, accuracy, verdict
from benchmarks.taylor import Taylor
from benchmarks.taylor_batch import TaylorBatch


def contenders() -> list[Contender]:
    theirs: list[Contender] = [Taylor(False), Taylor(True), TaylorBatch(False), TaylorBatch(True), EventSolver()]
    return [*ours(), *theirs]


def hold(effort: Effort) -> list[dict[str, Any]]:
    """Return a row a contender; all ratios refer to the first one in the same round."""
    field = contenders()
    rows: list[dict[str, Any]] = [{"name": one.name, "note": one.note, "cost": {}} for one in field]
    for one, row in zip(field, rows, strict=True):
        if not one.note:
            row |= accuracy(one, effort) | verdict(one.low_frequency())
    for case in CASES:
        jobs = {one.name: job for one in field if not one.note and (job := one.job(case, effort))}
        cost = interleaved(jobs, effort.rounds)
        first = cost[field[0].name]
        for row in rows:
            if found := cost.get(row["name"]):
                row["cost"][case] = {"ns": median(found), "ratio": ratio(found, first)}
    return rows
