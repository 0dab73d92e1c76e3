"""Cases to begin with: the paper's, and four machines, each with the source of its numbers."""

from __future__ import annotations

from dataclasses import dataclass

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


def _paper(name: str, title: str, source: str, **view: object) -> Preset:
    idealised = "Dimensionless: every unit may be read as one. A point mass, a linear spring, a stop without mass."
    return Preset(name, title, View(**view), PAPER_RANGES, source, idealised)  # type: ignore[arg-type]


def _machine(
    name: str, title: str, osc: ImpactOscillator, x: str, y: str, ranges: dict[str, Range], source: str, idealised: str
) -> Preset:
    view = View(osc=osc, x=x, y=y, x_range=ranges[x], y_range=ranges[y], index="max_velocity")
    return Preset(name, title, view, ranges, source, idealised)


_LEE = "J.-Y. Lee, the paper that this package reproduces: m = 1, c = 0.01, k = 1, f = 1, r = 0.8, g = 0"

PRESETS: tuple[Preset, ...] = (
    _paper("paper-mass", "Paper: frequency and mass", f"{_LEE}; section 4, mass."),
    _paper(
        "paper-stiffness", "Paper: frequency and stiffness", f"{_LEE}; section 4, stiffness.",
        y="stiffness", y_range=(0.1, 5.0),
    ),
    _paper(
        "paper-damping", "Paper: frequency and damping", f"{_LEE}; section 4, damping.",
        y="damping", y_range=(0.005, 1.0),
    ),
    _paper(
        "paper-amplitude", "Paper: frequency and amplitude", f"{_LEE}; section 4, amplitude.",
        y="amplitude", y_range=(0.1, 5.0),
    ),
    _paper(
        "paper-restitution", "Paper: frequency and restitution", f"{_LEE}; section 4, restitution.",
        y="restitution", y_range=(0.1, 0.99),
    ),
    _paper(
        "gap", "Frequency and gap: grazing", f"{_LEE}, here with a gap, which the paper keeps at 0.",
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
        "Typical magnitudes, derived: steel tube 19.05 x 1.65 mm, water inside and moved along outside, 1.25 kg/m; its "
        "first mode over 1.5 m between tight supports, m = 1.25 L/2, k = pi^4 E I / (2 L^3), 16 Hz; damping ratio "
        "0.02, as usual for tubes in water (Pettigrew, Rogers and Axisa, Journal of Pressure Vessel Technology); "
        "radial clearance 0.2 mm at the loose support midway, half of TEMA's 1/64 inch on the diameter. Force and "
        "restitution are guesses: vary them.",
        "One mode in one plane and one side of the hole; the tube also slides, orbits and hits the other side. The "
        "support yields by about 1e7 N/m, a contact of a millisecond, and squeezes a film of water. Flow forces are "
        "random as well as periodic. Read trends and impact speeds, not wear.",
    ),
    _machine(
        "pipe", "Pipe in a worn clamp",
        ImpactOscillator(
            mass=11.4, damping=10.7, stiffness=99900.0, amplitude=60.0, omega=154.0, restitution=0.5, gap=-0.0002
        ),
        "omega", "amplitude",
        {
            "mass": (4.0, 40.0), "damping": (0.0, 200.0), "stiffness": (20000.0, 400000.0), "amplitude": (2.0, 200.0),
            "omega": (20.0, 400.0), "restitution": (0.0, 1.0), "gap": (-0.002, 0.002),
        },
        "Typical magnitudes, derived: 2 inch schedule 40 steel pipe full of water, 7.6 kg/m, first mode of a 3 m span, "
        "m = 7.6 L/2, k = pi^4 E I / (2 L^3), 15 Hz (span formulas: Wachel, Morton and Atkins, Piping vibration "
        "analysis); damping ratio 0.005; driven at a pump's 1470 rev/min; pressed against the lower jaw by 20 N. Force "
        "and restitution are guesses: vary them.",
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
        "Lines of 500 to 4000 kN/m give a large tanker natural periods of 148 to 52 s (Schellin and Ostergaard, Marine "
        "Structures 8, 1995), hence m = k T^2 / 4 pi^2 = 2.75e8 kg with its added water; they speak of surge, taken "
        "over for sway. Damping ratio 0.05, force, gap and restitution are typical magnitudes: vary them. A moored "
        "ship as an impact oscillator: Thompson, Bokaian and Ghaffari, Journal of Energy Resources Technology 106, "
        "1984.",
        "The weakest of the four: a fender is only some ten to fifty times stiffer than the lines, so contact lasts "
        "seconds; the restitution stands for all it swallows. Added mass changes with frequency, lines go slack.",
    ),
    _machine(
        "valve", "Relief valve on its seat",
        ImpactOscillator(
            mass=0.5, damping=4.0, stiffness=20000.0, amplitude=40.0, omega=260.0, restitution=0.8, gap=-0.001
        ),
        "omega", "amplitude",
        {
            "mass": (0.1, 2.0), "damping": (0.0, 40.0), "stiffness": (5000.0, 80000.0), "amplitude": (5.0, 200.0),
            "omega": (50.0, 1500.0), "restitution": (0.0, 1.0), "gap": (-0.004, 0.001),
        },
        "Typical magnitudes, derived: disc, holder and a third of the spring 0.5 kg; spring 20 N/mm; 32 Hz; pressed on "
        "the seat by 20 N, what the spring exceeds the mean pressure by; damping ratio 0.02. Valves as impact "
        "oscillators: Hos and Champneys, Physica D 241, 2012; Fotsch and Dankowicz, Procedia IUTAM 20, 2017.",
        "The pressure is a given sine here; in a real valve it falls as the disc lifts, and this feedback, with the "
        "waves in the inlet pipe, is what makes most valves chatter by themselves. Here only the answer to pulsation "
        "is shown. The upper stop is left out.",
    ),
)  # fmt: skip

BY_NAME = {preset.name: preset for preset in PRESETS}


def ranges_for(view: View, preset: str | None = None) -> dict[str, Range]:
    """Return how far each slider reaches: a preset's ranges, widened to hold the present values."""
    ranges = dict(BY_NAME[preset].ranges if preset in BY_NAME else _fitting(view))
    for name, (low, high) in ranges.items():
        value = getattr(view.osc, name)
        ranges[name] = (min(low, value), max(high, value))
    return ranges


def _fitting(view: View) -> dict[str, Range]:
    """Return the ranges of the preset whose sliders hold the point best: the most parameters, the narrowest first."""
    return max(PRESETS, key=lambda preset: _held(view, preset.ranges)).ranges


def _held(view: View, ranges: dict[str, Range]) -> int:
    return sum(low <= getattr(view.osc, name) <= high for name, (low, high) in ranges.items())
