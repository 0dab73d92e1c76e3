"""The statements of a verdict on impacts: how often, how hard, at which phase and on which stop."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from vibroimpact import report
from vibroimpact.coexistence.measuring import EQUAL
from vibroimpact.motion import listed
from vibroimpact.parameters import counted
from vibroimpact.verdict.ranges import percent

if TYPE_CHECKING:
    from vibroimpact.verdict.describe import Verdict

IMPACTS = 4  # of a cycle, listed at most


def speed(velocity: float) -> str:
    """Return an impact velocity with its unit."""
    return report.quantity(velocity, "m/s", 4)


def is_one_mass(design: Any) -> bool:
    """Return whether a design is one mass in front of one stop; the stop then needs no name."""
    return bool(design.coordinates == len(design.stops) == 1)


def hardest_lines(verdict: Verdict) -> Iterator[str]:
    """Yield the hardest hits of all motions that initial conditions settle to, and the share that leads to them."""
    if (worst := verdict.worst) is None:
        return
    least = worst.max_velocity / (1.0 + EQUAL)
    equal = [each for each in verdict.attractors if each.reached and each.max_velocity >= least]
    share = sum(each.share for each in equal)
    place = f"from {percent(share)} of the initial conditions" if share else "from rest"
    sampled = "" if worst.repeats else " of those sampled"
    on = on_stop(worst.stop, not is_one_mass(verdict.oscillator)) if worst.stop else ""
    names = listed(list(dict.fromkeys(each.name for each in equal)))
    yield f"{speed(worst.max_velocity)}{on}{sampled}, {place} once settled: {names}{undecided_share(verdict)}"


def undecided_share(verdict: Verdict) -> str:
    """Return how many of the initial conditions are undecided, to be added to what the others come to."""
    return f"; {percent(verdict.undecided)} are undecided" if verdict.undecided else ""


def hit_lines(verdict: Verdict) -> Iterator[str]:
    """Yield how often and how hard the motion from rest hits, and the properties of contacts with compliant stops."""
    motion, design = verdict.motion, verdict.oscillator
    if not math.isfinite(verdict.max_velocity) or verdict.max_velocity == 0.0:
        return
    if not motion.velocities:
        yield _sampled(verdict)
        return
    hits = list(zip(motion.velocities, motion.phases, strict=True))
    if is_one_mass(design):
        rate = verdict.indices["impacts_per_period"]
        often = "once per period" if rate == 1.0 else f"{rate:.4g} times per period"
        chatter = "hardest " + _at_phase(*hits[0]) + ", followed by a complete chatter"
        yield chatter if motion.n_impacts < 0 else f"{often}: {_cycle_impacts(hits)}"
    else:
        yield from _on_each_stop(verdict, hits)
    if verdict.stops and verdict.orbit is not None:
        yield from _impulses(verdict.orbit, not is_one_mass(design))


def _sampled(verdict: Verdict) -> str:
    """Return the rate and speeds of impacts that do not repeat; with rests, the rate depends on the sample."""
    hardest = f"hardest {speed(verdict.max_velocity)} of those sampled"
    if verdict.kind == "sticking":
        return hardest
    names = "impacts_per_period", "mean_velocity", "impact_phase_spread"
    often, mean, spread = (verdict.indices[name] for name in names)
    if math.isinf(verdict.rate):
        return f"at ever shorter intervals, {hardest}, mean about {mean:.2g} m/s"
    if not verdict.oscillator.periodic:
        return f"about {verdict.rate:.2g} impacts per second, {hardest}, mean about {mean:.2g} m/s"
    phases = f"; phases spread {spread:.2g} (0 one phase, 1 uniform)" if math.isfinite(spread) else ""
    return f"about {often:.2g} times per period, {hardest}, mean about {mean:.2g} m/s{phases}"


def _on_each_stop(verdict: Verdict, hits: Sequence[tuple[float, float]]) -> Iterator[str]:
    """Yield the impacts of a cycle for each support, and the supports without impacts."""
    chatters, design, silent = verdict.motion.n_impacts < 0, verdict.oscillator, []
    support_of = dict(zip(design.stop_names, design.groups, strict=True))
    for name in dict.fromkeys(design.groups):
        struck = [hit for hit, stop in zip(hits, verdict.stops, strict=True) if support_of[stop] == name]
        if not struck:
            silent.append(name)
        elif chatters:
            yield f"{name}: hardest {_at_phase(*max(struck))}"
        else:
            yield f"{name}: {counted(len(struck), 'impact')} per cycle, {_cycle_impacts(struck)}"
    if silent:
        yield f"{listed(silent)}: none"
    if chatters:
        yield "in its cycle it comes to rest at a stop after infinitely many impacts"


def _cycle_impacts(hits: Sequence[tuple[float, float]]) -> str:
    """Return impacts of a cycle one by one if they are few."""
    if len(hits) <= IMPACTS:
        return listed([_at_phase(*hit) for hit in hits])
    hardest, phase = max(hits)
    return f"{min(hits)[0]:.4g} to {speed(hardest)}, hardest at phase {phase:.3g}"


def _at_phase(velocity: float, phase: float) -> str:
    return f"{speed(velocity)} at phase {phase:.3g}"


def _impulses(orbit: Any, named: bool) -> Iterator[str]:
    """Yield the largest impulse, and force, duration and depth of the hardest contact with a compliant stop."""
    most = next(at for at, kick in enumerate(orbit.impulses) if kick >= (1.0 - EQUAL) * max(orbit.impulses))
    yield f"largest impulse {report.quantity(orbit.impulses[most], 'N s', 4)}{on_stop(orbit.stops[most], named)}"
    pressed = [pair for pair in zip(orbit.contacts, orbit.stops, strict=True) if pair[0].peak_force > 0.0]
    if pressed:
        contact, stop = max(pressed, key=lambda pair: pair[0].peak_force)
        values = (contact.peak_force, "N"), (contact.contact_time, "s"), (contact.penetration, "m")
        force, time, depth = (report.quantity(value, unit, 4) for value, unit in values)
        yield f"largest force {force}{on_stop(stop, named)}, which pushes for {time} and is pressed in by {depth}"


def on_stop(stop: str, named: bool) -> str:
    """Return the stop that is struck, if it needs a name."""
    return f" on {stop}" if named else ""
