"""Every option of the command line, declared once: its name, value and help, and its key in a study file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import KW_ONLY, dataclass, replace
from functools import partial
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibroimpact import figures, indices
from vibroimpact.cli import WrongRequest

if TYPE_CHECKING:
    from vibroimpact.cli.study import Study

ENDS = ("from", "to", "points")  # of an axis

# Numbers arrive as text: the checks of the study then name value, range and remedy.
TEXT, TEXTS, FLAG, PATH = str | None, list[str] | None, bool, Path | None


def number(text: str) -> int | float | str:
    """Return the number that a text stands for, or the text, for the schema to refuse."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def numbers(flag: str, text: str, example: str, count: int = 0) -> tuple[int | float | str, ...]:
    """Return the numbers of a comma-separated list; `count` is how many there must be, if that is known."""
    parts = tuple(number(part.strip()) for part in text.split(","))
    if (count and len(parts) != count) or "" in parts:
        raise WrongRequest(f"`{flag}` must be {example}, got {text!r}; separate numbers by commas")
    return parts


def parse_parameters(texts: list[str]) -> dict[str, Any]:
    """Return the entries of `-p NAME=VALUE`; where a name is repeated the last one wins."""
    entries: dict[str, Any] = {}
    for text in texts:
        name, sign, value = (part.strip() for part in text.partition("="))
        if not (name and sign and value):
            raise WrongRequest(f"`-p` must be NAME=VALUE such as omega=2.8, got {text!r}")
        entries.pop(name, None)  # the order decides between a name and its symbol
        entries[name] = number(value)
    return entries


def parse_axis(flag: str, text: str, form: str, example: str) -> dict[str, Any]:
    """Return the entry of `NAME=FROM:TO:POINTS`; the points may be left out where `form` has none."""
    name, _, values = (part.strip() for part in text.partition("="))
    parts = values.split(":")
    if not name or len(parts) not in ((3,) if form.endswith("POINTS") else (2, 3)):
        raise WrongRequest(f"`{flag}` must be {form}, got {text!r}; for example {flag} {example}")
    return {name: dict(zip(ENDS, map(number, [*parts, "2"][:3]), strict=True))}


@dataclass(frozen=True)
class Option:
    """An option, or a positional argument, of a command.

    `name` is the keyword that commands and functions know it by, `flags` what is typed (made of the name unless
    given; an empty tuple makes it a positional argument). `table` is the table of a study file that has the same key,
    and `read` returns that key's value, or several entries of that table, from the text.
    """

    name: str
    metavar: str
    help: str
    panel: str | None = None
    _: KW_ONLY
    flags: tuple[str, ...] | None = None
    kind: Any = TEXT
    required: bool = False
    table: str = ""
    read: Callable[[Any], Any] = number

    @property
    def parameter(self) -> Parameter:
        """The parameter of a function that typer makes this option of."""
        flags = (f"--{self.name.replace('_', '-')}",) if self.flags is None else self.flags
        more: dict[str, Any] = {"help": self.help} | ({} if self.kind is FLAG else {"metavar": self.metavar})
        made: Any = typer.Option(*flags, rich_help_panel=self.panel, **more) if flags else typer.Argument(**more)
        kind = Path if self.required else self.kind
        usual = Parameter.empty if self.required else False if self.kind is FLAG else None
        return Parameter(self.name, Parameter.KEYWORD_ONLY, default=usual, annotation=Annotated[kind, made])


class Options(Mapping[str, Any]):
    """What was typed for the options that a command declares."""

    def __init__(self, declared: tuple[Option, ...], typed: Mapping[str, Any]) -> None:
        self._declared, self._typed = declared, typed

    def __getitem__(self, name: str) -> Any:
        return self._typed[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._typed)

    def __len__(self) -> int:
        return len(self._typed)

    def study(self, file: Path | None = None) -> Study:
        """Return the request that they make together with a study file."""
        from vibroimpact.cli.study import read_study  # here, since --help needs none of it

        return read_study(file or self.get("study"), self.changes(), self.get("model"))

    def with_values(self, **values: Any) -> Options:
        """Return a copy with other values of some options."""
        return Options(self._declared, {**self._typed, **values})

    def number(self, name: str, usual: Any = None) -> Any:
        """Return the number typed for an option, or the usual one."""
        return usual if self.get(name) is None else number(self[name])

    def numbers(self, *names: str) -> dict[str, Any]:
        """Return the numbers typed for these options; those not given are left out."""
        return {name: number(self[name]) for name in names if self.get(name) is not None}

    def changes(self) -> dict[str, dict[str, Any]]:
        """Return the typed options as the tables of a study file."""
        tables: dict[str, dict[str, Any]] = {}
        for option in self._declared:
            if option.table and self.get(option.name) not in (None, (), [], False):
                value = option.read(self[option.name])
                entries = value if isinstance(value, dict) else {option.name: value}
                table = tables.setdefault(option.table, {})
                if option.table == "axes" and (twice := set(table) & set(entries)):
                    raise WrongRequest(f"the axis {min(twice)} is given twice; give each parameter one axis")
                table.update(entries)
        return tables


def with_options(*groups: Option | tuple[Option, ...]) -> Callable[[Callable[[Options], None]], Callable[..., None]]:
    """Make a command of a function of `Options`: typer sees one parameter for each option listed."""
    declared = tuple(option for group in groups for option in (group if isinstance(group, tuple) else (group,)))

    def made(function: Callable[[Options], None]) -> Callable[..., None]:
        def command(**typed: Any) -> None:
            function(Options(declared, typed))

        parameters = [option.parameter for option in declared]
        command.__doc__, command.__name__ = function.__doc__, function.__name__
        command.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
        command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        return command

    return made


# What is computed: model, initial conditions, axes

STUDY = Option("study", "STUDY.toml", "A study file; options complete it or replace its values.", flags=(), kind=PATH)
PARAMETERS = Option(
    "parameter", "NAME=VALUE",
    "A parameter of the model: mass (m, kg), damping (c, N s/m), stiffness (k, N/m), amplitude (f, N), omega (w, "
    "rad/s) or frequency (Hz), restitution (r), gap (g, m); damping_ratio (zeta) may replace damping. Other units are "
    "written behind: gap=0.5mm, omega=1500rpm. Repeat it for more. The paper's are m=1 c=0.01 k=1 f=1 w=2 r=0.8 g=0.",
    "Oscillator", flags=("-p", "--parameter"), kind=TEXTS, table="oscillator", read=parse_parameters,
)  # fmt: skip
USER_MODEL = Option(
    "model", "FILE.py:NAME",
    "A model of your own: an oscillator, a system, or a function marked @vibroimpact.family; or the name of a "
    "ready-made one, such as bouncing_ball. -p and axes then take its parameters.",
    "Oscillator",
)  # fmt: skip
MODEL = (STUDY, PARAMETERS, USER_MODEL)


def _start(text: str) -> dict[str, Any]:
    if ":" in text:  # of a system: coordinates, their velocities, time
        groups = [numbers("--start", part, "Q,Q:V,V:T with a number for each coordinate") for part in text.split(":")]
        if len(groups) > 3 or len(groups[2:]) != sum(len(group) == 1 for group in groups[2:]):
            raise WrongRequest(f"`--start` must be Q,Q:V,V:T such as 0.1,0:0,0:0, got {text!r}")
        named = dict(zip(("displacement", "velocity"), map(list, groups), strict=False))
        return named | ({"time": groups[2][0]} if groups[2:] else {})
    parts = numbers("--start", text, "up to three numbers Y,V,T such as -1,0,0")
    if len(parts) > 3:
        raise WrongRequest(f"`--start` must be up to three numbers Y,V,T such as -1,0,0, got {text!r}")
    return dict(zip(("displacement", "velocity", "time"), parts, strict=False))


START = Option(
    "start", "Y,V,T",
    "Initial displacement in m, velocity in m/s and time in s; V and T may be left out. (default: at rest at min(0, "
    "gap), time 0) For systems, numbers for all coordinates: Q,Q:V,V:T.",
    "Oscillator", table="start", read=_start,
)  # fmt: skip
STARTS = Option(
    "starts", "N",
    "Compute each cell from N initial conditions: at rest, and N - 1 impacts at phases 0 to 1 and velocities 0 to "
    "4 max(f, k|g|)/sqrt(km). Figures show the largest value of the N. (default: 1, that of --start)",
    "Oscillator", table="run",
)  # fmt: skip

GRID, SPAN = "NAME=FROM:TO:POINTS", "NAME=FROM:TO"


def _axis(name: str, text: str, form: str = GRID, example: str = "omega=0.025:5:200", **more: Any) -> Option:
    def read(given: str) -> dict[str, Any]:
        return parse_axis(f"--{name}", given, form, example)

    usual: dict[str, Any] = {"table": "axes", "read": read}
    return Option(name, form, text, "Axes", **usual | more)


def _more_axes(given: list[str]) -> dict[str, Any]:
    axes: dict[str, Any] = {}
    for text in given:
        axes |= parse_axis("--axis", text, GRID, "mass=0.1:5:200")
    return axes


X = _axis("x", "The first axis, linear, both ends included: omega=0.025:5:200.")
Y = _axis("y", "The second axis.", example="mass=0.1:5:200")
MORE_AXES = _axis("axis", "A further axis; repeat it for more.", kind=TEXTS, read=_more_axes)
RANGE = _axis("x", "The parameter and its range: omega=0.8:3, or omega=0.8:3:400 with --diagram.", SPAN, "omega=0.8:3")
RANGE_X = _axis("x", "The first parameter of the plane and its range: omega=0.025:5.", SPAN, "omega=0.025:5")
RANGE_Y = _axis("y", "The second parameter and its range: mass=0.1:5.", SPAN, "mass=0.1:5")
# Axes of initial conditions are no part of a study file.
START_X = _axis(
    "x",
    "phase=0:1:200 of impacts, or displacement=-3:0:200 of states; for systems displacement_0, velocity_1, ... "
    "(default: phases 0 to 1)",
    table="",
)
START_Y = _axis("y", "velocity=0:3:200, in m/s. (default: 0 to 4 max(f, k|g|)/sqrt(km))", table="")

# Sampling

_sampling = partial(Option, panel="Sampling", table="sampling")
TRANSIENT_IMPACTS = _sampling("transient_impacts", "N", "Impacts discarded first. (default: 100)")
SAMPLE_IMPACTS = _sampling("sample_impacts", "N", "Impacts kept after that. (default: 5000)")
BASIN_IMPACTS = _sampling("sample_impacts", "N", "Impacts kept, in the first of three rounds. (default: 500)")
PHASE = _sampling("phase", "PHI", "Phase of the stroboscopic section, from 0 to below 1. (default: 0)")
IMPACTS = (TRANSIENT_IMPACTS, SAMPLE_IMPACTS)
PERIODS = (
    _sampling("transient_periods", "N", "Driving periods discarded first. (default: 200)"),
    _sampling("sample_periods", "N", "Driving periods kept after that. (default: 500)"),
    PHASE,
)
DURATION = (
    _sampling("periods", "N", "Driving periods to compute. (default: 20)"),
    _sampling("skip_periods", "N", "Driving periods that pass before. (default: 0)"),
    _sampling("samples_per_period", "N", "Samples per driving period. (default: 200)"),
)
OTHERS = replace(
    START, help="For systems: the coordinates that no axis varies, and the time: Q,Q:V,V:T. (default: at rest)"
)
ON_STOP = Option(
    "stop", "NAME", "For systems: the stop that the impacts strike; the only one need not be named.", "Axes"
)
START_PHASE = Option("phase", "PHI", "Phase of states, with displacement. (default: 0)", "Axes", table="sampling")

# How it is computed

_how = partial(Option, panel="How to compute")
BACKEND = _how(
    "backend",
    "NAME",
    "What computes, such as cuda (GPU), reference (slow witness) or fixed-step (the paper's). (default: cpu)",
    table="run",
)
TIME_STEP = _how("time_step", "S", "Time step of the back end fixed-step, in s. (default: 0.0005)", table="run")
TOLERANCE = _how(
    "chatter", "X", "Impacts slower than this times max(f, k|g|)/sqrt(km) are not counted. (default: 1e-9)",
    table="tolerances",
)  # fmt: skip
WORKERS = _how("workers", "N", "Threads. (default: all cores)", table="run")
ENGINE = (BACKEND, TIME_STEP, TOLERANCE)
EVERY_IMPACT = _how(
    "early_closing", "", "Compute every impact, even where a closed cycle gives the rest.", table="run",
    flags=("--every-impact",), kind=FLAG, read=lambda given: not given,
)  # fmt: skip
BY_STOP = _how(
    "by_stop", "", "For systems: indices stop by stop.", table="run", flags=("--by-stop",), kind=FLAG, read=bool
)
CLUSTER = _how(
    "cluster", "WHERE", "Compute on a Dask cluster: tcp://HOST:PORT of its scheduler, or local:N processes here."
)
TILE = _how("tile", "N", "Cells per tile in a store or on a cluster, roughly. (default: 4096; 4 with slow back ends)")
REFINE = _how("refine", "L", "Halve the intervals of both axes L times, and compute only where the motion changes.")
STEP = _how(
    "step", "X", "Longest step along a curve, as a fraction of the ranges and of a driving period. (default: 0.01)"
)
LINES = _how("lines", "N", "Lines across the plane, each way, to search for boundaries on. (default: 5)")
DOUBLINGS = _how("doublings", "N", "Number of period doublings to follow into the doubled orbits. (default: 0)")

# What is computed

_what = partial(Option, panel="What to compute")


def _names(text: str) -> list[str]:
    if text.strip() == "all":
        return list(indices.INDICES)
    return [name.strip() for name in text.split(",")]


INDICES = _what(
    "indices", "NAMES",
    f"Comma-separated: {', '.join(indices.INDICES)}; or all; for systems {', '.join(indices.FORCES)}. "
    "(default: std; of a diagram: none)", table="run", read=_names,
)  # fmt: skip
_SECTIONS = (
    "impact: velocity and phase of impacts; stroboscopic: displacement and velocity once per driving period. "
    "(default: impact)"
)
SECTION = _what("section", "KIND", _SECTIONS, table="run")
SECTION_KIND = _what("section", "KIND", _SECTIONS, table="run", flags=("--kind",))
COORDINATE = _what(
    "coordinate", "N", "For systems: the coordinate that a stroboscopic section shows. (default: 0)", table="run"
)
DIRECTION = _what(
    "direction", "WAY",
    "fresh: each value from the same initial conditions; up, down: each from where its neighbour ended. (default: "
    "fresh)",
    table="run",
)  # fmt: skip
VARY = _what("vary", "NAMES", "Comma-separated: parameters varied in search of boundaries and remedies. (default: all)")
WITHIN = _what("within", "X", "How far: from value/(1+X) to value*(1+X). (default: 3)")
SEARCH = (VARY, WITHIN)

_orbit = partial(Option, panel="Which orbits")
ORBIT_PERIODS = _orbit("n_periods", "N", "Driving periods per cycle. (default: 1)", flags=("--periods",))
PERIODS_LIST = _orbit(
    "periods_list", "N,N", "Driving periods per cycle, one or several. (default: see above)", flags=("--periods",)
)
ORBIT_IMPACTS = _orbit(
    "n_impacts", "P", "Impacts per cycle; -1 for complete chatter and sticking. (default: 1)", flags=("--impacts",)
)
NEAR = _orbit(
    "near", "PHASE,VELOCITY",
    "Phase, 0 to 1, and velocity in m/s of an impact to start the search at. (default: from rest and a grid)",
)  # fmt: skip
KINDS = _orbit(
    "kinds", "KINDS", "Comma-separated: fold, period-doubling, grazing, end-of-sticking. (default: all)",
    flags=("--kind",),
)  # fmt: skip
ORBIT = (ORBIT_PERIODS, ORBIT_IMPACTS, NEAR)
STRUCK = (
    _orbit(
        "stops", "NAMES", "For systems: comma-separated, the stops struck in turn; with several, --near is T,T in s."
    ),
    _orbit(
        "symmetric", "", "For systems: motions that are mirrored after half a cycle, whose stops these are.", kind=FLAG
    ),
)

# Where the result goes

_output = partial(Option, panel="Output")
_out = partial(_output, "out", flags=("--out", "-o"), kind=PATH)
OUT_FILE = _out("FILE", "Data (.zarr .nc .csv .mat) or a figure (.png .svg .pdf). Without it: a summary as text.")
OVERWRITE = _output("overwrite", "", "Replace an existing output.", kind=FLAG)
OUT = (OUT_FILE, OVERWRITE)
FILM_OUT = (
    _out("FILE", "Data (.zarr .nc .csv .mat), a figure (.png .svg .pdf) or a film (.gif .mp4). Without it: a summary."),
    OVERWRITE,
)
ORBIT_OUT = (_out("FILE", "Data: .json .csv .zarr .nc .mat. Without it: a table as text."), OVERWRITE)
COMPARE_OUT = (
    _out("FILE", "A figure (.png .svg .pdf) or data (.zarr .nc .csv .mat .json). The table is printed in any case."),
    OVERWRITE,
)
FOLDER = _out("DIR", "Folder for the report, its figures and data.", required=True)
PICTURE = (
    _output("size", "WxH", "Size of a figure in inches, such as 8x5."),
    _output("dpi", "N", "Dots per inch of a figure. (default: 150)"),
)
FIGURE = _output("figure", "KIND", "Kind of figure, as for `vibroimpact plot --kind`.")
FIGURE_KIND = _output(
    "figure", "KIND",
    f"{', '.join(figures.KINDS)}. (default: what suits the result)",
    flags=("--kind",),
)  # fmt: skip
SHOWN = (
    _output("coordinate", "N", "For systems: the coordinate that a figure of one motion shows. (default: 0)"),
    _output("stop", "NAME", "For systems: the stop whose clearance, or whose map of `--by-stop`, a figure shows."),
)
INDEX = _output("index", "NAME", "Index that a figure shows. (default: the first of a sweep, none of a diagram)")
LEVEL = _output("level", "X", "Contour level at which the boundary is drawn, in the unit of the index.")
SWEEP_FILE = _output(
    "sweep", "FILE", "A saved map over the axis of the diagram FILE: draws its index on top.", kind=PATH
)
OVER = _output("over", "FILE", "A saved map over the same plane, drawn beneath the boundaries.", kind=PATH)
DIAGRAM = _output(
    "diagram", "",
    "Draw the figure over the bifurcation diagram of the settled motion. (400 values, or those of --x)", kind=FLAG,
)  # fmt: skip
JSON = _output("json", "", "Print as JSON.", kind=FLAG)
