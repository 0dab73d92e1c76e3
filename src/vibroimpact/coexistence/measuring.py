"""Initial conditions as cells, and the computation and measurement of the motions from them."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from threading import Event
from typing import Any, NamedTuple

import numpy as np

from vibroimpact.backends import Cells, ImpactWindow, Measurement, StroboscopicWindow, get_backend
from vibroimpact.backends.base import Counts, Outcome, Samples
from vibroimpact.backends.scalar import expected_steps, outlast
from vibroimpact.execution.threads import run_sweep, worker_count
from vibroimpact.indices import INDICES
from vibroimpact.kernels.cell import MOST
from vibroimpact.model import Model, State
from vibroimpact.motion import Motion, MotionClass, decide
from vibroimpact.options import Tolerances
from vibroimpact.orbits.results import Search
from vibroimpact.orbits.search import stable_orbits
from vibroimpact.orbits.sticking import CREST
from vibroimpact.parameters import PACE, invalid
from vibroimpact.progress import duration
from vibroimpact.status import Status

SPREAD = 256  # initial conditions where none are given
ONE_IMPACT_PERIODS = 16  # up to which orbits of one impact are tried besides
PAPER = ImpactWindow(100, 5000)
HARDLY_EVER = 64  # periods: chaos in which the mass rests now and then is, strictly, a long sticking cycle
PROBES = 16  # cells, a block of lanes, that are tried first where all may exceed their budget
FIRST, LONG = 255, 60.0  # impacts of the first round for systems, and seconds of which a user is warned
LEAPS, MODES_COST = 6, 0.1  # expected steps that a leap of a stiff system takes; cost of a mode, relative to a step's
THRIFT = 100  # certified steps per impact: rare hits are not worth a long wait
PARTS = 8  # of a limit of steps, after each of which it is checked
EQUAL = 1e-9  # relative: speeds, impulses, shares and sums of lengths that differ by less are equal
QUIET = (MotionClass.NO_IMPACT, MotionClass.STUCK_FOREVER, MotionClass.AT_REST)
IDENTIFYING = (  # indices that name a motion and, with what `Cells.parting` adds, part attractors
    "mean_velocity",
    "max_velocity",
    "impacts_per_period",
    "lyapunov",
    "lyapunov_per_impact",
    "n_periods",
    "n_impacts",
    "dissipation",
)


class Start(NamedTuple):
    """The initial condition of a motion, as cells hold it: clearance to the stop in m, velocity in m/s, driving phase.

    Unlike a `State` it continues a motion bit for bit.
    """

    clearance: float
    velocity: float
    phase: float

    def cell(self, design: Model) -> Cells:
        """Return the cell of a design with this initial condition."""
        cells: Cells = design.at().cells({})
        return cells.replace(**self._asdict())


AT_REST = Start(0.0, 0.0, CREST)  # at the stop while the force presses most, waiting for the release


def cells_of(designs: Sequence[Model], starts: Sequence[Start | None] | None = None) -> Cells:
    """Return one cell per design, at least one; None as initial condition means at rest at min(0, gap)."""
    pairs = zip(designs, starts or [None] * len(designs), strict=True)
    return Cells.join([design.at().cells({}) if start is None else start.cell(design) for design, start in pairs])


def identifying(cells: Cells) -> tuple[str, ...]:
    """Return the indices that name the motion of each cell and distinguish attractors."""
    return *IDENTIFYING, *cells.parting


def spread_cells(cell: Cells, number: int = SPREAD) -> Cells:
    """Return impacts of a cell's design spread evenly over the impact surface, the same every time (`Cells.struck`)."""
    return cell.copies(number).struck(np.arange(number))


def orbit_cells(search: Search) -> list[Cells]:
    """Return an impact of each stable orbit of one impact in up to 16 periods; these are known in closed form."""
    periods = range(1, ONE_IMPACT_PERIODS + 1)
    return [carried(search.design, orbit.start) for n in periods for orbit in stable_orbits(search, n)]


def carried(osc: Any, start: State) -> Cells:
    """Return the cell of a design with that initial condition, moved in front of a stop if rounding puts it beyond."""
    cell: Cells = osc.cells({})
    return cell.carried(start.displacement, start.velocity, start.time * osc.omega / (2.0 * math.pi) % 1.0)


def warn_of_cost(osc: Any, number: int, runner: Runner) -> None:
    """Warn before the motions from initial conditions take minutes or more, as those of stiff systems do."""
    cell: Cells = osc.cells({})
    cost = PACE * osc.step_cost * (1.0 + MODES_COST * cell.coordinates) / runner.workers
    steps, most = float(expected_steps(cell, ImpactWindow(0, FIRST))[0]), float(LEAPS * MOST)
    seconds = cost * (number * steps if steps < most else PROBES * most)  # a few are tried if all may be given up
    if seconds > LONG and not osc.forgets:
        ratio = float(cell.fastest_rate[0] / cell.slowest_rate[0])
        warnings.warn(
            f"the motions from {number:,} initial conditions take about {duration(seconds)} or more: the fastest rate "
            f"of the model is {ratio:,.0f} times its slowest. Leave out modes that are faster than a contact (`modes` "
            "of a beam), or call attractors with fewer `starts`",
            stacklevel=3,
        )


def state_cells(osc: Any, starts: Iterable[State]) -> Cells:
    """Return one cell per state, or raise `ValueError` saying what is wrong with `starts`."""
    allowed = "a list of at least one State in front of the stop"
    if isinstance(starts, State):
        raise invalid("starts", starts, allowed, f"write starts=[{starts}]")
    try:
        states = list(starts)
    except TypeError:
        raise invalid("starts", starts, allowed, "leave it out for 256 spread ones") from None
    if not states:
        raise invalid("starts", states, allowed, "leave it out for 256 spread ones")
    for state in states:
        if not isinstance(state, State):
            raise invalid("starts", state, allowed, "write State(displacement, velocity=0.0, time=0.0)")
    checked = zip(*(osc.initial(state, "starts") for state in states), strict=True)
    q, speed, seconds = map(np.array, checked)
    cell: Cells = osc.cells({})
    return cell.copies(len(states)).carried(q, speed, seconds * osc.omega / (2.0 * math.pi))


@dataclass(frozen=True)
class Measured(Motion):
    """A motion as its indices name it, the indices, and the number of impacts computed until it was decided."""

    indices: dict[str, float] = field(default_factory=dict, compare=False)
    impacts: int = field(default=0, compare=False)

    @cached_property
    def group(self) -> tuple[str, int, int]:
        """What distinguishes classes of motion along a path; all that do not repeat, or hardly ever, are one class."""
        rare = self.n_periods > HARDLY_EVER or (self.motion_class == MotionClass.STICKING and not self.n_periods)
        if rare or self.motion_class in (MotionClass.CHAOTIC, MotionClass.UNDECIDED):
            return "aperiodic", 0, 0
        return self.kind, self.n_periods, self.n_impacts

    @cached_property
    def hardest(self) -> float:
        """The largest impact velocity in m/s; 0 without impacts, NaN if unknown."""
        return 0.0 if self.motion_class in QUIET else self.indices["max_velocity"]

    @property
    def loss(self) -> float:
        """Energy lost at the stop per driving period, in J; NaN if unknown."""
        return 0.0 if self.motion_class in QUIET else self.indices["dissipation"]


class SpentError(Exception):
    """No more motions are computed: the certified steps allowed have been taken, or the caller stops."""


class Runner:
    """The means of computing motions: back end, tolerances, threads, and the event that stops them.

    `measured` counts the motions measured, `steps` the certified steps of all motions; beyond `most` steps no more
    motions are begun. `fates` holds the final motion of a released mass, by design.
    """

    def __init__(self, backend: str = "cpu", tolerances: Tolerances | None = None, workers: int | None = None) -> None:
        self.engine = get_backend(backend)
        if not self.engine.known_indices.issuperset(IDENTIFYING):
            raise invalid("backend", backend, "one that computes n_periods and n_impacts")
        self.tolerances = Tolerances.of(tolerances)
        self.workers = worker_count(workers)
        self.stop = Event()
        self.measured = self.steps = 0
        self.most = math.inf
        self.fates: dict[Any, Any] = {}

    @property
    def thrifty(self) -> Tolerances:
        """The tolerances with which a motion is followed for long."""
        return replace(self.tolerances, steps_per_impact=min(self.tolerances.steps_per_impact, THRIFT))

    def run(
        self, cells: Cells, window: ImpactWindow, tolerances: Tolerances | None = None
    ) -> Iterator[tuple[Counts | slice, Outcome]]:
        """Yield which cells have ended, and the indices that identify their motions."""
        names = tuple(name for name in identifying(cells) if name in INDICES)
        for which, outcome in self.sweep(cells, Measurement(window, tolerances or self.tolerances, indices=names)):
            complete = outcome.keys() >= set(cells.parting)
            yield which, outcome if complete else outcome | self._first(cells[which], window)

    def _first(self, cells: Cells, window: ImpactWindow) -> Outcome:
        """Return the first impact that is kept of each motion, on the only stop, where a back end does not give it."""
        begun = Measurement(replace(window, keep=1), self.tolerances)
        firsts = [
            (*one.impact_phase[:1], *one.impact_velocity[:1]) or (math.nan, math.nan)
            for one in self.engine.samples(cells, begun)
        ]
        phase, velocity = np.array(firsts).reshape(-1, 2).T
        return {"first_stop": np.zeros(len(cells), np.int64), "first_phase": phase, "first_velocity": velocity}

    def sweep(self, cells: Cells, wanted: Measurement) -> Iterator[tuple[Counts | slice, Outcome]]:
        """Yield which cells have ended, and their results, and count their steps.

        If no flight of any of them seems short enough for its budget, some cells, spread over all, are tried first; if
        none of these ends, the others do not either.
        """
        number, dearest = len(cells), float(expected_steps(cells, wanted.impacts).max(initial=1.0))
        doubtful = number > PROBES and outlast(cells, wanted)
        order = np.argsort(np.arange(number) % (number // PROBES), kind="stable") if doubtful else np.arange(number)
        lost: Outcome = {}
        begun, before, size = 0, self.steps, PROBES if doubtful else self._affordable(dearest, number)
        while begun < number:
            part = order[begun : begun + size]
            begun += len(part)
            if self.steps >= self.most:
                raise SpentError
            if lost:
                yield part, {name: np.repeat(column, len(part)) for name, column in lost.items()}
                continue
            ended, batch = 0, cells if len(part) == number else cells[part]
            for which, outcome in run_sweep(self.engine, batch, wanted, self.workers, self.stop):
                self.steps += int(outcome["steps"].sum())
                ended += int(np.count_nonzero(outcome["status"] != Status.BUDGET))
                yield part[which], outcome
            if doubtful and not ended and not self.stop.is_set():
                counted = dict.fromkeys(("impacts", "steps"), np.zeros(1, int))
                lost = {name: column[:1] for name, column in outcome.items()} | counted
            size = self._affordable((self.steps - before) / begun, number)

    def _affordable(self, steps: float, number: int) -> int:
        """Return how many of a number of cells that take so many steps each are run before the limit is checked."""
        return max(int(min(self.most / PARTS / max(steps, 1.0), number)), 2 * PROBES)

    def measure(
        self,
        cells: Cells,
        window: ImpactWindow = PAPER,
        tolerances: Tolerances | None = None,
        names: tuple[str, ...] = IDENTIFYING,
    ) -> list[Measured]:
        """Return the motion of each cell, its kind by the rule of `classify`, and at least the indices that name it."""
        self.measured += len(cells)
        table = {name: np.full(len(cells), np.nan) for name in (*names, "status")}
        table["impacts"] = np.zeros(len(cells))
        for which, outcome in self.sweep(cells, Measurement(window, tolerances or self.tolerances, indices=names)):
            for name, column in table.items():
                column[which] = outcome[name]
        return _measured(table, window, names, winds=cells.coordinates > 1)

    def glance(self, cells: Cells, window: ImpactWindow) -> list[Measured]:
        """Return the motions of changed designs, of which those that hardly ever hit are given up."""
        return self.measure(cells, window, self.thrifty)

    def record(
        self,
        cell: Cells,
        sample_window: ImpactWindow,
        window: ImpactWindow = PAPER,
        tolerances: Tolerances | None = None,
    ) -> tuple[Measured, Samples]:
        """Return the motion of one cell as `measure` does, and the samples in another window, from one run."""
        self.measured += 1
        limits = tolerances or self.tolerances
        wanted = Measurement(window, limits, indices=tuple(INDICES))
        outcome, samples = self.engine.follow(cell, wanted, Measurement(sample_window, limits))
        self.steps += int(outcome["steps"].sum())
        return _measured(outcome, window, tuple(INDICES))[0], samples

    def samples(self, cells: Cells, window: ImpactWindow | StroboscopicWindow) -> list[Samples]:
        """Return the samples of each cell in the window."""
        if self.steps >= self.most:
            raise SpentError
        usual = Tolerances()
        patient = replace(  # what ended within its budget is looked at for longer than that
            self.tolerances,
            flight_periods=max(self.tolerances.flight_periods, usual.flight_periods),
            steps_per_impact=max(self.tolerances.steps_per_impact, usual.steps_per_impact),
        )
        samples = self.engine.samples(cells, Measurement(window, patient))
        self.steps += sum(sample.steps for sample in samples)
        return samples

    def follow(self, cells: Cells, impacts: int = 300) -> list[Start | None]:
        """Return the state of each motion after a number of impacts, or None if it could not be followed."""
        return [last_of(sample) for sample in self.samples(cells, ImpactWindow(impacts, 1))]


def last_of(samples: Samples) -> Start | None:
    """Return the state in which a recorded motion ended, or None if it could not be followed."""
    last = Start(max(samples.last_clearance, 0.0), float(samples.last_velocity[0]), samples.last_phase)
    return last if samples.status != Status.BUDGET and all(map(math.isfinite, last)) else None


def _measured(table: Outcome, window: ImpactWindow, names: Sequence[str], *, winds: bool = False) -> list[Measured]:
    growth, sampled = window.keep * table["lyapunov_per_impact"], window.keep if winds else 0
    kinds = decide(table["status"].astype(np.int8), growth, table["n_periods"], table["n_impacts"], sampled)
    rows = (dict(zip(names, row, strict=True)) for row in zip(*(table[name].tolist() for name in names), strict=True))
    columns = kinds.tolist(), table["status"].tolist(), rows, table["impacts"].tolist()
    return [named(*row) for row in zip(*columns, strict=True)]


def indices_of_cycle(n_periods: int, velocities: Sequence[float], phases: Sequence[float]) -> dict[str, float]:
    """Return the indices of impacts over exactly one cycle; those of a map are averages over a window."""
    return {
        "std": float(np.std(velocities)),
        "mean_velocity": float(np.mean(velocities)),
        "max_velocity": float(np.max(velocities)),
        "impacts_per_period": len(velocities) / n_periods,
        "impact_phase_spread": max(1.0 - abs(complex(np.exp(2j * np.pi * np.array(phases)).mean())), 0.0),
    }


def named(kind: int, status: float, indices: dict[str, float], impacts: float) -> Measured:
    """Return a motion of a kind, from its indices and the number of impacts computed."""
    n, p = int(indices["n_periods"]), int(indices["n_impacts"])
    return Measured(MotionClass(kind).word, n, p, status=Status(int(status)), indices=indices, impacts=int(impacts))
