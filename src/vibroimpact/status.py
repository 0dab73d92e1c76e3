"""How a motion ended: codes, their sentences, and which one a cell gets."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """Outcome of one cell or orbit; the numbers are stored in files and never change."""

    OK = 0
    CLOSED = 1
    STICKING = 2
    SHORT_WINDOW = 3
    NO_IMPACT = 4
    STOPPED_IMPACTING = 5
    STUCK_FOREVER = 6
    DECAYING = 7
    BUDGET = 8
    INTERRUPTED = 9
    INVALID_RESTITUTION = 10

    @property
    def word(self) -> str:
        """The name in datasets and on the command line."""
        return self.name.lower()

    @property
    def sentence(self) -> str:
        """What happened and, where there is one, the remedy."""
        return _SENTENCES[self]

    @property
    def has_indices(self) -> bool:
        """Whether the window of impacts was filled, so that indices have values."""
        return self <= Status.SHORT_WINDOW


_SENTENCES = {
    Status.OK: "all requested impacts were sampled",
    Status.CLOSED: "the motion closed a periodic cycle; its indices were completed in closed form",
    Status.STICKING: "the mass came to rest at the stop within the sample (complete chatter or stick)",
    Status.SHORT_WINDOW: "the sampled impacts span fewer than 10 driving periods; raise `sample_impacts`",
    Status.NO_IMPACT: "the mass never reaches the stop from these initial conditions",
    Status.STOPPED_IMPACTING: "impacts cease after a transient; the motion settles clear of the stop",
    Status.STUCK_FOREVER: "permanently in contact: the mass stays at the stop, and the force never releases it",
    Status.DECAYING: "unforced impacts decay for ever; give an `amplitude` or sample fewer impacts",
    Status.BUDGET: "a flight or the whole motion exceeded its budget; raise `flight_periods` or `steps_per_impact`",
    Status.INTERRUPTED: "the sweep was stopped before this cell was finished; run it again",
    Status.INVALID_RESTITUTION: "a law of restitution gave no number from 0 to 1 at the speed of an impact; limit it",
}


def window_status(*, sampled: int, wanted: int, stuck: bool, periods: float, ended: Status) -> Status:
    """Return the one status of a cell: what ended it, else what its window says.

    It is `ended` if the window was not filled. A filled window that spans fewer than 10 periods is `short_window`;
    else one in which the mass stuck is `sticking`; else `ok`.
    """
    if sampled < wanted:
        return ended
    if periods < 10.0:
        return Status.SHORT_WINDOW
    return Status.STICKING if stuck else ended if ended == Status.CLOSED else Status.OK
