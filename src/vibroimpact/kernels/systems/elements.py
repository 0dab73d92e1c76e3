"""The kinds of stops: which of them give, by what law they push, and what begins and ends a contact with them.

A rigid stop is left by an impulse, or held closed (`law`, `rest`); it has zeros in the columns here. One that gives
pushes while a mass is in it, by d = -u > 0, with the linear force

    F = k d + c d'.

A contact begins where u falls through zero, and goes on while e = p d + q d' is above zero. Here e is the force, since
no stop pulls, and q > 0 if there is a damper: the stop then lets go before it is free, and would push again if -e fell
to zero while u < 0. Where q = 0, e is zero where u is.

All other files ask here. A kind of stop with a linear force is a column and its cases in these functions.
"""

from __future__ import annotations

from vibroimpact.kernels.machine import inner
from vibroimpact.kernels.systems.series import slipped
from vibroimpact.kernels.vectors import get

# The numbers of a stop in the table of a cell: k, c, and what these add to the fastest rate, squared, and to damping.
COLUMNS = "spring", "dashpot", "hard", "thick"


@inner(forceinline=True)
def gives(rows, z, k, wide):
    """Return whether contacts with a stop take time."""
    return get(rows, k.spring + z, wide) > 0.0


@inner(forceinline=True)
def force_law(rows, z, k, wide):
    """Return k and c of the force of a stop that is pushed in."""
    return get(rows, k.spring + z, wide), get(rows, k.dashpot + z, wide)


@inner(forceinline=True)
def end_law(rows, z, k, wide):
    """Return p and q of e, whose fall to zero ends a contact."""
    return force_law(rows, z, k, wide)


@inner(forceinline=True)
def parts_abruptly(rows, z, k):
    """Return whether the force of a stop jumps where its contact ends: not where e is in proportion to it."""
    (stiffness, damping), (p, q) = force_law(rows, z, k, None), end_law(rows, z, k, None)
    return stiffness * q != damping * p


@inner(forceinline=True)
def quickens(rows, z, k, wide):
    """Return what a stop that pushes adds to the fastest rate, squared, and to the damping, over those of flight."""
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
