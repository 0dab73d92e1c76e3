"""The memory of this machine: what cannot fit into it is refused before any of it is made."""

from __future__ import annotations

import os

CELL, INDEX = 250, 8  # bytes per cell of a map while it is computed, and per index beyond the first


def installed() -> int | None:
    """Return the bytes of memory that this machine has; None where that is unknown."""
    try:
        return int(os.sysconf("SC_PHYS_PAGES")) * int(os.sysconf("SC_PAGE_SIZE")) or None
    except (AttributeError, ValueError, OSError):  # no such call, no such name, no answer
        return None


def check_fits(name: str, what: str, needed: int, remedy: str) -> None:
    """Refuse what needs more bytes than the machine has."""
    here = installed()
    if here is not None and needed > here:
        raise ValueError(
            f"`{name}` {what} {in_words(needed)} of memory, but this machine has {in_words(here)}; {remedy}"
        )


def in_words(size: int) -> str:
    """Return a number of bytes in the unit that suits it.

    Examples
    --------
    >>> in_words(75 * 10**15), in_words(9_000_000)
    ('75 PB', '9 MB')
    """
    at, units = 0, ("bytes", "kB", "MB", "GB", "TB", "PB")
    while at < len(units) - 1 and size >= 1000 ** (at + 1):
        at += 1
    value = size / 1000**at
    return f"{value:.3g} {units[at]}" if value < 1000 else f"{value:.1e} {units[at]}"
