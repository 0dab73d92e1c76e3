"""What every option is called, takes and means."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

# Numbers arrive as text: the study's own checks tell name, value, what is allowed and what to do.
_Text = str | None
_Texts = list[str] | None

StudyFile = Annotated[
    Path | None,
    Argument(metavar="STUDY.toml", help="A study file; options complete it or take the place of its values."),
]
Parameters = Annotated[
    _Texts,
    Option(
        "-p", "--parameter", metavar="NAME=VALUE", rich_help_panel="Oscillator",
        help="One of mass (m, kg), damping (c, N s/m), stiffness (k, N/m), amplitude (f, N), omega (w, rad/s) or "
        "frequency (Hz), restitution (r), gap (g, m); damping_ratio (zeta) may stand for damping. Repeat it for more. "
        "Defaults are the paper's: "
        "m=1 c=0.01 k=1 f=1 w=2 r=0.8 g=0.",
    ),
]  # fmt: skip
Start = Annotated[
    _Text,
    Option(
        metavar="Y,V,T", rich_help_panel="Oscillator",
        help="Displacement in m, velocity in m/s and time in s to start from; V and T may be left out. "
        "Default: at rest at min(0, gap), time 0.",
    ),
]  # fmt: skip


def _axis(*names: str, text: str) -> object:
    return Option(*names, metavar="NAME=FROM:TO:POINTS", rich_help_panel="Axes", help=text)


X = Annotated[_Text, _axis("--x", text="The first axis, linear, both ends included: omega=0.025:5:200.")]
Y = Annotated[_Text, _axis("--y", text="The second axis.")]
MoreAxes = Annotated[_Texts, _axis("--axis", text="A further axis; repeat it for more.")]


def _sampling(metavar: str, text: str) -> object:
    return Option(metavar=metavar, rich_help_panel="Sampling", help=text)


TransientImpacts = Annotated[_Text, _sampling("N", "Impacts left out first. (default: 100)")]
SampleImpacts = Annotated[_Text, _sampling("N", "Impacts kept after that. (default: 5000)")]
BasinImpacts = Annotated[_Text, _sampling("N", "Impacts kept after that, in the first of three rounds. (default: 500)")]
TransientPeriods = Annotated[_Text, _sampling("N", "Driving periods left out first. (default: 200)")]
SamplePeriods = Annotated[_Text, _sampling("N", "Driving periods kept after that. (default: 500)")]
Phase = Annotated[_Text, _sampling("PHI", "When in a period to look, from 0 to below 1. (default: 0)")]
Periods = Annotated[_Text, _sampling("N", "Driving periods to follow. (default: 20)")]
SamplesPerPeriod = Annotated[_Text, _sampling("N", "Instants given in each. (default: 200)")]


def _how(metavar: str, text: str) -> object:
    return Option(metavar=metavar, rich_help_panel="How to compute", help=text)


Backend = Annotated[
    _Text, _how("NAME", "cpu, cuda (GPU), reference (slow witness) or fixed-step (the paper's). (default: cpu)")
]
TimeStep = Annotated[_Text, _how("S", "Step in s of the back end fixed-step. (default: 0.0005)")]
Chatter = Annotated[
    _Text, _how("X", "Impacts slower than this times max(f, k|g|)/sqrt(km) are not counted. (default: 1e-9)")
]
Workers = Annotated[_Text, _how("N", "Threads. (default: all cores)")]
Cluster = Annotated[
    _Text, _how("WHERE", "Compute on a Dask cluster: tcp://HOST:PORT of its scheduler, or local:N processes here.")
]
Tile = Annotated[
    _Text, _how("N", "Cells of a tile in a store or on a cluster, about. (default: 4096; 4 with slow back ends)")
]
Refine = Annotated[
    _Text, _how("L", "Halve the intervals of both axes L times, and compute only where the motion changes.")
]
EveryImpact = Annotated[
    bool,
    Option(
        "--every-impact", rich_help_panel="How to compute", help="Step on even where a closed cycle tells the rest."
    ),
]
Indices = Annotated[
    _Text,
    Option(
        metavar="NAMES", rich_help_panel="What to compute",
        help="Comma-separated: std, mean_velocity, max_velocity, impacts_per_period, lyapunov, lyapunov_per_impact, "
        "n_periods, n_impacts, dissipation, stick_fraction, impact_phase_spread, grazing_margin; or all. "
        "(default: std; of a diagram: none)",
    ),
]  # fmt: skip
_SECTIONS = "impact: velocity and phase of impacts; stroboscopic: displacement and velocity once a driving period."


def _section(name: str) -> object:
    return Option(name, metavar="KIND", rich_help_panel="What to compute", help=f"{_SECTIONS} (default: impact)")


SectionKind = Annotated[_Text, _section("--kind")]
DiagramSection = Annotated[_Text, _section("--section")]
Direction = Annotated[
    _Text,
    Option(
        metavar="WAY", rich_help_panel="What to compute",
        help="fresh: each value from the same start; up, down: each from where its neighbour ended. (default: fresh)",
    ),
]  # fmt: skip


def _output(*names: str, metavar: str, text: str) -> object:
    return Option(*names, metavar=metavar, rich_help_panel="Output", help=text)


Out = Annotated[
    Path | None,
    _output(
        "--out", "-o", metavar="FILE",
        text="Data (.zarr .nc .csv .mat) or a figure (.png .svg .pdf). Without it: a summary in words.",
    ),
]  # fmt: skip
Folder = Annotated[Path, _output("--out", "-o", metavar="DIR", text="Folder for the report, its figures and data.")]
Overwrite = Annotated[bool, Option("--overwrite", rich_help_panel="Output", help="Replace an output that exists.")]
Size = Annotated[_Text, _output("--size", metavar="WxH", text="Size of a figure in inches, such as 8x5.")]
Dpi = Annotated[_Text, _output("--dpi", metavar="N", text="Dots an inch of a figure. (default: 150)")]
Figure = Annotated[_Text, _output("--figure", metavar="KIND", text="Kind of figure, as for `vibroimpact plot --kind`.")]
Index = Annotated[
    _Text, _output("--index", metavar="NAME", text="Index a figure shows: of a sweep the first, of a diagram none.")
]
Level = Annotated[
    _Text, _output("--level", metavar="X", text="Where a contour draws the boundary, in the unit of the index.")
]
PlotKind = Annotated[
    _Text,
    _output(
        "--kind", metavar="KIND",
        text="time-history, phase-portrait, impact-map, stroboscopic-map, bifurcation-diagram, index-curve, "
        "index-contour, index-surface, motion-map, exponent-map, branch-diagram, boundaries, basin-portrait or "
        "comparison. (default: what suits the result)",
    ),
]  # fmt: skip
SweepFile = Annotated[
    Path | None,
    _output("--sweep", metavar="FILE", text="A saved map over the axis of the diagram FILE: draws its index on top."),
]


def _orbit(*names: str, metavar: str, text: str) -> object:
    return Option(*names, metavar=metavar, rich_help_panel="Which orbits", help=text)


OrbitPeriods = Annotated[_Text, _orbit("--periods", metavar="N", text="Driving periods in a cycle. (default: 1)")]
OrbitImpacts = Annotated[
    _Text,
    _orbit("--impacts", metavar="P", text="Impacts in a cycle; -1 for one that sticks after a chatter. (default: 1)"),
]
Near = Annotated[
    _Text,
    _orbit(
        "--near", metavar="PHASE,VELOCITY",
        text="Phase, 0 to 1, and velocity in m/s of an impact to begin the search at. (default: from rest and a grid)",
    ),
]  # fmt: skip
PeriodsList = Annotated[
    _Text, _orbit("--periods", metavar="N,N", text="Driving periods in a cycle, one or several. (default: 1,2)")
]
Kinds = Annotated[
    _Text,
    _orbit(
        "--kind", metavar="KINDS",
        text="Comma-separated: fold, period-doubling, grazing, end-of-sticking. (default: all)",
    ),
]  # fmt: skip


def _span(*names: str, text: str) -> object:
    return Option(*names, metavar="NAME=FROM:TO", rich_help_panel="Axes", help=text)


Span = Annotated[
    _Text,
    _span("--x", text="The parameter to vary and its range: omega=0.8:3, or omega=0.8:3:400 with --diagram."),
]
SpanX = Annotated[_Text, _span("--x", text="The first parameter of the plane and its range: omega=0.025:5.")]
SpanY = Annotated[_Text, _span("--y", text="The second one: mass=0.1:5.")]
StartX = Annotated[
    _Text,
    _axis("--x", text="phase=0:1:200 of impacts, or displacement=-3:0:200 of states. (default: phases 0 to 1)"),
]
StartY = Annotated[_Text, _axis("--y", text="velocity=0:3:200, in m/s. (default: 0 to 4 max(f, k|g|)/sqrt(km))")]
StartPhase = Annotated[
    _Text,
    Option("--phase", metavar="PHI", rich_help_panel="Axes", help="Of all states, with displacement. (default: 0)"),
]
Step = Annotated[
    _Text, _how("X", "Longest step along a curve, in parts of the ranges and of a driving period. (default: 0.01)")
]
Lines = Annotated[_Text, _how("N", "Lines across the plane, each way, that boundaries are looked for on. (default: 5)")]
Doublings = Annotated[
    _Text, _how("N", "How often to go on along the doubled orbits born at period doublings. (default: 0)")
]
OverDiagram = Annotated[
    bool,
    Option(
        "--diagram", rich_help_panel="Output",
        help="Draw the figure over the bifurcation diagram of the settled motion. (400 values, or those of --x)",
    ),
]  # fmt: skip
OverMap = Annotated[
    Path | None,
    _output("--over", metavar="FILE", text="A saved map over the same plane, drawn beneath the boundaries."),
]
OrbitOut = Annotated[
    Path | None,
    _output("--out", "-o", metavar="FILE", text="Data: .json .csv .zarr .nc .mat. Without it: a table in words."),
]
Json = Annotated[bool, Option("--json", rich_help_panel="Output", help="Tell it as JSON.")]
Vary = Annotated[
    _Text,
    Option(
        "--vary", metavar="NAMES", rich_help_panel="What to compute",
        help="Comma-separated: the parameters varied in search of boundaries and remedies. (default: all seven)",
    ),
]  # fmt: skip
Within = Annotated[
    _Text,
    Option(
        "--within", metavar="X", rich_help_panel="What to compute",
        help="How far: from value/(1+X) to value*(1+X). (default: 3)",
    ),
]  # fmt: skip
CompareOut = Annotated[
    Path | None,
    _output(
        "--out", "-o", metavar="FILE",
        text="A figure (.png .svg .pdf) or data (.zarr .nc .csv .mat .json). The table is told in any case.",
    ),
]  # fmt: skip
