"""The one vocabulary of motions.

Whatever names a motion - maps, sections, attractors, verdicts, diagrams, the explorer - decides its kind with `decide`
and names it with `motion_name`.
"""

from vibroimpact.motion.kinds import (
    CERTAIN_GROWTH,
    Motion,
    MotionClass,
    cycle_name,
    decide,
    motion_name,
    refined,
    stored,
)
from vibroimpact.motion.recognition import cycle_length, recognise, recurrence

__all__ = [
    "CERTAIN_GROWTH",
    "Motion",
    "MotionClass",
    "cycle_length",
    "cycle_name",
    "decide",
    "motion_name",
    "recognise",
    "recurrence",
    "refined",
    "stored",
]
