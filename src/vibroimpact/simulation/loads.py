"""Loads in pieces: a motion that goes on from one force to the next."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vibroimpact.backends import TimesWindow
from vibroimpact.backends.contacts import contact_within
from vibroimpact.backends.effects import States
from vibroimpact.backends.rests import rest_impulses
from vibroimpact.cells import Floats
from vibroimpact.dataset import status_variable
from vibroimpact.labels import of_one_mass, taken_by_stops, trajectory_of
from vibroimpact.model import as_system
from vibroimpact.model.balance import clearances
from vibroimpact.model.elements import NO_CONTACT, REPORTS, Contact
from vibroimpact.model.force import Force, checked_force
from vibroimpact.model.system import ImpactSystem
from vibroimpact.parameters import hertz, invalid, real_number, several
from vibroimpact.status import Status

if TYPE_CHECKING:
    from vibroimpact.sections import Followed

SAME = 1e-9  # periods: events that are so near the end of a piece are at its end
BRIEF = 2.0**-6  # driving periods, in which the end of a divided contact is sought first


@dataclass(frozen=True)
class Pieces:
    """Forces on a design, one after another: each until its end in s."""

    begin: float
    ends: list[float]
    forces: list[Force | None]
    systems: list[ImpactSystem]

    @classmethod
    def of(cls, design: Any, pieces: Any, begin: float) -> Pieces:
        """Return the pieces of a load, pairs of a duration in s and a force, after checking them."""
        ends, forces, systems = [begin], [], []
        hint = "write [(0.5, Force(constant=2.0)), (1.0, None)]"
        allowed = "a list of pairs of a duration in s and a Force or None"
        for at, piece in enumerate(several("pieces", pieces, allowed)):
            pair = several(f"pieces[{at}]", piece, "a duration in s and a Force or None")
            if len(pair) != 2 or not (pair[1] is None or isinstance(pair[1], Force)):
                raise invalid(f"pieces[{at}]", piece, "a duration in s and a Force or None", hint)
            seconds = real_number(f"pieces[{at}]", pair[0], "a duration in s, then a force")
            ends.append(ends[-1] + seconds)
            if not ends[-1] > ends[-2]:
                raise ValueError(f"`pieces[{at}]` must last longer than 0 s, got {seconds:g} s; leave it out")
            forces.append(pair[1])
            systems.append(_loaded(design, pair[1]))
        if not forces:
            raise invalid("pieces", pieces, "at least one pair of a duration in s and a force", hint)
        return cls(begin, ends[1:], forces, systems)

    def plain(self) -> list[Any]:
        """Return the durations and forces as numbers, lists and dictionaries."""
        lengths = np.diff(self.ends, prepend=self.begin).tolist()
        return [
            [length, None if force is None else force.plain()]
            for length, force in zip(lengths, self.forces, strict=True)
        ]

    def follow(self, run: Followed, times: Floats) -> dict[str, Any]:
        """Return the variables of `simulate` at times in s, from the initial condition of a run on."""
        now, cells = self.begin, self.systems[0].cells({}, run.start)
        parts: list[dict[str, Any]] = []
        statuses: list[Status] = []
        divided: dict[int, _Divided] = {}
        for end, system in zip(self.ends, self.systems, strict=True):
            until = times <= end if end == self.ends[-1] else times < end
            within = times[(times >= now) & until]
            looks = within if len(within) and within[-1] == end else np.append(within, end)
            turns = hertz(np.array([now, *looks]) * system.omega)
            samples = run.samples_of(system, cells, TimesWindow.of(turns[1:], turns[0]))
            states = run.states(system, cells, now, float(turns[-1] - turns[0]))
            impulses = rest_impulses(system, samples, -math.inf, float(turns[-1]), states)
            part = trajectory_of(samples, system) | taken_by_stops(samples, system, impulses)
            seconds = as_given(part["time"].values, looks)
            part["time"] = part["time"].copy(data=seconds)
            kept = {name: each[: len(within)] if each.dims[0] == "time" else each for name, each in part.items()}
            if parts:
                _carry_on(parts[-1], kept, now, SAME * system.period)
            parts.append(kept)
            statuses.append(Status(samples.status))
            if len(seconds) < len(looks):
                break
            divided = _divided(divided, kept, system, samples, turns, states)
            now, stops = float(seconds[-1]), samples.rest_stop[np.isnan(samples.rest_end).any(axis=1)]
            state = _held(system, samples.look_displacement[-1], samples.look_velocity[-1], now, stops)
            following = self.systems[min(len(parts), len(self.systems) - 1)]
            cells = following.cells({}).carried(*state, np.array([hertz(now * following.omega)]))
        rested = {Status.STICKING, Status.STUCK_FOREVER} & {*statuses} and statuses[-1] == Status.OK
        status = Status.STICKING if rested else statuses[-1]
        return of_one_mass(_joined(parts), run.design) | {"status": status_variable((), status)}


def as_given(sampled: Floats, seconds: Floats) -> Floats:
    """Return the times of samples, exactly as they were given where they differ by rounding alone."""
    seconds = seconds[: len(sampled)]
    return np.where(np.isclose(sampled, seconds, rtol=SAME, atol=0.0), seconds, sampled)


def _loaded(design: Any, force: Force | None) -> ImpactSystem:
    """Return a design under another force; one without a frequency keeps that of the design."""
    system: ImpactSystem = as_system(design)
    force = checked_force(force)
    if force.omega is None:
        force = Force(**{**force.arguments(), "omega": system.force.omega})
    moving = [stop.name for stop in system.stops if stop.motion]
    if moving and force.omega != system.force.omega:
        raise ValueError(
            f"`pieces` must keep the frequency of the model, {system.omega:g} rad/s, at which {moving[0]!r} moves; "
            f"got {force.omega:g} rad/s"
        )
    return ImpactSystem(**{**system.arguments(), "force": force})


def _held(system: ImpactSystem, q: Floats, v: Floats, time: float, stops: Any) -> tuple[Floats, Floats]:
    """Return a state with the stops that are held closed exactly: the nearest one in the norm sqrt(q . M q)."""
    held = [system.stops[stop] for stop in stops.tolist()]
    if not held:
        return q, v
    directions, angle = np.array([stop.direction for stop in held]), system.omega * time
    along = np.linalg.solve(system.mass, directions.T)
    places = np.array([stop.gap + stop.shift(angle) for stop in held]) - directions @ q
    rates = np.array([stop.speed(angle, system.omega) for stop in held]) - directions @ v
    moves = (np.linalg.lstsq(directions @ along, missing, rcond=None)[0] for missing in (places, rates))
    place, rate = (along @ move for move in moves)
    return q + place, v + rate


class _Divided(NamedTuple):
    """A contact that a switch divides: its row in the part in which it begins, and what it has taken so far."""

    part: dict[str, Any]
    row: int
    taken: Contact = NO_CONTACT

    def followed(self, stop: int, begin: float, end: float, within: Callable[..., Any]) -> _Divided | None:
        """Return the contact at the end of a span, in driving periods, after listing it; None if it is over by then."""
        length, over, since = BRIEF, False, self.part["impact_time"].values[self.row]
        while not over and length < 4.0 * (end - begin) + BRIEF:
            more, over, pushes = within(stop, (begin, min(begin + length, end)), since)
            length *= 4.0
        taken = self.taken.joined(more)
        for name, report in REPORTS.items():
            value = getattr(taken, name) + since * report.since
            self.part[name].values[self.row] = math.nan if pushes else value
        return None if over else self._replace(taken=taken)


def _divided(
    before: dict[int, _Divided], part: dict[str, Any], system: ImpactSystem, samples: Any, turns: Floats, states: States
) -> dict[int, _Divided]:
    """Return the contacts that go on at the end of a piece, by stop; what they have taken is listed."""
    begin, end = turns[[0, -1]].tolist()
    within = partial(contact_within, system, samples, end, states)
    after = {stop: contact.followed(stop, begin, end, within) for stop, contact in before.items()}
    impacts, angle = samples.impact_turns, np.array(2.0 * np.pi * samples.look_phase[-1])
    u = clearances(system, samples.look_displacement[-1], angle).tolist()
    for stop in (at for at, each in enumerate(system.stops) if not each.element.impenetrable and u[at] < 0.0):
        rows = np.flatnonzero((samples.impact_stop == stop) & (impacts < end - SAME))
        if after.get(stop) is None and len(rows):
            after[stop] = _Divided(part, int(rows[-1])).followed(stop, float(impacts[rows[-1]]), end, within)
    return {stop: contact for stop, contact in after.items() if contact is not None}


def _carry_on(before: dict[str, Any], after: dict[str, Any], now: float, near: float) -> None:
    """Join the rests and contacts of the pieces before and after a switch; events nearer than `near` are at it."""
    begin, release = after["stick_time"].values.copy(), before["release_time"].values.copy()
    resting, moves = np.abs(begin - now) <= near, np.zeros(len(release), bool)
    for row in np.flatnonzero(np.isnan(release)):
        same = np.flatnonzero(resting & (after["stick_stop"].values == before["stick_stop"].values[row]))
        release[row], moves[row] = now, len(same) > 0
        begin[same] = before["stick_time"].values[row]  # it may go on into the piece after
        after["stick_impulse"].values[same] += before["stick_impulse"].values[row]
    before["release_time"] = before["release_time"].copy(data=release)
    after["stick_time"] = after["stick_time"].copy(data=begin)
    _keep(before, "stick", ~moves)
    struck = after["impact_stop"].values[np.abs(after["impact_time"].values - now) <= near]
    again = (np.abs(before["impact_time"].values - now) <= near) & np.isin(before["impact_stop"].values, struck)
    _keep(before, "impact", ~(again & np.isnan(before["impulse"].values)))  # a contact that has just begun begins after


def _keep(part: dict[str, Any], dim: str, rows: Any) -> None:
    """Keep some rows along a dimension, in this order."""
    part.update({name: each[rows] for name, each in part.items() if each.dims[0] == dim})


def _joined(parts: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the variables of the parts, one after another."""
    first, join = parts[0], type(parts[0]["time"]).concat
    joined = {
        name: each if each.dims[0] == "stop" else join([part[name] for part in parts], each.dims[0])
        for name, each in first.items()
    }
    _keep(joined, "stick", np.argsort(joined["stick_time"].values, kind="stable"))
    return joined
