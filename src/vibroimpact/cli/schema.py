"""The schema of requests: name, check, conversion and help of every option and every key of a study file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from vibroimpact import figures, indices
from vibroimpact.cli.endings import WrongRequest
from vibroimpact.cli.options import FLAG, PATH, TEXTS, Key, Option, number, numbers, words
from vibroimpact.cli.times import (
    ENDS,
    check_coordinates,
    check_duration,
    check_pieces,
    check_times,
    read_pieces,
    read_start,
    read_times,
)
from vibroimpact.options import Sampling, Tolerances
from vibroimpact.parameters import (
    COUNTS,
    QUOTES,
    choice,
    invalid,
    phase_number,
    positive_number,
    real_number,
    whole_number,
)


def _whole(least: int) -> Callable[[str, Any], int]:
    return lambda name, value: whole_number(name, value, least)


def _field_of(kind: type) -> Callable[[str, Any], Any]:
    """Return the check of a dataclass's field, made by the dataclass itself."""
    return lambda name, value: getattr(kind(**{name: value}), name)


def _one_of(*values: str) -> Callable[[str, Any], str]:
    return lambda name, value: choice(name, value, values)


def _flag(name: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise invalid(name, value, "true or false")
    return value


def _indices(name: str, value: Any) -> tuple[str, ...] | str:
    if not isinstance(value, (str, list, tuple)):
        raise invalid(name, value, 'a list of names such as ["std"]')
    names = indices.check_indices(value)
    return value if value == indices.ALL else names


def _backend(name: str, value: Any) -> str:
    from vibroimpact.backends import check_backend

    return check_backend(name, value)


def _level(name: str, value: Any) -> float:
    return real_number(name, value, hint="give it in the unit of the index")


# What is typed for several keys at once


def parse_parameters(texts: list[str]) -> dict[str, Any]:
    """Return the entries of `-p NAME=VALUE`; if a name is repeated, the last entry wins."""
    entries: dict[str, Any] = {}
    for text in texts:
        name, sign, value = (part.strip() for part in text.partition("="))
        if not (name and sign and value):
            raise WrongRequest(f"`-p` must be NAME=VALUE such as omega=2.8, got {text!r}; write it without spaces")
        if name[0] in QUOTES:
            raise WrongRequest(
                f"`-p` must be NAME=VALUE such as omega=2.8, got {text!r}; leave out the quotation marks"
            )
        if ":" in value:
            raise WrongRequest(f"`-p` must be NAME=VALUE, got {text!r}; give a range as an axis: --x {text}")
        entries.pop(name, None)  # the order decides between a name and its symbol
        entries[name] = number(value)
    return entries


def parse_axis(flag: str, text: str, form: str, example: str) -> dict[str, Any]:
    """Return the entry of `NAME=FROM:TO:POINTS`; the points may be left out if `form` has none."""
    name, _, values = (part.strip() for part in text.partition("="))
    parts = values.split(":")
    if not name or len(parts) not in ((3,) if form.endswith("POINTS") else (2, 3)):
        raise WrongRequest(f"`{flag}` must be {form}, got {text!r}; for example {flag} {example}")
    return {name: dict(zip(ENDS, map(number, [*parts, "2"][:3]), strict=True))}


def _size(text: str) -> tuple[float, float]:
    try:
        return figures.check_size([number(part) for part in text.lower().split("x")])
    except ValueError:
        each = "{:g} to {:g} inches".format(*figures.INCHES)
        raise WrongRequest(f"`--size` must be width x height such as 8x5, each {each}, got {text!r}") from None


# What is computed: model, initial conditions, axes

STUDY = Option("study", "STUDY.toml", "A study file; options complete it or replace its values.", flags=(), kind=PATH)
PARAMETERS = Option(
    "parameter", "NAME=VALUE",
    "A parameter of the model: mass (m, kg), damping (c, N s/m), stiffness (k, N/m), amplitude (f, N), omega (w, "
    "rad/s) or frequency (Hz), restitution (r), gap (g, m); damping_ratio (zeta) may replace damping. Append a unit to "
    "use another: gap=0.5mm, omega=1500rpm. Repeat it for more. The paper's are m=1 c=0.01 k=1 f=1 w=2 r=0.8 g=0.",
    "Oscillator", flags=("-p", "--parameter"), kind=TEXTS, table="oscillator", read=parse_parameters,
)  # fmt: skip
USER_MODEL = Option(
    "model", "FILE.py:NAME",
    "A model of your own: an oscillator, a system, or a function marked @vibroimpact.family; or the name of a "
    "ready-made one, such as bouncing_ball. -p and axes then take its parameters.",
    "Oscillator",
)  # fmt: skip
MODEL = (STUDY, PARAMETERS, USER_MODEL)


START = Option(
    "start", "Y,V,T",
    "Initial displacement in m, velocity in m/s and time in s; V and T may be left out. (default: at rest at min(0, "
    "gap), time 0) For systems, numbers for all coordinates: Q,Q:V,V:T.",
    "Oscillator", table="start", read=read_start,
)  # fmt: skip
STARTS = Option(
    "starts", "N",
    "Compute each cell from N initial conditions: at rest, and N - 1 impacts at phases 0 to 1 and velocities 0 to "
    "4 max(f, k|g|)/sqrt(km). Figures show the largest value of the N. (default: 1, that of --start)",
    "Oscillator", table="run", check=_whole(2),
)  # fmt: skip

GRID, SPAN = "NAME=FROM:TO:POINTS", "NAME=FROM:TO"


def _axis(
    name: str, text: str, form: str = GRID, example: str = "omega=0.025:5:200", most: int = 1, **more: Any
) -> Option:
    def read(texts: list[str]) -> dict[str, Any]:
        axes: dict[str, Any] = {}
        for typed in texts:
            axes |= parse_axis(f"--{name}", typed, form, example)
        if len(axes) > most:
            raise WrongRequest(f"`--{name}` takes one parameter, got {' and '.join(axes)}; give each its own option")
        return axes

    usual: dict[str, Any] = {"table": "axes", "read": read, "kind": TEXTS}
    return Option(name, form, text, "Axes", **usual | more)


X = _axis("x", "The first axis, linear, both ends included: omega=0.025:5:200.")
Y = _axis("y", "The second axis.", example="mass=0.1:5:200")
MORE_AXES = _axis("axis", "A further axis; repeat it for more.", example="mass=0.1:5:200", most=COUNTS)
RANGE = _axis("x", "The parameter and its range: omega=0.8:3, or omega=0.8:3:400 with --diagram.", SPAN, "omega=0.8:3")
RANGE_X = _axis("x", "The first parameter of the plane and its range: omega=0.025:5.", SPAN, "omega=0.025:5")
RANGE_Y = _axis("y", "The second parameter and its range: mass=0.1:5.", SPAN, "mass=0.1:5")
# Axes of initial conditions are no part of a study file.
START_X = _axis(
    "x",
    "phase=0:1:200 of impacts, or displacement=-3:0:200 of states; for systems displacement_0, velocity_1, ... "
    "(default: phases 0 to 1)",
    example="phase=0:1:200",
    table="",
)
START_Y = _axis(
    "y", "velocity=0:3:200, in m/s. (default: 0 to 4 max(f, k|g|)/sqrt(km))", example="phase=0:1:200", table=""
)

# Sampling

_sampling = partial(Option, panel="Sampling", table="sampling", check=_field_of(Sampling))
TRANSIENT_IMPACTS = _sampling("transient_impacts", "N", "Impacts to skip first.", default=Sampling.transient_impacts)
SAMPLE_IMPACTS = _sampling("sample_impacts", "N", "Impacts to keep after that.", default=Sampling.sample_impacts)
BASIN_IMPACTS = _sampling("sample_impacts", "N", "Impacts to keep in the first of three rounds.", default=500)
PHASE = _sampling(
    "phase", "PHI", "Phase of the stroboscopic section, from 0 to below 1.", default=0, check=phase_number
)
IMPACTS = (TRANSIENT_IMPACTS, SAMPLE_IMPACTS)
PERIODS = (
    _sampling("transient_periods", "N", "Driving periods to skip first.", default=Sampling.transient_periods),
    _sampling("sample_periods", "N", "Driving periods to keep after that.", default=Sampling.sample_periods),
    PHASE,
)
DURATION = (
    _sampling("periods", "N", "Driving periods to compute.", default=20, check=positive_number),
    _sampling("duration", "S", "Length in s, or with another unit: 20ms.", check=check_duration),
    _sampling("pieces", "TIME:FORCE", "Piece of a load in place of the model's: its duration and force, as 4ms:50N, or "
              "1s:model for the load of the model. For systems, a force for each coordinate: 4ms:0,50. Repeat the "
              "option for the next piece.",
              flags=("--piece",), kind=TEXTS, read=read_pieces, check=check_pieces),
    _sampling("times", "T,T,..", "Times of samples in s; or FROM:TO:POINTS.", read=read_times, check=check_times),
    _sampling("skip_periods", "N", "Driving periods to skip first.", default=0, check=_whole(0)),
    _sampling("samples_per_period", "N", "Samples per driving period.", default=200, check=_whole(1)),
)  # fmt: skip
OTHERS = replace(
    START, help="For systems: the coordinates that no axis varies, and the time: Q,Q:V,V:T. (default: at rest)"
)
ON_STOP = Option(
    "stop", "NAME", "For systems: the stop that the impacts strike; needed only with several stops.", "Axes"
)
START_PHASE = Option("phase", "PHI", "Phase of states, for displacement axes.", "Axes", default=0, table="sampling")

# How it is computed

_how = partial(Option, panel="How to compute")
BACKEND = _how(
    "backend",
    "NAME",
    "Engine: cpu, cuda (GPU), reference (slow cross-check) or fixed-step (the paper's scheme).",
    default="cpu",
    table="run",
    check=_backend,
)
TIME_STEP = _how(
    "time_step",
    "S",
    "Time step of the back end fixed-step, in s.",
    default=0.0005,
    table="run",
    check=positive_number,
)
TOLERANCE = _how(
    "chatter", "X", "Impacts slower than this times max(f, k|g|)/sqrt(km) are not counted. (default: 1e-9)",
    table="tolerances", check=_field_of(Tolerances),
)  # fmt: skip
WORKERS = _how("workers", "N", "Threads. (default: all cores)", table="run", check=_whole(1))
ENGINE = (BACKEND, TIME_STEP, TOLERANCE)
EVERY_IMPACT = _how(
    "early_closing", "", "Compute every impact, even if a closed cycle determines the rest.", table="run",
    flags=("--every-impact",), kind=FLAG, read=lambda given: not given, check=_flag,
)  # fmt: skip
BY_STOP = _how(
    "by_stop", "", "For systems: give the indices for each stop.",
    table="run", flags=("--by-stop",), kind=FLAG, read=bool, check=_flag,
)  # fmt: skip
CLUSTER = _how(
    "cluster", "WHERE", "Compute on a Dask cluster: tcp://HOST:PORT of its scheduler, or local:N processes here.",
    read=str,
)  # fmt: skip
TILE = _how("tile", "N", "Approximate cells per tile of a store or cluster. (default: 4096; 4 with slow back ends)")
REFINE = _how("refine", "L", "Halve the intervals of both axes L times, and compute only where the motion changes.")
STEP = _how(
    "step", "X", "Longest step along a curve, as a fraction of the ranges and of a driving period.", default=0.01
)
LINES = _how("lines", "N", "Lines in each direction of the plane to search for boundaries.", default=5)
OF = Option("of", "NAME", "A point, a stop (its clearance) or a coordinate's number.", "What to compute", table="run")
DOUBLINGS = _how(
    "doublings", "N", "Number of period doublings to follow into the doubled orbits.", check=_whole(0), default=0
)

# What is computed

_what = partial(Option, panel="What to compute")


INDICES = _what(
    "indices", "NAMES",
    f"Comma-separated: {', '.join(indices.EVERY)}; or all. (default: std; for a diagram: none)", table="run",
    check=_indices,
    read=lambda text: indices.ALL if text.strip() == indices.ALL else words(text),
)  # fmt: skip
_SECTIONS = (
    "impact: velocity and phase of impacts; stroboscopic: displacement and velocity once per driving period. "
    "(default: impact)"
)
SECTION = _what("section", "KIND", _SECTIONS, table="run", check=_one_of("impact", "stroboscopic"))
SECTION_KIND = replace(SECTION, flags=("--kind",))
COORDINATE = _what(
    "coordinate",
    "N",
    "For systems: the coordinate that a stroboscopic section shows.",
    default=0,
    table="run",
    check=_whole(0),
)
DIRECTION = _what(
    "direction", "WAY",
    "fresh: each value from the same initial conditions; up, down: each from the final state of its "
    "neighbour. (default: fresh)",
    table="run", check=_one_of("fresh", "up", "down"),
)  # fmt: skip
VARY = _what(
    "vary",
    "NAMES",
    "Comma-separated: parameters varied in search of boundaries and advice. (default: all)",
    read=words,
)
WITHIN = _what("within", "X", "Range of each parameter: from value/(1+X) to value*(1+X).", default=3)
SEARCH = (VARY, WITHIN)

_orbit = partial(Option, panel="Which orbits")
ORBIT_PERIODS = _orbit("n_periods", "N", "Driving periods per cycle.", flags=("--periods",), default=1)
PERIODS_LIST = _orbit(
    "periods_list",
    "N,N",
    "Driving periods per cycle, one or several. (default: see above)",
    flags=("--periods",),
    read=lambda text: numbers("--periods", text, "whole numbers such as 1,2"),
)
ORBIT_IMPACTS = _orbit(
    "n_impacts", "P", "Impacts per cycle; -1 for complete chatter and sticking.", flags=("--impacts",), default=1
)
NEAR = _orbit(
    "near", "PHASE,VELOCITY",
    "Phase, 0 to 1, and velocity in m/s of an impact to start the search at. (default: from rest and a grid)",
)  # fmt: skip
KINDS = _orbit(
    "kinds", "KINDS", "Comma-separated: fold, period-doubling, grazing, end-of-sticking. (default: all)",
    flags=("--kind",), read=words,
)  # fmt: skip
ORBIT = (ORBIT_PERIODS, ORBIT_IMPACTS, NEAR)
STRUCK = (
    _orbit(
        "stops",
        "NAMES",
        "For systems: comma-separated names of the stops struck in turn; with several, --near gives times T,T in s.",
        read=words,
    ),
    _orbit("symmetric", "", "For systems: motions mirrored after half a cycle; --stops lists one half.", kind=FLAG),
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
    _output("size", "WxH", "Size of a figure in inches, such as 8x5.", read=_size),
    _output("dpi", "N", "Dots per inch of a figure.", check=lambda _, value: figures.check_dpi(value), default=150),
)
FIGURE = _output("figure", "KIND", "Kind of figure, as for `vibroimpact plot --kind`.")
FIGURE_KIND = _output(
    "figure", "KIND",
    f"{', '.join(figures.KINDS)}. (default: the one that suits the result)",
    flags=("--kind",),
)  # fmt: skip
POINT = _output("point", "NAME", "For systems with named points: the point whose motion is the result.", read=str)
SHOWN = (
    _output("coordinate", "N", "For systems: the coordinate that a figure of one motion shows.", default=0),
    _output(
        "stop", "NAME", "For systems: the stop whose clearance, or whose map of `--by-stop`, a figure shows.", read=str
    ),
)
INDEX = _output("index", "NAME", "Index that a figure shows. (default: the first for a sweep, none for a diagram)")
LEVEL = _output("level", "X", "Contour level at which the boundary is drawn, in the unit of the index.", check=_level)
SWEEP_FILE = _output(
    "sweep", "FILE", "A saved map over the axis of the diagram FILE: draws its index on top.", kind=PATH
)
OVER = _output("over", "FILE", "A saved map over the same plane, drawn beneath the boundaries.", kind=PATH)
DIAGRAM = _output(
    "diagram", "",
    "Draw the figure over the bifurcation diagram of the settled motion. (400 values, or those of --x)", kind=FLAG,
)  # fmt: skip
FULL = _output("full", "", "Print the whole verdict, with its boundaries.", kind=FLAG)
JSON = _output("json", "", "Print as JSON.", kind=FLAG)

# Study files

_KEYS = (
    *IMPACTS, *PERIODS, *DURATION,
    Key("displacement", table="start", check=check_coordinates),
    Key("velocity", table="start", check=check_coordinates), Key("time", table="start", check=real_number),
    TOLERANCE, Key("flight_periods", table="tolerances", check=TOLERANCE.check),
    Key("steps_per_impact", table="tolerances", check=TOLERANCE.check),
    INDICES, BACKEND, TIME_STEP, WORKERS, SECTION, DIRECTION, EVERY_IMPACT, BY_STOP, STARTS, COORDINATE, OF,
)  # fmt: skip
TABLES: dict[str, dict[str, Callable[[str, Any], Any]]] = {}  # of a study file: the checks of its keys
for _key in _KEYS:
    TABLES.setdefault(_key.table, {})[_key.name] = _key.check
