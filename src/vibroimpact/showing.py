"""The display of results: a `repr` of a few lines, and small tables in notebooks."""

from __future__ import annotations

import html
import math
import re
import reprlib
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from itertools import zip_longest
from typing import Any, NamedTuple

MOST = 12  # rows of a table, at most
_TIED = "\u00a0"

BRIEF = reprlib.Repr()
BRIEF.maxtuple = BRIEF.maxlist = 3  # a chatter has a hundred impacts, a branch some hundred orbits
BRIEF.maxdict, BRIEF.maxother, BRIEF.maxstring = 20, 400, 200


class Table(NamedTuple):
    """A table in a notebook: a title, column headings with units, rows, and notes below."""

    title: str
    head: Sequence[str] = ()
    rows: Sequence[Sequence[Any]] = ()
    notes: Sequence[str] = ()


class Shown:
    """A result with a short display: its `repr` abbreviates long sequences, and notebooks show its table."""

    def __repr__(self) -> str:
        parts: Iterable[Any] = fields(self)  # type: ignore[arg-type]
        shown = (f"{part.name}={BRIEF.repr(getattr(self, part.name))}" for part in parts if part.repr)
        return f"{type(self).__name__}({', '.join(shown)})"

    def _table(self) -> Table:
        raise NotImplementedError

    def _repr_html_(self) -> str:
        return written(self._table())


def written(table: Table) -> str:
    """Return the first `MOST` rows of a table as HTML; numbers have four digits, and line breaks in text are kept."""
    return "\n".join(_lines(table))


def _lines(table: Table) -> Iterator[str]:
    yield f"<p><b>{html.escape(table.title)}</b></p>"
    if table.rows:
        yield from _grid(table.head, table.rows[:MOST])
    hidden = len(table.rows) - MOST
    notes = [*([f"{hidden} more"] if hidden > 0 else []), *table.notes]
    if notes:
        yield f"<p>{'<br>'.join(map(html.escape, notes))}</p>"


def _grid(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> Iterator[str]:
    columns = zip(*rows, strict=True)
    sides = ["right" if all(isinstance(value, float) for value in column) else "left" for column in columns]
    looks = [f'style="text-align: {side}; vertical-align: top; padding: 0.1em 0.8em"' for side in sides]
    yield "<table>"
    if any(head):
        yield _row("th", looks, head)
    yield from (_row("td", looks, row) for row in rows)
    yield "</table>"


def _row(tag: str, looks: Sequence[str], values: Sequence[Any]) -> str:
    cells = (f"<{tag} {look}>{_cell(value)}</{tag}>" for look, value in zip(looks, values, strict=True))
    return f"<tr>{''.join(cells)}</tr>"


def _cell(value: Any) -> str:
    if isinstance(value, Table):
        return "".join(_grid(value.head, value.rows))
    if isinstance(value, list):
        return "".join(f"<div>{_cell(each)}</div>" for each in value)
    text = f"{value:.4g}" if isinstance(value, float) else str(value)
    return html.escape(text).replace("\n", "<br>")


# As data


def plain(value: Any) -> Any:
    """Return content ready for JSON: NaN as None, infinity as "inf" or "-inf", complex numbers as pairs.

    Of a dataclass, the fields that are compared.
    """
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if is_dataclass(value):
        return {part.name: plain(getattr(value, part.name)) for part in fields(value) if part.compare}
    if isinstance(value, complex):
        return plain((value.real, value.imag))
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else "inf" if value > 0.0 else "-inf"
    return value


# In plain text


def aligned(rows: Iterable[Sequence[str]], widest: int = 1000) -> Iterator[str]:
    r"""Yield rows of text with aligned columns; a cell wider than `widest` takes several lines.

    Examples
    --------
    >>> print(*aligned([("gap [mm]", "0.5"), ("mass [kg]", "a light\nmass")]), sep="\n")
    gap [mm]   0.5
    mass [kg]  a light
               mass
    """
    lines: list[tuple[str, ...]] = []
    for row in rows:
        cells = ([part for line in cell.split("\n") for part in wrapped(line, widest)] for cell in row)
        lines += zip_longest(*cells, fillvalue="")
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for cells_of_line in lines:
        yield "  ".join(cell.ljust(width) for cell, width in zip(cells_of_line, widths, strict=True)).rstrip()


def wrapped(text: str, width: int, first: str = "", later: str = "") -> Iterator[str]:
    """Yield the lines of a wrapped text; a number stays with its unit, and a unit such as N s/m is not split."""
    tied = re.sub(r"(?<=\d) (?=%|[a-zA-Z/]+\b)|(?<=\bN) (?=s\b)", _TIED, text)
    for line in textwrap.wrap(tied, width, initial_indent=first, subsequent_indent=later):
        yield line.replace(_TIED, " ")
