"""Colours of categories in maps: motions, numbers of periods and impacts per cycle, reasons for missing values."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterator, Mapping
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from vibroimpact.motion import MotionClass, cycle_name
from vibroimpact.motion.classes import NEEDED, classify
from vibroimpact.parameters import counted
from vibroimpact.plotting import labels, style
from vibroimpact.plotting.style import INK, STICKING, Layer, Mask
from vibroimpact.status import Status

COUNTS = ("n_periods", "n_impacts")  # numbers of a cycle, which have no order of better and worse
OPEN = "#ffffff"  # colour of all other cells; its legend patch has an edge
NO_VALUE = "#ead9b0"

# Fixed colours of the usual names, so that maps can be compared: impact-1 motions from blue to green.
USUAL = {
    (1, 1): "#0072b2",
    (2, 1): "#56b4e9",
    (3, 1): "#009e73",
    (4, 1): "#8edfa7",
    (5, 1): "#cc79a7",
    (1, 2): "#d55e00",
}
NUMBERS = dict(enumerate(USUAL.values(), start=1))
SPARE = ("#7a2e12", "#7a3dd8")
PALETTE = (*USUAL.values(), *SPARE)
OTHER_PERIODIC = "#c79a5b"
MOST_NAMES = len(PALETTE)  # most names with their own colour
LEAST_SHARE = 0.005  # of the cells: smallest share of a name with its own colour

COLORS = {
    MotionClass.STICKING: STICKING,
    MotionClass.CHAOTIC: INK,
    MotionClass.QUASI_PERIODIC: "#662266",
    MotionClass.NO_IMPACT: "#c9c9c9",
    MotionClass.UNDECIDED: OPEN,
}

Name = TypeVar("Name", bound=Hashable)


def name_colors(counts: Counter[Name], cells: int, usual: Mapping[Any, str] = USUAL) -> dict[Name, str]:
    """Return the colours of the most frequent names (n_periods, n_impacts) in `cells`, the most frequent first."""
    ranked = [name for name, count in counts.most_common(MOST_NAMES) if count >= LEAST_SHARE * cells]
    spare = iter([*SPARE, *(color for name, color in usual.items() if name not in ranked)])
    return {name: usual.get(name) or next(spare) for name in ranked}


def motion_layers(codes: Any, n_periods: Any, n_impacts: Any) -> Iterator[Layer]:
    """Yield, for each legend entry of motions, the mask of its cells (possibly none), its colour and its name."""
    rest = codes == MotionClass.PERIODIC
    counts = Counter(zip(n_periods[rest].tolist(), n_impacts[rest].tolist(), strict=True))
    for name, color in name_colors(counts, codes.size).items():
        mask = (codes == MotionClass.PERIODIC) & (n_periods == name[0]) & (n_impacts == name[1])
        rest = rest & ~mask
        yield mask, color, cycle_name(*name)
    yield rest, OTHER_PERIODIC, "other periodic"
    yield from ((codes == kind, color, kind.label) for kind, color in COLORS.items())


def number_layers(sweep: xr.Dataset, field: xr.DataArray) -> Iterator[Layer]:
    """Yield the layer of each number of periods or impacts in a cycle, then of each reason for a missing number."""
    values = field.values
    counts = Counter(values[values > 0].tolist())
    colors = name_colors(counts, values.size, NUMBERS)
    for number in sorted(colors):
        yield values == number, colors[number], f"{number}"
    if further := sorted(set(counts) - set(colors)):
        text = f"{further[0]} to {further[-1]}, others" if len(further) > 1 else f"{further[0]}"
        yield np.isin(values, further), OTHER_PERIODIC, text
    yield from missing_layers(sweep, field, "")


def missing_layers(sweep: xr.Dataset, field: xr.DataArray, noun: str) -> Iterator[Layer]:
    """Yield, for each reason why an index has no value, the mask of the cells affected, its colour and its name.

    The name includes the number of cells, counted as `noun`, if that is given.
    """
    values, codes = field.values, sweep["status"].transpose(*field.dims).values
    gone = values <= 0 if field.name in COUNTS else ~np.isfinite(values)
    ended = codes > Status.SHORT_WINDOW
    yield from style.by_status(gone & ended, codes, noun, style.origin(sweep))
    for reason, color, text in _reasons(sweep, field, values):
        if count := int((mask := gone & ~ended & reason).sum()):
            yield mask, color, text + (f" ({counted(count, noun)})" if noun else "")


def _reasons(sweep: xr.Dataset, field: xr.DataArray, values: Any) -> Iterator[tuple[Mask, str, str]]:
    """Yield the reasons why a persistent motion has no value of an index, with their colours."""
    if field.name not in COUNTS:
        sticks = np.isneginf(values)
        yield sticks, STICKING, rf"sticking: {labels.symbol_of(field)} = $-\infty$"
        yield ~sticks, NO_VALUE, _without(field)
        return
    kinds = _classes(sweep, field)
    sticks = (values < 0) | (kinds == MotionClass.STICKING)
    yield sticks, STICKING, "complete chatter" if field.name == "n_impacts" else "intermittent sticking"
    for kind in (MotionClass.CHAOTIC, MotionClass.QUASI_PERIODIC, MotionClass.UNDECIDED):
        yield ~sticks & (kinds == kind), COLORS[kind], kind.label
    yield ~sticks & (kinds < 0), INK, "no cycle found: chaotic or undecided"


def _without(field: xr.DataArray) -> str:
    """Return the reason why an index of a persistent motion has no value; that of one stop, if it is not struck."""
    reasons = {
        "grazing_margin": "no near-miss",
        "max_force": "rigid stop",
        "harmonic_phase": "no part at the driving frequency",
    }
    if field.name in reasons:
        return reasons[str(field.name)]
    return f"{field['stop'].item()} is not struck" if "stop" in field.coords else "no value"


def _classes(sweep: xr.Dataset, field: xr.DataArray) -> Any:
    """Return the classes of motion of a map; -1 if it lacks the indices that determine them."""
    decides = set(NEEDED) <= set(map(str, sweep.variables)) and "sample_impacts" in sweep.attrs.get("arguments", "")
    return classify(sweep)["motion"].transpose(*field.dims).values if decides else np.full(field.shape, -1)
