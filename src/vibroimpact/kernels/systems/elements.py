"""The kinds of stops: which of them are compliant, by what law these push, and what begins and ends a contact.

A rigid stop acts by impulses, or is held closed (`law`, `rest`); its columns here are zero. Contacts with a compliant
stop take time. While it is pushed in by d = -u > 0 its force is linear,

    F = k d + c d'.

A contact begins where u falls through zero, and lasts while e = p d + q d' is above zero. Here e is the force, since
no stop pulls, and q > 0 if there is a damper: the stop then lets go before it is free, and pushes again if -e falls to
zero while u < 0. Where q = 0, e and u are zero at the same time.

All other files ask these functions. Another kind of stop with a linear force is one more column and one more case.
"""

from __future__ import annotations

from vibroimpact.kernels.shared.machine import inner
from vibroimpact.kernels.shared.series import slipped
from vibroimpact.kernels.shared.vectors import get

# How a stop is left: its clearance begins with no zero, a single one (just struck), a double one (from rest) or a
# triple one (let go); or it is closed, held by a force above zero or by one that begins there. Where a zero has a
# higher order, -x or PASSING + x stands for open or closed on a step up to x in any case.
OPEN, STRUCK, RESTING, RELEASED, CLOSED, BALANCED, PASSING = 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0

# The numbers of a stop in the table of a cell: k, c, and what these add to the fastest rate, squared, and to damping.
COLUMNS = "spring", "dashpot", "hard", "thick"


@inner(forceinline=True)
def is_compliant(rows, z, k, wide):
    """Return whether contacts with a stop take time."""
    return get(rows, k.spring + z, wide) > 0.0


@inner(forceinline=True)
def pushes(rows, z, k, wide):
    """Return whether a compliant stop is pushed in, and pushes."""
    return is_compliant(rows, z, k, wide) & (get(rows, k.kind + z, wide) >= CLOSED)


@inner(forceinline=True)
def force_law(rows, z, k, wide):
    """Return k and c of the force of a stop that is pushed in."""
    return get(rows, k.spring + z, wide), get(rows, k.dashpot + z, wide)


# p and q of e, whose fall to zero ends a contact.
end_law = force_law


@inner(forceinline=True)
def parts_abruptly(rows, z, k):
    """Return whether the force of a stop jumps where its contact ends: it does not if e is in proportion to it."""
    (stiffness, damping), (p, q) = force_law(rows, z, k, None), end_law(rows, z, k, None)
    return stiffness * q != damping * p


@inner(forceinline=True)
def quickens(rows, z, k, wide):
    """Return the additions of a pushing stop to the fastest rate, squared, and to the damping, over those of flight."""
    return get(rows, k.hard + z, wide), get(rows, k.thick + z, wide)


@inner(forceinline=True)
def while_pushing(rows, z, clearance, force, pace, k, wide):
    """Return the series of e over a step of that pace in which a stop pushes, from those of u and of the force."""
    return force


@inner(forceinline=True)
def while_away(rows, z, clearance, pace, k, wide):
    """Return the series of -e: a stop that let go stays away while it is above zero, whatever u does."""
    p, q = end_law(rows, z, k, wide)
    return slipped(clearance, pace * pace * p, pace * q)
