"""What happens to the stops in a cycle: they are struck or touched, let go, and push again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

IMPACT, LET_GO, PUSH_AGAIN, GRAZE = "impact", "let_go", "push_again", "graze"

Pushing = tuple[int, ...]  # the stops that push, ascending


class Event(NamedTuple):
    """An event of one stop.

    An impact is where its clearance falls to zero: a rigid stop is struck, contact with a compliant one begins. That
    one lets go where its force has fallen to zero; while it is still pressed in, it may push again. A graze is an
    impact of velocity 0 on it.
    """

    stop: int
    kind: str = IMPACT

    def then(self, pushing: Pushing, compliant: Sequence[bool]) -> Pushing:
        """Return which stops push after the event, of those that pushed before."""
        if not compliant[self.stop] or self.kind == GRAZE:
            return pushing
        others = {stop for stop in pushing if stop != self.stop}
        return tuple(sorted(others if self.kind == LET_GO else {*others, self.stop}))

    def in_mirror(self, images: Sequence[int]) -> Event:
        """Return the event of the stop that this one becomes in the mirror."""
        return self._replace(stop=images[self.stop])


def impacts_on(stops: Sequence[int]) -> tuple[Event, ...]:
    """Return the events of impacts on rigid stops."""
    return tuple(map(Event, stops))
