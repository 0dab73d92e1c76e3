"""Boundaries of a motion along the parameters, and changes of parameters, in words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import zip_longest
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from vibroimpact.coexistence.losses import attracts
from vibroimpact.model import Model
from vibroimpact.model.units import few_values, quantity, shown_as, shown_value
from vibroimpact.orbits.orbit import value_of
from vibroimpact.parameters import hertz, labelled
from vibroimpact.showing import Table
from vibroimpact.verdict.advice import Advice
from vibroimpact.verdict.carried import LONG
from vibroimpact.verdict.edges import ONSETS, Edge, Onset
from vibroimpact.verdict.hits import speed
from vibroimpact.verdict.ranges import PLACES, percent, present_value

if TYPE_CHECKING:
    from vibroimpact.verdict.describe import Verdict

FINE = 1e-8  # relative: no machine is set so exactly
EXACT = 17  # digits that tell any two numbers apart
HEAD = ("parameter", "down to", "what happens", "up to", "what happens")
OWN_UNITS: Mapping[str, str] = MappingProxyType({})  # of the parameters themselves
MANY_GAPS = 10.0  # a change so many times the gap is given relative to f/k alone


def _free(verdict: Verdict) -> bool:
    """Return whether a motion from rest without impacts, or without loss at them, is one of free vibration."""
    design = verdict.oscillator
    loaded = any(np.any(load) for load in design.system.force.vectors.values()) if design.forgets else True
    return not (loaded or design.damping) and (verdict.kind == "no_impact" or not attracts(design))


def boundary_facts(verdict: Verdict) -> Iterator[str | Table]:
    """Yield the values below and above each parameter at which the motion ends, and for which initial conditions."""
    edges, carried = verdict.boundaries, verdict.oscillator.forgets
    if edges and verdict.orbit is None and not carried:
        yield "not sought: only those of periodic motions with impacts that never rest at a stop are followed"
        return
    if edges and _free(verdict):
        yield "not sought: without load and damping, energies are kept between impacts, and no motion attracts others"
        return
    if edges:
        ends = zip(edges[::2], edges[1::2], strict=True)
        yield Table("", HEAD, [row for down, up in ends for row in _rows(verdict, down, up)])
    yield from _about(verdict)


def _rows(verdict: Verdict, down: Edge, up: Edge) -> Iterator[tuple[str, ...]]:
    """Yield the rows of a parameter: values below and above side by side, the nearest onset or boundary first."""
    name = axis_name(verdict.model, down.parameter, verdict.units)
    for below, above in zip_longest(ends_of(verdict, down), ends_of(verdict, up), fillvalue=("", "")):
        yield name, *below, *above
        name = ""


def axis_name(model: Model, name: str, units: Mapping[str, str]) -> str:
    """Return the name of a parameter with the unit in which it is shown."""
    parameter, unit = shown_as(model, name, units)
    return labelled(parameter.name, unit)


def _about(verdict: Verdict) -> Iterator[str]:
    """Yield the initial conditions for which boundaries hold, and the sampling."""
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


def ends_of(verdict: Verdict, edge: Edge) -> Iterator[tuple[str, str]]:
    """Yield the values along a parameter at which something happens, each with a description.

    For a motion without impacts, the values beyond which other motions hit come first if they differ: some initial
    condition settles to impacts, or the motion from rest strikes the stop or settles to impacts.
    """
    if edge.at_once:
        yield "at once", _event(verdict, edge)
        return
    if edge.not_sought:
        undecided = verdict.oscillator.forgets
        yield "-", "not sought, as the motion is not decided" if undecided else "not followed to its end"
        return
    onsets = onset_texts(edge)
    for onset, what in onsets:
        yield _place(verdict, edge, onset), what
    steps = f"in steps of {percent(edge.spacing)}{f' of {edge.of}' if edge.of else ''}" if edge.spacing else ""
    if edge.found:
        yield _place(verdict, edge, edge), "\n".join(filter(None, (_event(verdict, edge), steps)))
    else:
        what = "this motion persists" if onsets else "no boundary"
        yield _value(verdict, edge, edge.searched_to, 4), "\n".join(filter(None, (what, steps)))


def _event(verdict: Verdict, edge: Edge) -> str:
    """Return a boundary in words, and the motion beyond with the value at which it was computed."""
    if not edge.beyond or edge.kind == "change":
        return edge.what
    if math.isnan(at := edge.beyond_at):
        return f"{edge.what};\n{edge.beyond} beyond"
    return f"{edge.what};\n{edge.beyond} at {_value(verdict, edge, at, _digits(verdict, edge, at, 6))}"


def onset_texts(edge: Edge) -> list[tuple[Onset, str]]:
    """Return the onsets of impacts of other motions, the nearest first, each with a description."""
    values = {name: onset.value for name in ONSETS if (onset := getattr(edge, name))}
    if values.get("strikes") == values.get("from_rest"):
        values.pop("strikes", None)
    if values.get("from_some") == values.get("from_rest"):
        values.pop("from_some", None)
    onsets = [(getattr(edge, name), ONSETS[name]) for name, value in values.items() if value != edge.value]
    return sorted((pair for pair in onsets if pair[0].change), key=lambda pair: abs(pair[0].change))


def _place(verdict: Verdict, edge: Edge, at: Edge | Onset) -> str:
    """Return a value of a parameter, its accuracy, and the change to it."""
    digits = _digits(verdict, edge, at.value, 6 if at.half_width == 0.0 else 5)
    lines = [_value(verdict, edge, at.value, digits)]
    if at is edge and at.half_width:
        lines[0] += f" \u00b1 {_value(verdict, edge, at.half_width, 1)}"
    if shown_as(verdict.model, edge.parameter, verdict.units)[1] == "rad/s":
        lines.append(f"{hertz(at.value):.{digits}g} Hz")
    sign = "-" if edge.direction < 0 else "+"
    changes = (sign + change for change in change_texts(verdict.model, edge.parameter, at.value))
    return "\n".join([*lines, *changes])


def _digits(verdict: Verdict, edge: Edge, value: float, digits: int) -> int:
    """Return the number of digits, at least `digits`, that distinguish a value from the present one."""
    present = value_of(verdict.model, edge.parameter)
    differs = value != present
    while differs and digits < EXACT and _value(verdict, edge, value, digits) == _value(verdict, edge, present, digits):
        digits += 1
    return digits


def _value(verdict: Verdict, edge: Edge, value: float, digits: int) -> str:
    return f"{shown_value(verdict.model, edge.parameter, value, verdict.units):.{digits}g}"


def change_texts(model: Model, parameter: str, value: float) -> list[str]:
    """Return the size of a change; for a gap, also relative to the gap itself: 3.1 %, or 14 % and 4.1 % of f/k."""
    present = present_value(model, parameter)
    size = present.percent(value)
    if present.of != "f/k" or not present.value:
        return [size]
    share = abs(value / present.value - 1.0)
    return [percent(share), size] if share < MANY_GAPS else [size]


def advice_text(model: Model, advice: Advice, units: Mapping[str, str] = OWN_UNITS) -> str:
    """Return a piece of advice in words."""
    change, *of = change_texts(model, advice.parameter, advice.value)
    verb = "raise" if advice.change > 0.0 else "lower"
    head = f"{verb} {shown_as(model, advice.parameter, units)[0].name} by {change}{f' ({of[0]})' if of else ''}"
    head += f" to {with_hertz(model, advice.parameter, advice.value, units)}: "
    if advice.benefit == "no_impact":
        return f"{head}{advice.motion}"
    softer = 100.0 * (1.0 - advice.max_velocity / advice.before)
    size = f"{abs(softer):.2g} % {'softer' if softer > 0.0 else 'harder'}"
    no_chaos = ", no longer chaotic" if advice.benefit == "no_chaos" else ""
    hits = f"hardest hit {advice.max_velocity:.4g} instead of {speed(advice.before)} ({size})"
    return f"{head}{advice.motion}{no_chaos}, {hits}"


# Numbers with their units


def parameters_line(verdict: Verdict) -> str:
    """Return the parameters of a design in a line."""
    model, units = verdict.model, verdict.units
    values, others = few_values(model)
    texts = [
        f"{shown_as(model, name, units)[0].name} {with_hertz(model, name, values[name], units)}" for name in values
    ]
    return ", ".join([*texts, *others])


def with_hertz(model: Model, name: str, value: float, units: Mapping[str, str]) -> str:
    """Return a value of a parameter with its unit; an angular frequency also in Hz."""
    text = quantity(model, name, value, 6, units)
    return f"{text} ({hertz(value):.6g} Hz)" if shown_as(model, name, units)[1] == "rad/s" else text


def number(value: float, digits: int) -> str:
    """Return a number with the given number of digits, without a power of ten below a million."""
    return f"{float(f'{value:.{digits}g}'):g}"
