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
        "frequency (Hz), restitution (r), gap (g, m). Repeat it for more. Defaults are the paper's: "
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
        help="Comma-separated: std, mean_velocity, max_velocity, impacts_per_period. (default: std)",
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
    _Text, _output("--index", metavar="NAME", text="Index a figure of a sweep shows. (default: the first)")
]
Level = Annotated[
    _Text, _output("--level", metavar="X", text="Where a contour draws the boundary, in the unit of the index.")
]
PlotKind = Annotated[
    _Text,
    _output(
        "--kind", metavar="KIND",
        text="time-history, phase-portrait, impact-map, stroboscopic-map, bifurcation-diagram, index-curve, "
        "index-contour or index-surface. (default: what suits the result)",
    ),
]  # fmt: skip
SweepFile = Annotated[
    Path | None,
    _output("--sweep", metavar="FILE", text="A saved map over the axis of the diagram FILE: draws its index on top."),
]
