"""A verdict on a system: what holds for any number of coordinates and stops, and its lines in words."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact import report
from vibroimpact.coexistence.losses import lasting_stops
from vibroimpact.motion import MotionClass, listed
from vibroimpact.parameters import counted
from vibroimpact.verdict.text import KNOWN, LISTED, edge_words, hardest_line, lines, number, parameters_line, speed

if TYPE_CHECKING:
    from vibroimpact.verdict.describe import Verdict

TOUCHING = (
    1e-9  # of what a clearance is the difference of: one so small is a contact; of speeds and impulses: they are equal
)
BESIDE = 1e-3  # per period: an exponent so small says nothing of whether perturbations decay


def lines_of_system(verdict: Verdict) -> Iterator[str]:
    """Yield the lines of a verdict on a system."""
    yield from lines(verdict, {
        "system": _system, "motion": _motion, "hits": _hits, "stability": _stability, "boundaries": _boundaries
    })  # fmt: skip


def _system(verdict: Verdict) -> Iterator[str]:
    yield str(verdict.oscillator)
    yield parameters_line(verdict.model)


def _motion(verdict: Verdict) -> Iterator[str]:
    system, motion, kind = verdict.oscillator, verdict.motion, verdict.motion.motion_class
    if motion.n_periods:
        yield f"from rest {motion.name}, repeats every {motion.n_periods * system.period:.4g} s"
    elif kind in (MotionClass.CHAOTIC, MotionClass.QUASI_PERIODIC):
        yield f"from rest {motion.name}, watched over {verdict.watched} impacts"
    elif kind == MotionClass.UNDECIDED and (lasting := lasting_stops(system)).any():
        names = listed([name for name, lasts in zip(system.stop_names, lasting, strict=True) if lasts])
        yield f"from rest undecided: impacts on {names} lose no energy, so that no motion with them attracts others"
    elif kind == MotionClass.UNDECIDED:
        yield f"from rest undecided: the impacts do not repeat within {verdict.watched}, nor are they surely chaotic"
    elif kind == MotionClass.BUDGET:
        yield f"from rest {motion.name}: {verdict.motion.status.sentence}"
    else:
        yield f"from rest {motion.name}{_clear_of(verdict)}"
    yield from hardest_line(verdict)


def _clear_of(verdict: Verdict) -> str:
    """Return the distance of a motion without impacts from which stop, or which it rests at or is pressed into."""
    here, system = next((one for one in verdict.attractors if one.from_rest), None), verdict.oscillator
    if here is None or not system.stops:
        return ""
    if verdict.kind == "no_impact" and not system.modal().squares.all():
        return ", it never comes back to a stop"
    if verdict.kind == "no_impact":
        left = dict(zip(system.stop_names, system.cells({}).block("margin")[0].tolist(), strict=True))
        name = min(left, key=lambda stop: left[stop])
        return f", at least {report.quantity(left[name], 'm', 3)} clear of {name}"
    q, left = here.start.displacement, system.clearances(here.start.displacement, here.start.time).tolist()
    sizes = [abs(stop.gap) + float(np.abs(stop.direction) @ np.abs(q)) for stop in system.stops]
    at = [stop for stop, gap, size in zip(system.stops, left, sizes, strict=True) if gap <= TOUCHING * size]
    rigid, compliant = ([stop.name for stop in at if stop.compliant is gives] for gives in (False, True))
    return (f", at rest at {listed(rigid)}" if rigid else "") + (
        f", pressed into {listed(compliant)}" if compliant else ""
    )


def _hits(verdict: Verdict) -> Iterator[str]:
    motion, orbit, system = verdict.motion, verdict.orbit, verdict.oscillator
    hits = list(zip(motion.velocities, motion.phases, verdict.stops, strict=True))
    if not hits:
        if math.isfinite(verdict.max_velocity) and verdict.max_velocity > 0.0:
            rate, mean = (verdict.indices[name] for name in ("impacts_per_period", "mean_velocity"))
            yield (
                f"about {rate:.2g} times per period, hardest {speed(verdict.max_velocity)} sampled, mean about "
                f"{mean:.2g} m/s"
            )
        return
    for stop in system.stop_names:
        own = [(v, phase) for v, phase, name in hits if name == stop]
        if not own:
            yield f"{stop}: none"
            continue
        hardest = max(own)
        often = f"{counted(len(own), 'impact')} per cycle"
        if motion.n_impacts < 0:
            yield f"{stop}: hardest {speed(hardest[0])} at phase {hardest[1]:.3g}"
        elif len(own) <= LISTED:
            yield f"{stop}: {often}, " + listed([f"{speed(v)} at phase {phase:.3g}" for v, phase in own])
        else:
            yield f"{stop}: {often}, {min(own)[0]:.4g} to {speed(hardest[0])}, hardest at phase {hardest[1]:.3g}"
    if motion.n_impacts < 0:
        yield "in its cycle it comes to rest at a stop after infinitely many impacts"
    elif orbit is not None:
        most = next(at for at, kick in enumerate(orbit.impulses) if kick >= (1.0 - TOUCHING) * max(orbit.impulses))
        yield f"largest impulse {report.quantity(orbit.impulses[most], 'N s', 4)} on {orbit.stops[most]}"
        yield from _pressed(orbit)


def _pressed(orbit: Any) -> Iterator[str]:
    """Yield how hard, how long and how deep the hardest contact with a compliant stop is."""
    pressed = [pair for pair in zip(orbit.contacts, orbit.stops, strict=True) if pair[0].peak_force > 0.0]
    if pressed:
        contact, stop = max(pressed, key=lambda pair: pair[0].peak_force)
        force, time, depth = (
            report.quantity(value, unit, 4)
            for value, unit in ((contact.peak_force, "N"), (contact.contact_time, "s"), (contact.penetration, "m"))
        )
        yield f"largest force {force} on {stop}, which pushes for {time} and is pressed in by {depth}"


def _stability(verdict: Verdict) -> Iterator[str]:
    period, exponent = verdict.oscillator.period, verdict.indices["lyapunov"]
    if math.isnan(exponent):
        return
    if verdict.orbit is not None and math.isinf(exponent):
        yield "all multipliers are 0: perturbations vanish within a cycle"
    elif verdict.orbit is not None:
        largest = verdict.orbit.spectral_radius
        half = -math.log(2.0) / exponent
        pair = ", a complex pair" if abs(verdict.orbit.multipliers[0].imag) > 0.0 else ""
        yield (
            f"largest multiplier {largest:.4g} in size{pair}: perturbations halve every {number(half, 3)} s, "
            f"{number(half / period, 2)} periods (exponent {exponent:.4g} 1/s)"
        )
    elif math.isinf(exponent):
        yield "all coordinates come to rest at once, which erases all memory (exponent -inf)"
    elif verdict.kind == "chaotic":
        ahead = -math.log(KNOWN) / exponent / period
        yield (
            f"perturbations double about every {number(math.log(2.0) / exponent, 2)} s: a state known to {KNOWN:g} of "
            f"its size is predictable for about {number(ahead, 1)} periods"
        )
    elif abs(exponent) * period < BESIDE:
        yield "perturbations neither decay nor grow"
    else:
        yield f"perturbations {'decay' if exponent < 0.0 else 'grow'} (exponent about {exponent:.2g} 1/s)"


def _boundaries(verdict: Verdict) -> Iterator[str]:
    edges = verdict.boundaries
    if edges and verdict.orbit is None:
        yield "not sought: only those of periodic motions with impacts that never rest at a stop are followed"
        return
    for down, up in zip(edges[::2], edges[1::2], strict=True):
        if any(math.isnan(edge.searched_to) and not edge.found for edge in (down, up)):
            words = [f"{'down' if edge.direction < 0 else 'up'} not followed to its end" if math.isnan(edge.searched_to)
                     and not edge.found else edge_words(verdict.model, edge) for edge in (down, up)]  # fmt: skip
            yield f"{down.parameter}: {'; '.join(words)}"
        elif down.found or up.found:
            yield f"{down.parameter}: {edge_words(verdict.model, down)}; {edge_words(verdict.model, up)}"
        else:
            yield f"{down.parameter}: none from {down.searched_to:.4g} to {up.searched_to:.4g}"
    if any(edge.found for edge in edges):
        yield (
            "these solve the equations of the orbit from rest, to some 1e-11; two of one kind that lie nearer to each "
            "other than the steps along it, 2 to 8 % of a range, may both be missed"
        )
    if not edges and verdict.complete:
        yield "no parameter was varied"
