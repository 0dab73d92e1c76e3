"""A verdict in words, line by line.

One mass in front of one stop needs no names: it hits "the stop". With several stops or coordinates, each stop is named.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact import report
from vibroimpact.coexistence.losses import CONTINUUM, attracts, lasting_stops
from vibroimpact.coexistence.measuring import EQUAL, PAPER, QUIET, SPREAD
from vibroimpact.model import as_system
from vibroimpact.motion import MotionClass, listed
from vibroimpact.showing import Table, aligned, wrapped
from vibroimpact.verdict.advice import INSTANTS
from vibroimpact.verdict.changes import advice_text, boundary_facts, number, parameters_line
from vibroimpact.verdict.hits import hardest_lines, hit_lines, is_one_mass, on_stop, speed
from vibroimpact.verdict.present import Coexisting, step_limit
from vibroimpact.verdict.ranges import percent

if TYPE_CHECKING:
    from vibroimpact.verdict.describe import Verdict

MARGIN, WIDTH = 12, 88  # characters: of the titles, and of a line
PRECISION = 1e-6  # of the motion's size: how well a state is known whose future is predicted
NEUTRAL = 1e-3  # per period: an exponent so small says nothing of whether perturbations decay
CHANGES = 3  # advised, listed at most
MOTIONS = 12  # coexisting, listed at most
HARDER = 1.02  # times the hits of a motion: transients that hit so hard are mentioned
FIRST = PAPER.transient + PAPER.keep  # impacts that a map computes of a motion
INDENT, CELL = "  ", 30  # of a table, and its widest cells

Fact = str | Table
Writer = Callable[["Verdict"], Iterator[Fact]]


def verdict_facts(verdict: Verdict) -> Iterator[tuple[str, list[Fact]]]:
    """Yield the titles of a verdict, each with its facts."""
    writers: dict[str, Writer] = {
        verdict.oscillator.kind: _model,
        "motion": _motion,
        "hits": hit_lines,
        "energy": _energy,
        "at rest": _rest,
        "stability": _stability,
        "boundaries": boundary_facts,
        "coexisting": _coexisting,
        "advice": _advice_lines,
    }
    for title, writer in writers.items():
        yield title, list(writer(verdict))
    if not verdict.complete:
        yield "stopped", [_stopped(verdict)]


def short_lines(verdict: Verdict) -> Iterator[str]:
    """Yield a verdict in at most six lines: the motion, the hardest hits of all motions, one piece of advice."""
    writers: dict[str, Writer] = {"motion": _motion, "hardest": hardest_lines, "advice": _advice_lines}
    yield from _laid_out((title, islice(writer(verdict), 1)) for title, writer in writers.items())
    if not verdict.complete:
        yield from _laid_out([("stopped", [_stopped(verdict)])])


def verdict_lines(verdict: Verdict) -> Iterator[str]:
    """Yield the lines of a verdict."""
    yield from _laid_out(verdict_facts(verdict))


def _laid_out(parts: Iterable[tuple[str, Iterable[Fact]]]) -> Iterator[str]:
    """Yield titled facts line by line; a table is below its title, because it is wide."""
    for title, facts in parts:
        for i, fact in enumerate(facts):
            head = (title if i == 0 else "").ljust(MARGIN)
            if isinstance(fact, str):
                yield from wrapped(fact, WIDTH, head, " " * (MARGIN + 2))
            else:
                yield from filter(None, [head.strip()])
                yield from (INDENT + line for line in aligned([fact.head, *fact.rows], CELL))


def _stopped(verdict: Verdict) -> str:
    """Return the reason why a verdict is incomplete: its cost has a limit, far above that of usual designs."""
    if verdict.steps < step_limit(verdict.oscillator):
        return "before the end; run it again to complete it"
    return (
        f"before the end, after {verdict.steps:.2g} certified steps: the motions of this design take too many, as its "
        "paces lie too far apart, or none repeats; name fewer `parameters`, or look at single motions with `simulate`"
    )


def _model(verdict: Verdict) -> Iterator[str]:
    if not verdict.oscillator.says_all:
        yield str(verdict.oscillator)
    yield parameters_line(verdict)


# The motion from rest


def _motion(verdict: Verdict) -> Iterator[str]:
    design, motion, kind = verdict.oscillator, verdict.motion, verdict.motion.motion_class
    if motion.n_periods:
        yield f"from rest {motion.name}, repeats every {motion.n_periods * design.period:.4g} s"
    elif kind == MotionClass.UNDECIDED:
        yield f"from rest undecided: {_why_undecided(verdict)}"
    elif kind in QUIET:
        yield f"from rest {_without_impacts(verdict)}"
    else:
        yield f"from rest {motion.sentence(design.period)}"
    yield from _watched(verdict)
    if worst := verdict.harder:
        share = percent(worst.share)
        yield f"hits hardest from {share} of the initial conditions: {worst.name}, {speed(worst.max_velocity)}"
    if design.says_all:
        yield from _beside_the_stop(verdict)


def _why_undecided(verdict: Verdict) -> str:
    design = verdict.oscillator
    if (lasting := lasting_stops(design)).any():
        names = listed([str(stop.name) for stop, lasts in zip(design.stops, lasting, strict=True) if lasts])
        on = "" if is_one_mass(design) else f" on {names}"
        return f"impacts{on} lose no energy, so that no motion with them attracts others"
    return f"the impacts do not repeat within {verdict.watched}, nor are they surely chaotic"


def _watched(verdict: Verdict) -> Iterator[str]:
    """Yield the number of impacts for which a motion was followed, if it did not soon repeat."""
    if verdict.releases:
        moved = sum(verdict.releases.values())
        ends = ", ".join(f"{number} to {name}" for name, number in verdict.releases.items())
        yield f"rounding decides when it next rests at the stop: of {moved} releases moved by up to 1e-11 V go {ends}"
    if verdict.transient and verdict.releases:
        yield f"not moved, the first {FIRST} impacts look {verdict.transient}"
    elif verdict.transient:
        how = "watched over" if verdict.kind == "undecided" else "certain after"
        yield f"{how} {verdict.watched} impacts: the first {FIRST} look {verdict.transient}"
    elif verdict.watched > FIRST:
        yield f"{'certain after' if verdict.motion.n_periods else 'watched over'} {verdict.watched} impacts"


def _beside_the_stop(verdict: Verdict) -> Iterator[str]:
    """Yield the amplitude of a motion of one mass without impacts, or the force that presses it on the stop."""
    osc = verdict.oscillator
    if verdict.kind == "no_impact" and 0.0 < osc.steady_amplitude < math.inf:
        yield f"it swings by {osc.steady_amplitude:.4g} m"
    if verdict.kind == "stuck_forever":
        yield f"the preload -k g = {abs(osc.stiffness * osc.gap):.4g} N against the force f = {osc.amplitude:.4g} N"


def _without_impacts(verdict: Verdict) -> str:
    """Return the name of a motion without impacts, and its distance from the nearest stop, or the stop it touches."""
    system, name = as_system(verdict.oscillator), verdict.motion.name
    said = ["the stop"] if is_one_mass(system) else system.stop_names
    present = next((motion for motion in verdict.attractors if motion.from_rest), None)
    if present is None:
        return verdict.motion.sentence(system.period)
    if verdict.kind == "no_impact" and not system.modal().squares.all():
        return f"{name}, it never comes back to a stop"
    if verdict.kind == "no_impact":
        margins = dict(zip(said, system.cells({}).block("margin")[0].tolist(), strict=True))
        nearest = min(margins, key=lambda stop: margins[stop])
        return f"{name}, at least {report.quantity(margins[nearest], 'm', 3)} clear of {nearest}"
    q = np.atleast_1d(present.start.displacement)
    clearances = system.clearances(q, present.start.time).tolist()
    sizes = [abs(stop.gap) + float(np.abs(stop.direction) @ np.abs(q)) for stop in system.stops]
    held: dict[str, list[str]] = {}
    for stop, called, gap, size in zip(system.stops, said, clearances, sizes, strict=True):
        if gap <= EQUAL * size:
            held.setdefault(stop.element.holds, []).append(called)
    places = [f"{words} {listed(names)}" for words, names in sorted(held.items())]
    if name not in " ".join(places):  # "at rest at the stop" says that it rests
        places.insert(0, name)
    return ", ".join(places)


def _energy(verdict: Verdict) -> Iterator[str]:
    about, digits = ("", 4) if verdict.motion.n_periods or not verdict.power else ("about ", 2)
    if math.isfinite(verdict.power):
        stop, power = "stops" if len(verdict.oscillator.stops) > 1 else "stop", f"{verdict.power:.{digits}g} W"
        if not verdict.oscillator.periodic:
            yield f"{about}{power} lost at the {stop} on average"
            return
        lost = verdict.indices["dissipation"]
        yield f"{about}{lost:.{digits}g} J lost at the {stop} per period, {power} on average"


def _rest(verdict: Verdict) -> Iterator[str]:
    share = verdict.indices["stick_fraction"]
    if share > 0.0:
        article = "a" if len(verdict.oscillator.stops) > 1 else "the"
        yield f"{100.0 * share:.3g} % of the time at rest at {article} stop"


def _stability(verdict: Verdict) -> Iterator[str]:
    design, orbit, period = verdict.oscillator, verdict.orbit, verdict.oscillator.period
    solved = orbit is not None and verdict.kind == "periodic"
    exponent = orbit.lyapunov if solved else verdict.indices["lyapunov"]
    if math.isnan(exponent) or (verdict.kind == "undecided" and not (design.periodic or attracts(design))):
        return  # without loss and load, perturbations grow in proportion to time
    if math.isinf(exponent) and solved:
        yield "all multipliers are 0: perturbations vanish within a cycle"
    elif math.isinf(exponent) and verdict.releases and not verdict.motion.n_periods:
        yield (
            "each rest at the stop erases all memory, but perturbations grow before the next rest, which cannot be "
            "predicted"
        )
    elif math.isinf(exponent):
        rest = "a rest at the stop" if is_one_mass(design) else "a rest of all coordinates at once"
        yield f"{rest} erases all memory: perturbations vanish (exponent -inf)"
    elif verdict.kind == "chaotic":
        ahead = -math.log(PRECISION) / exponent
        span = f"{number(ahead / period, 2)} periods" if design.periodic else f"{number(ahead, 2)} s"
        yield (
            f"perturbations double about every {number(math.log(2.0) / exponent, 2)} s (exponent about "
            f"{exponent:.2g} 1/s): a state known to {PRECISION:g} of its size is predictable for about {span}"
        )
    elif exponent < 0.0 and (solved or (verdict.kind == "periodic" and design.forgets)):
        half = -math.log(2.0) / exponent
        yield (
            f"{'' if is_one_mass(design) else _largest(orbit)}perturbations halve every {number(half, 3)} s, "
            f"{number(half / period, 2)} periods (exponent {exponent:.4g} 1/s)"
        )
    elif abs(exponent) * period < NEUTRAL:
        yield f"perturbations change in size by less than {100.0 * NEUTRAL:g} % per period"
    else:
        yield f"perturbations {'decay' if exponent < 0.0 else 'grow'} (exponent about {exponent:.2g} 1/s)"


def _largest(orbit: Any) -> str:
    """Return the size of the largest multiplier of an orbit."""
    pair = ", a complex pair" if orbit.multipliers[0].imag else ""
    return f"largest multiplier {orbit.spectral_radius:.4g} in size{pair}: "


# Other motions, and other designs


def _coexisting(verdict: Verdict) -> Iterator[str]:
    """Yield the motions that initial conditions settle to and, with several stops, the stops that they hit."""
    motions, design = verdict.attractors, verdict.oscillator
    sample, of = f"{SPREAD} spread initial conditions", " of the initial conditions"
    undecided = verdict.undecided
    if named := not is_one_mass(design):
        sample += f", impacts on {listed(list(dict.fromkeys(design.groups)))}"
    if len(motions) == 1 and not undecided:
        as_one = not design.forgets and motions[0].name in ("quasi-periodic", "intermittent sticking")
        comma, but = "," * named, f", but all {motions[0].name} motions count as one" * as_one
        yield f"none found: {sample}{comma} settle to this motion{but}{_slow(motions[0])}"
        return
    if named and motions:
        yield f"of {sample}:"
        of = ""
    for motion in motions[:MOTIONS]:
        lasting = " as far as it was watched" * (motion.chaotic or motion.name == "quasi-periodic")
        hit = f", hardest hit {speed(motion.max_velocity)}" if motion.max_velocity > 0.0 else ""
        hit += on_stop(motion.stop, named) if hit and motion.stop else ""
        rare = motion.share == 0.0 and not motion.from_rest
        none = "stable, but seen to be reached from none" if undecided else "stable, but reached from none of them"
        share = none if rare else f"{100.0 * motion.share:.3g} %{of}"
        this = " (this motion)" if motion.from_rest else ""
        yield f"{share}: {motion.name}{lasting}{this}{hit}{_slow(motion)}"
    if len(motions) > MOTIONS:
        yield f"and {len(motions) - MOTIONS} more"
    if motions and undecided:
        yield f"{100.0 * undecided:.3g} %{of}: {'undecided' if design.energy_changes else CONTINUUM}"


def _slow(motion: Coexisting) -> str:
    """Return the duration and the hardest hit of the longest transient in words, if they are notable."""
    long = motion.transient_impacts > FIRST
    if not (long and motion.repeats and motion.transient_velocity > HARDER * motion.max_velocity):
        return ""
    often = number(motion.transient_impacts, 2)
    return f", some after up to {often} impacts and hits of up to {speed(motion.transient_velocity)}"


def _advice_lines(verdict: Verdict) -> Iterator[str]:
    """Yield the advice that softens the impacts."""
    if not verdict.complete:
        return
    if verdict.worst is None and verdict.kind == "budget":
        yield "none, as the motion from rest was not followed to its end"
    elif verdict.worst is None and verdict.undecided:
        share = f"{100.0 * verdict.undecided:.3g} %"
        which = "are undecided" if verdict.oscillator.energy_changes else "keep the energy with which they hit"
        yield f"none: once settled, no impacts from rest, but {share} of the initial conditions {which}"
    elif verdict.worst is None:
        yield f"once settled, no impacts from rest or from any of {SPREAD} spread initial conditions"
    elif not verdict.boundaries:
        yield "no parameter was varied"
    elif not verdict.advice:
        names = list(dict.fromkeys(edge.parameter for edge in verdict.boundaries))
        varied = "one parameter" if len(names) == len(verdict.model.values) else " or ".join(names) + " alone"
        yield f"no change of {varied} within its range softens the impacts from all initial conditions tried"
    else:
        smallest = verdict.advice[:CHANGES]
        ends = [advice for advice in verdict.advice if advice.benefit == "no_impact"]
        aims = {
            "to soften the impacts": [advice for advice in smallest if advice not in ends],
            "to end the impacts": [advice for advice in smallest if advice in ends] or ends[:1],
        }
        for aim, ways in aims.items():
            for i, advice in enumerate(ways):
                yield ("or " if i else f"{aim}, ") + advice_text(verdict.model, advice, verdict.units)
        if tried := [advice.tried for advice in verdict.advice if advice.tried]:
            yield (
                f"each holds from {min(tried)} initial conditions or more: rest, {SPREAD} spread ones and the present "
                f"motions, changed at {INSTANTS} instants of each cycle"
            )
