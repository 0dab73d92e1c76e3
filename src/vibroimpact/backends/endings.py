"""Why the kernels ended a cell, in the words of the API."""

from __future__ import annotations

from vibroimpact.kernels.cell import DYING, PINNED, QUIET, SPENT
from vibroimpact.status import Status


def ended_as(end: int, impacts: float | bool) -> Status:
    """Return the status of a cell that ended so; `impacts` tells whether it had any."""
    if end in (QUIET, DYING) and not impacts:
        return Status.NO_IMPACT
    return {
        QUIET: Status.STOPPED_IMPACTING,
        PINNED: Status.STUCK_FOREVER,
        DYING: Status.DECAYING,
        SPENT: Status.BUDGET,
    }.get(end, Status.OK)
