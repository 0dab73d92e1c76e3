"""Boundaries of a motion along its parameters, and changes of these, in words."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from vibroimpact import report
from vibroimpact.model import Model
from vibroimpact.orbits.orbit import value_of
from vibroimpact.parameters import hertz
from vibroimpact.verdict.advice import Advice
from vibroimpact.verdict.carried import LONG
from vibroimpact.verdict.edges import ONSETS, Edge, Onset
from vibroimpact.verdict.ranges import PLACES, percent, present_value

if TYPE_CHECKING:
    from vibroimpact.verdict.describe import Verdict

FINE = 1e-8  # relative: no machine is set so exactly
EXACT = 17  # digits that tell any two numbers apart
MANY_GAPS = 10.0  # a change so many times the gap is given relative to f/k alone


def boundary_lines(verdict: Verdict) -> Iterator[str]:
    """Yield where the motion ends down and up each parameter, and for which initial conditions that holds."""
    edges, carried = verdict.boundaries, verdict.oscillator.forgets
    if edges and verdict.orbit is None and not carried:
        yield "not sought: only those of periodic motions with impacts that never rest at a stop are followed"
        return
    for down, up in zip(edges[::2], edges[1::2], strict=True):
        not_sought = down.not_sought or up.not_sought
        to_report = any(edge.found or edge.spacing or onset_texts(edge) for edge in (down, up))
        if to_report or (not_sought and not carried):
            yield f"{down.parameter}: {edge_text(verdict.model, down)}; {edge_text(verdict.model, up)}"
        elif not_sought:
            yield f"{down.parameter}: not sought, as the motion is not decided"
        else:
            yield f"{down.parameter}: none from {down.searched_to:.4g} to {up.searched_to:.4g}"
    yield from _about(verdict)


def _about(verdict: Verdict) -> Iterator[str]:
    """Yield for which initial conditions boundaries hold, and what was sampled."""
    edges = verdict.boundaries
    if verdict.kind in ("no_impact", "stuck_forever") and any(edge.from_some for edge in edges):
        hitting = sum(motion.share for motion in verdict.attractors if motion.max_velocity > 0.0)
        if any(edge.from_some and edge.from_some.change == 0.0 and not edge.at_once for edge in edges):
            share = percent(hitting) if hitting else "some"
            yield f"here already {share} of the initial conditions settle to impacts"
        else:
            yield (
                f"up to there, at {PLACES} values per side, neither rest nor the other initial conditions tried lead "
                f"to {LONG.transient + LONG.keep} impacts: windows between these values may lie nearer"
            )
    elif any(edge.found for edge in edges) and verdict.oscillator.forgets:
        yield "these hold for the motion from rest, carried along in small steps"
    elif any(edge.found for edge in edges):
        yield (
            "these solve the equations of the orbit from rest, to some 1e-11; two of one kind that lie nearer to each "
            "other than the steps along it, 2 to 8 % of a range, may both be missed"
        )
    if any(edge.spacing for edge in edges):
        yield "steps are those between the values tried: narrower windows of other motions may lie nearer"
    if any(edge.found and not edge.at_once and abs(edge.change) < FINE for edge in edges):
        yield f"changes of less than {percent(FINE)} lead to other motions: expect those around it in a machine"


def edge_text(model: Model, edge: Edge) -> str:
    """Return a boundary in words, such as 'up 3.1 % to 2.693 rad/s (period doubling; period-2 impact-2 at 2.695)'.

    For a motion without impacts others come first, where they differ: from where on some initial condition settles to
    impacts, and the motion from rest strikes the stop or settles to impacts.
    """
    way = "down" if edge.direction < 0 else "up"
    beyond = _beyond(model, edge) if edge.beyond and edge.kind != "change" else ""
    if edge.at_once:
        return f"{way} at once ({edge.what}{beyond})"
    if edge.not_sought:
        return f"{way} not followed to its end"
    parts = [_place(model, edge, onset, [what]) for onset, what in onset_texts(edge)]
    steps = f"in steps of {percent(edge.spacing)}{f' of {edge.of}' if edge.of else ''}" if edge.spacing else ""
    if edge.found:
        parts.append(_place(model, edge, edge, [edge.what + beyond, "" if edge.exact else edge.accuracy, steps]))
    else:
        motion = "of the motion itself " if parts else ""
        parts.append(f"{motion}none to {edge.searched_to:.4g}{f' ({steps})' if steps else ''}")
    return f"{way} {', '.join(parts)}"


def _beyond(model: Model, edge: Edge) -> str:
    """Return the motion beyond an edge, and where it was computed."""
    if math.isnan(edge.beyond_at):
        return f"; {edge.beyond} beyond"
    return f"; {edge.beyond} at {report.quantity(edge.beyond_at, model.parameters[edge.parameter].unit, 6)}"


def onset_texts(edge: Edge) -> list[tuple[Onset, str]]:
    """Return the sentences on where other motions begin to hit, the nearest first, and on what happens there."""
    values = {name: onset.value for name in ONSETS if (onset := getattr(edge, name))}
    if values.get("strikes") == values.get("from_rest"):
        values.pop("strikes", None)
    if values.get("from_some") == values.get("from_rest"):
        values.pop("from_some", None)
    onsets = [(getattr(edge, name), ONSETS[name]) for name, value in values.items() if value != edge.value]
    return sorted((pair for pair in onsets if pair[0].change), key=lambda pair: abs(pair[0].change))


def _place(model: Model, edge: Edge, at: Edge | Onset, about: list[str]) -> str:
    """Return a value on the way along a parameter, and what is known of it."""
    present, digits = value_of(model, edge.parameter), 6 if at.half_width == 0.0 else 5
    while digits < EXACT and f"{at.value:.{digits}g}" == f"{present:.{digits}g}" and at.value != present:
        digits += 1
    place = quantity(model, edge.parameter, at.value, digits)
    return f"{change_text(model, edge.parameter, at.value)} to {place} ({'; '.join(filter(None, about))})"


def change_text(model: Model, parameter: str, value: float) -> str:
    """Return the size of a change, of the gap also relative to the gap itself: '3.1 %', or '14 % (4.1 % of f/k)'."""
    present = present_value(model, parameter)
    size = present.percent(value)
    if present.of != "f/k" or not present.value:
        return size
    share = abs(value / present.value - 1.0)
    return f"{percent(share)} ({size})" if share < MANY_GAPS else size


def advice_text(model: Model, advice: Advice) -> str:
    """Return a piece of advice in words."""
    change = change_text(model, advice.parameter, advice.value)
    verb = "raise" if advice.change > 0.0 else "lower"
    head = f"{verb} {advice.parameter} by {change} to {quantity(model, advice.parameter, advice.value, 6)}: "
    if advice.benefit == "no_impact":
        return f"{head}{advice.motion}"
    softer = 100.0 * (1.0 - advice.max_velocity / advice.before)
    size = f"{abs(softer):.2g} % {'softer' if softer > 0.0 else 'harder'}"
    no_chaos = ", no longer chaotic" if advice.benefit == "no_chaos" else ""
    hits = f"hardest hit {advice.max_velocity:.4g} instead of {speed(advice.before)} ({size})"
    return f"{head}{advice.motion}{no_chaos}, {hits}"


# Numbers with their units


def parameters_line(model: Model) -> str:
    """Return the parameters of a model in a line."""
    return ", ".join(f"{name} {quantity(model, name, value, 6)}" for name, value in model.values.items())


def quantity(model: Model, name: str, value: float, digits: int) -> str:
    """Return a value of a parameter with its unit; an angular frequency also in Hz."""
    unit = model.parameters[name].unit
    text = report.quantity(value, unit, digits)
    return f"{text} ({hertz(value):.{digits}g} Hz)" if unit == "rad/s" else text


def speed(velocity: float) -> str:
    """Return an impact velocity with its unit."""
    return report.quantity(velocity, "m/s", 4)


def number(value: float, digits: int) -> str:
    """Return a number of so many digits, without a power of ten below a million."""
    return f"{float(f'{value:.{digits}g}'):g}"
