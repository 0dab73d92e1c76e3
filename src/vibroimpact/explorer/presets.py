"""Cases to begin with: the paper's, and four machines, each with the source of its numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from vibroimpact.explorer.state import Range, View
from vibroimpact.oscillator import ImpactOscillator

# how far each slider reaches; the paper prints no ranges, these are those of the package's maps
PAPER_RANGES: dict[str, Range] = {
    "mass": (0.1, 5.0),
    "damping": (0.0, 1.0),
    "stiffness": (0.1, 5.0),
    "amplitude": (0.1, 5.0),
    "omega": (0.025, 5.0),
    "restitution": (0.0, 1.0),
    "gap": (-2.0, 2.0),
}


@dataclass(frozen=True)
class Preset:
    """A case: its view, where its numbers come from, and what a hard stop idealises in it."""

    name: str
    title: str
    view: View
    ranges: dict[str, Range]
    source: str
    idealised: str


_LEE = (
    "J.-Y. Lee, “Numerical analysis of impact vibration based on a bifurcation diagram with two varying control "
    "parameters”: m = 1, c = 0.01, k = 1, f = 1, r = 0.8, g = 0"
)


def _paper(name: str, title: str, source: str, **view: Any) -> Preset:
    idealised = "Dimensionless: every unit may be read as one. A point mass, a linear spring, a stop without mass."
    return Preset(name, title, View(case=name, **view), PAPER_RANGES, f"{_LEE}{source}", idealised)


def _machine(
    name: str, title: str, osc: ImpactOscillator, x: str, y: str, ranges: dict[str, Range], source: str, idealised: str
) -> Preset:
    view = View(osc=osc, x=x, y=y, x_range=ranges[x], y_range=ranges[y], index="max_velocity", case=name)
    return Preset(name, title, view, ranges, source, idealised)


_RANGES = ". It prints no ranges: those here are this package's."

PRESETS: tuple[Preset, ...] = (
    _paper("paper-mass", "Paper: frequency and mass", f"; section 4.1{_RANGES}"),
    _paper(
        "paper-stiffness", "Paper: frequency and stiffness", f"; section 4.3{_RANGES}",
        y="stiffness", y_range=(0.1, 5.0),
    ),
    _paper(
        "paper-damping", "Paper: frequency and damping", f"; section 4.2{_RANGES}",
        y="damping", y_range=(0.005, 1.0),
    ),
    _paper(
        "paper-amplitude", "Paper: frequency and amplitude", f"; section 4.4{_RANGES}",
        y="amplitude", y_range=(0.1, 5.0),
    ),
    _paper(
        "paper-restitution", "Paper: frequency and restitution", f"; section 4.5{_RANGES}",
        y="restitution", y_range=(0.1, 0.99),
    ),
    _paper(
        "gap", "Frequency and gap: grazing",
        ". Not in the paper, which keeps the gap at 0: here c = 0.1, and the gap is varied, so that orbits graze.",
        osc=ImpactOscillator(omega=0.8, gap=0.5, damping=0.1), y="gap", y_range=(-1.0, 2.0), index="motion",
    ),
    _machine(
        "tube", "Heat-exchanger tube in its support",
        ImpactOscillator(
            mass=0.94, damping=3.9, stiffness=9940.0, amplitude=4.0, omega=110.0, restitution=0.6, gap=0.0002
        ),
        "omega", "gap",
        {
            "mass": (0.3, 3.0), "damping": (0.0, 20.0), "stiffness": (2000.0, 40000.0), "amplitude": (0.2, 20.0),
            "omega": (20.0, 400.0), "restitution": (0.0, 1.0), "gap": (-0.0005, 0.001),
        },
        "Derived: ¾ inch steel tube, 19.05 × 1.65 mm, E = 200 GPa, full of water, with 1.2 times the water that it "
        "displaces moved along: 1.25 kg/m. First mode between tight supports L = 1.5 m apart, about the longest span "
        "that TEMA (table RCB-4.52) allows it, 1524 mm: m = 1.25 L/2, k = π⁴EI/(2L³), 16 Hz. A loose support midway: "
        "radial clearance 0.2 mm, half of TEMA's 1/64 inch on the diameter. Damping ratio 0.02, the order of what is "
        "measured on tubes in water (Pettigrew, Rogers and Axisa, Journal of Pressure Vessel Technology 133, 014002, "
        "2011). Added mass, force and restitution are guesses: vary them.",
        "One mode in one plane and one side of the hole; the tube also slides, orbits and hits the other side. Where "
        "the support yields by 10⁷ N/m, a contact lasts π√(m/k) = 1 ms of the 61 ms of a free swing; between them a "
        "film of water is squeezed. Flow forces are random as well as periodic. Read trends and impact speeds, not "
        "wear.",
    ),
    _machine(
        "pipe", "Pipe in a worn clamp",
        ImpactOscillator(
            mass=11.4, damping=10.7, stiffness=99800.0, amplitude=60.0, omega=154.0, restitution=0.5, gap=-0.0002
        ),
        "omega", "amplitude",
        {
            "mass": (4.0, 40.0), "damping": (0.0, 200.0), "stiffness": (20000.0, 400000.0), "amplitude": (2.0, 200.0),
            "omega": (20.0, 400.0), "restitution": (0.0, 1.0), "gap": (-0.002, 0.002),
        },
        "Derived: 2 inch schedule 40 steel pipe, 60.3 × 3.91 mm, E = 200 GPa, full of water, 7.6 kg/m; first mode of "
        "L = 3 m between hangers, their usual distance for it (10 ft): m = 7.6 L/2, k = π⁴EI/(2L³), 15 Hz, as for any "
        "uniform span (Wachel, Morton and Atkins, “Piping vibration analysis”, Proceedings of the 19th Turbomachinery "
        "Symposium, 1990). Driven at 1470 rev/min, the speed of a four-pole motor on 50 Hz. Damping ratio 0.005, the "
        "20 N that press it against the lower jaw, force and restitution are guesses: vary them.",
        "One jaw, hit squarely; a real clamp has two, with rubber or rust between, and moves with its frame. Below the "
        "amplitude 20 N the pipe never lifts off.",
    ),
    _machine(
        "ship", "Moored ship at a fender",
        ImpactOscillator(
            mass=2.75e8, damping=1.66e6, stiffness=1.0e6, amplitude=4.0e5, omega=0.12, restitution=0.4, gap=0.1
        ),
        "omega", "stiffness",
        {
            "mass": (1e8, 6e8), "damping": (0.0, 1e7), "stiffness": (5e5, 4e6), "amplitude": (5e4, 2e6),
            "omega": (0.02, 0.5), "restitution": (0.0, 1.0), "gap": (-1.0, 1.0),
        },
        "Lines of 500 to 4000 kN/m give a large tanker natural periods of 148 to 52 s (Schellin and Östergaard, “The "
        "vessel in port: mooring problems”, Marine Structures 8, 1995, 451-479), hence m = kT²/4π² = 2.75·10⁸ kg with "
        "the water moved along; they speak of surge, taken over for sway. Damping ratio 0.05, force, gap and "
        "restitution are guesses: vary them. Lee's introduction names Thompson, who studied a ship against a seawall.",
        "The weakest of the four: where fenders yield by 20 MN/m in all, a contact lasts π√(m/k) = 12 s of the 52 s of "
        "a driving period, and the restitution stands for all they swallow. Added mass changes with frequency, lines "
        "go slack. Waves are irregular, and in a random sea the subharmonic and chaotic motions that a sine brings "
        "about are mostly gone (“Nonlinear marine structures with random excitation”, Journal of Offshore Mechanics "
        "and Arctic Engineering 110, 246).",
    ),
    _machine(
        "valve", "Relief valve on its seat",
        ImpactOscillator(
            mass=0.04, damping=3.7, stiffness=34590.0, amplitude=8.0, omega=1100.0, restitution=0.8, gap=0.0002
        ),
        "omega", "amplitude",
        {
            "mass": (0.01, 0.2), "damping": (0.0, 40.0), "stiffness": (10000.0, 150000.0), "amplitude": (1.0, 40.0),
            "omega": (200.0, 4000.0), "restitution": (0.0, 1.0), "gap": (-0.0005, 0.001),
        },
        "A direct-operated valve for 14 MPa with a port of 6 mm: moving parts of 40 g, a spring of 34.59 N/mm, 148 Hz, "
        "compressed by another 0.20 mm at the working point, which is the clearance to the seat (Wu, Li and Deng, "
        "“Stability analysis of a direct-operated seawater hydraulic relief valve under deep sea”, Mathematical "
        "Problems in Engineering 2017, 5676317, table 1). Derived: a ripple of 0.28 MPa on the port gives 8 N; a pump "
        "with 7 pistons at 1500 rev/min gives 175 Hz. Damping ratio 0.05, as if its damping sleeve, which in the paper "
        "keeps it quiet, had worn out, ripple and restitution are guesses: vary them.",
        "The pressure is a given sine here; in a real valve it falls as the poppet lifts, and this feedback, with the "
        "waves in the inlet pipe, is what makes most valves chatter by themselves (Licskó, Champneys and Hős, "
        "“Dynamical analysis of a hydraulic pressure relief valve”, World Congress on Engineering 2009). Only the "
        "answer to pulsation is shown. The upper stop is left out.",
    ),
)  # fmt: skip

BY_NAME = {preset.name: preset for preset in PRESETS}


def case_of(view: View) -> Preset | None:
    """Return the case that a view began with, or shows as it is."""
    same = (preset for preset in PRESETS if _unnamed(preset.view) == _unnamed(view))
    return BY_NAME.get(view.case) or next(same, None)


def ranges_for(view: View) -> dict[str, Range]:
    """Return how far each slider reaches: its case's ranges, widened to hold the view's point and plane.

    Without a case those of the one whose sliders hold the point best: the most parameters, the first of equals.
    """
    case = case_of(view) or max(PRESETS, key=lambda preset: _held(view, preset.ranges))
    ranges = dict(case.ranges)
    for name, (low, high) in ranges.items():
        value = getattr(view.osc, name)
        ranges[name] = (min(low, value), max(high, value))
    for name, (low, high) in ((view.x, view.x_range), (view.y, view.y_range)):
        ranges[name] = (min(ranges[name][0], low), max(ranges[name][1], high))
    return ranges


def _unnamed(view: View) -> tuple[Any, ...]:
    return view.osc, *view.plane_key, view.index


def _held(view: View, ranges: dict[str, Range]) -> int:
    return sum(low <= getattr(view.osc, name) <= high for name, (low, high) in ranges.items())
