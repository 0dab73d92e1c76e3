"""How a motion ended: codes, their sentences, and the rule for the code of a cell."""

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
        """What happened and, if there is one, the remedy."""
        return _SENTENCES[self]

    @property
    def has_indices(self) -> bool:
        """Whether the window of impacts was filled, so that indices have values."""
        return self <= Status.SHORT_WINDOW


_SENTENCES = {
    Status.OK: "all requested impacts were sampled",
    Status.CLOSED: "the cycle repeats, so the remaining impacts were added exactly",
    Status.STICKING: "the mass came to rest at the stop within the sample (complete chatter or stick)",
    Status.SHORT_WINDOW: "the sampled impacts span fewer than 10 driving periods; raise `sample_impacts`",
    Status.NO_IMPACT: "the mass never reaches the stop from these initial conditions",
    Status.STOPPED_IMPACTING: "impacts cease after a transient; the motion settles clear of the stop",
    Status.STUCK_FOREVER: "permanently in contact: the mass stays at the stop, and the force never releases it",
    Status.DECAYING: "unforced impacts decay forever; give an `amplitude` or sample fewer impacts",
    Status.BUDGET: "stopped at the step limit while undecided; raise `flight_periods` or `steps_per_impact`",
    Status.INTERRUPTED: "the sweep was stopped before this cell was finished; run it again",
    Status.INVALID_RESTITUTION: "a law of restitution gave a value outside 0 to 1 at the speed of an impact; limit it",
}


def window_status(*, sampled: int, wanted: int, stuck: bool, periods: float, ended: Status) -> Status:
    """Return the status of a cell: its ending, or else the content of its window.

    It is `ended` if the window was not filled. A filled window that spans fewer than 10 periods is `short_window`;
    otherwise it is `sticking` if the mass stuck in it, else `ok`.
    """
    if sampled < wanted:
        return ended
    if periods < 10.0:
        return Status.SHORT_WINDOW
    return Status.STICKING if stuck else ended if ended == Status.CLOSED else Status.OK
