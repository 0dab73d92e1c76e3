"""Events of the stops in a cycle: impact, end of the force ("let go"), renewed force ("push again"); near-misses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

IMPACT, LET_GO, PUSH_AGAIN, GRAZE = "impact", "let_go", "push_again", "graze"

Pushing = tuple[int, ...]  # the stops that push, ascending


class Event(NamedTuple):
    """An event of one stop.

    At an impact the clearance falls to zero: a rigid stop is struck, or contact with a compliant stop begins. A
    compliant stop lets go when its force has fallen to zero; while it is still pressed in, it may push again. A graze
    is an impact of velocity 0 on a compliant stop.
    """

    stop: int
    kind: str = IMPACT

    def in_mirror(self, images: Sequence[int]) -> Event:
        """Return the mirror image of the event, on the stop's image."""
        return self._replace(stop=images[self.stop])


class Nearest(NamedTuple):
    """Closest approach of an orbit to a stop between impacts: flight, turns, clearance relative to its size, stop."""

    flight: int
    turns: float
    margin: float
    stop: int = 0
    beside: float = math.inf  # least relative clearance, at an impact, of a stop that is not struck
