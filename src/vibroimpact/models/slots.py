"""Pairs of stops on both sides of a moving part: the ends of a slot, the flanks of a tooth."""

from __future__ import annotations

from typing import Any

from vibroimpact.model.stops import Stop


def slot(
    below: str,
    above: str,
    direction: Any,
    clearance: float,
    amplitude: float | None = None,
    restitutions: tuple[float | None, float | None] = (None, None),
    **contact: Any,
) -> list[Stop]:
    """Return the two ends of a slot along direction . q, each at half of the clearance at q = 0.

    They move together as amplitude sin wt, if an amplitude is given; `contact` holds their restitution, or their
    stiffness and damping; `restitutions` are those of the two ends if they differ.
    """
    return [
        Stop(
            direction=sign * direction,
            gap=0.5 * clearance,
            name=name,
            motion=None if amplitude is None else {1: sign * amplitude},
            **contact | ({} if own is None else {"restitution": own}),
        )
        for name, sign, own in zip((below, above), (-1.0, 1.0), restitutions, strict=True)
    ]
