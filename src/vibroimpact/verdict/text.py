"""A verdict in words, line by line."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from vibroimpact import report
from vibroimpact.coexistence.measuring import PAPER, SPREAD
from vibroimpact.model import Model
from vibroimpact.motion import listed
from vibroimpact.verdict.advice import INSTANTS, Advice
from vibroimpact.verdict.boundaries import NOISE, ONSETS, Edge
from vibroimpact.verdict.carried import LONG, PLACES
from vibroimpact.verdict.onsets import Onset
from vibroimpact.verdict.present import Coexisting, dearest, percent, range_of

if TYPE_CHECKING:
    from vibroimpact.verdict.describe import Verdict

MARGIN, WIDTH = 12, 110
KNOWN = 1e-6  # of the motion's size: how well a state is known whose future is predicted
ADVICE = 3  # changes listed, at most
LISTED = 4  # impacts of a cycle listed, at most
SHOWN = 12  # coexisting motions listed, at most
HARDER = 1.02  # times the hits of a motion: transients that hit so hard are told of
FINE = 1e-8  # relative: no machine is set so exactly
EXACT = 17  # digits that tell any two numbers apart
MANY_GAPS = 10.0  # a change so many times the gap is given relative to f/k alone
_TIED = "\u00a0"


Writer = Callable[["Verdict"], Iterator[str]]


def lines(verdict: Verdict, own: Mapping[str, Writer] | None = None) -> Iterator[str]:
    """Yield the lines of a verdict; `own` are writers for what is said of systems in other words."""
    writers: dict[str, Writer] = {
        "oscillator": lambda verdict: iter([parameters_line(verdict.model)]),
        "motion": _motion,
        "hits": _hits,
        "energy": _energy,
        "at rest": _rest,
        "stability": _stability,
        "boundaries": _boundaries,
        "coexisting": _coexisting,
        "advice": advice_lines,
    }
    if own is not None:
        writers = {"system": own["system"], **{title: writers[title] for title in list(writers)[1:]}, **own}
    yield from laid_out((title, writer(verdict)) for title, writer in writers.items())
    if not verdict.complete:
        yield from laid_out([("stopped", [stopped(verdict)])])


def laid_out(parts: Iterable[tuple[str, Iterable[str]]]) -> Iterator[str]:
    """Yield titled facts line by line."""
    for title, facts in parts:
        for i, line in enumerate(facts):
            yield from _wrapped((title if i == 0 else "").ljust(MARGIN), line)


def stopped(verdict: Verdict) -> str:
    """Return why a verdict is not complete: what it may cost has a limit, far above what usual designs take."""
    if verdict.steps < dearest(verdict.oscillator):
        return "before the end; run it again to complete it"
    return (
        f"before the end, after {verdict.steps:.2g} certified steps: the motions of this design take too many, as its "
        "paces lie too far apart, or none repeats; name fewer `parameters`, or look at single motions with `simulate`"
    )


def _wrapped(head: str, line: str) -> Iterator[str]:
    """Yield a line, broken where it is too long but not between a number and its unit, nor within N s/m."""
    kept = re.sub(r"(?<=\d) (?=%|[a-zA-Z/]+\b)|(?<=\bN) (?=s\b)", _TIED, line)
    for part in textwrap.wrap(kept, WIDTH, initial_indent=head, subsequent_indent=" " * (MARGIN + 2)):
        yield part.replace(_TIED, " ")


def speed(velocity: float) -> str:
    """Return an impact velocity with its unit."""
    return report.quantity(velocity, "m/s", 4)


def number(value: float, digits: int) -> str:
    """Return a number of so many digits, without a power of ten below a million."""
    return f"{float(f'{value:.{digits}g}'):g}"


def parameters_line(model: Model) -> str:
    """Return the parameters of a model in a line."""
    return ", ".join(f"{name} {quantity(model, name, value, 6)}" for name, value in model.values.items())


def quantity(model: Model, name: str, value: float, digits: int = 4) -> str:
    """Return a value of a parameter with its unit; an angular frequency also in Hz."""
    unit = model.parameters[name].unit
    text = report.quantity(value, unit, digits)
    return f"{text} ({value / (2.0 * math.pi):.{digits}g} Hz)" if unit == "rad/s" else text


def _motion(verdict: Verdict) -> Iterator[str]:
    osc, motion = verdict.oscillator, verdict.motion
    if motion.n_periods:
        yield f"from rest {motion.name}, repeats every {motion.n_periods * osc.period:.4g} s"
    else:
        yield f"from rest {motion.sentence(osc.period)}"
    yield from _watched(verdict)
    yield from hardest_line(verdict)
    if verdict.kind == "no_impact" and math.isfinite(osc.steady_amplitude):
        yield (
            f"it swings by {osc.steady_amplitude:.4g} m and stays {osc.gap - osc.steady_amplitude:.3g} m clear of the "
            "stop"
        )
    if verdict.kind == "stuck_forever":
        yield f"the preload -k g = {abs(osc.stiffness * osc.gap):.4g} N against the force f = {osc.amplitude:.4g} N"


def hardest_line(verdict: Verdict) -> Iterator[str]:
    """Yield which initial conditions lead to harder hits than rest does."""
    if worst := verdict.harder:
        share = percent(worst.share)
        yield f"hits hardest from {share} of the initial conditions: {worst.name}, {speed(worst.max_velocity)}"


def _watched(verdict: Verdict) -> Iterator[str]:
    """Yield over how many impacts a motion was watched that did not soon repeat."""
    first = PAPER.transient + PAPER.keep
    if verdict.releases:
        moved = sum(verdict.releases.values())
        ends = ", ".join(f"{number} to {name}" for name, number in verdict.releases.items())
        yield f"rounding decides when it next rests at the stop: of {moved} releases moved by up to 1e-11 V go {ends}"
    if verdict.transient and verdict.releases:
        yield f"not moved, the first {first} impacts look {verdict.transient}"
    elif verdict.transient:
        yield f"certain after {verdict.watched} impacts: the first {first} look {verdict.transient}"
    elif verdict.watched > first:
        yield f"watched over {verdict.watched} impacts"


def _hits(verdict: Verdict) -> Iterator[str]:
    motion, rate = verdict.motion, verdict.indices["impacts_per_period"]
    if not math.isfinite(verdict.max_velocity) or verdict.max_velocity == 0.0:
        return
    hardest = speed(verdict.max_velocity)
    if verdict.kind == "sticking":
        at = f" at phase {motion.phases[0]:.3g}" if motion.phases else ""
        some = f"{motion.n_impacts} per cycle" if motion.n_impacts > 0 else "followed by a complete chatter"
        yield f"hardest {hardest}{at}, {some}" if motion.n_periods else f"hardest {hardest} of those sampled"
    elif verdict.kind == "periodic" and motion.velocities:
        often = "once per period" if rate == 1.0 else f"{rate:.4g} times per period"
        pairs = list(zip(motion.velocities, motion.phases, strict=True))
        hits = ", ".join(f"{speed(velocity)} at phase {phase:.3g}" for velocity, phase in pairs[:LISTED])
        more = f", and {len(pairs) - LISTED} softer or equal" if len(pairs) > LISTED else ""
        yield f"{often}: {hits}{more}"
    else:
        yield (
            f"{rate:.3g} times per period on average, hardest {hardest} of {PAPER.keep} sampled, mean "
            f"{speed(verdict.indices['mean_velocity'])}; phases spread {verdict.indices['impact_phase_spread']:.2g} "
            "(0 one phase, 1 uniform)"
        )


def _energy(verdict: Verdict) -> Iterator[str]:
    lost, sampled = verdict.indices["dissipation"], verdict.of_system and not verdict.motion.n_periods
    about, digits = ("about ", 2) if sampled else ("", 4)
    if math.isfinite(lost):
        stop = "stops" if verdict.of_system else "stop"
        yield f"{about}{lost:.{digits}g} J lost at the {stop} per period, {verdict.power:.{digits}g} W on average"


def _rest(verdict: Verdict) -> Iterator[str]:
    share = verdict.indices["stick_fraction"]
    if verdict.kind == "sticking" and math.isfinite(share):
        yield f"{100.0 * share:.3g} % of the time at rest at {'a' if verdict.of_system else 'the'} stop"


def _stability(verdict: Verdict) -> Iterator[str]:
    period, exponent = verdict.oscillator.period, verdict.indices["lyapunov"]
    if verdict.orbit is not None and verdict.kind == "periodic":
        exponent = verdict.orbit.lyapunov
    if math.isnan(exponent):
        return
    if math.isinf(exponent) and verdict.releases and not verdict.motion.n_periods:
        yield "each rest at the stop erases all memory, but neighbours part before the next: none is foreseen"
    elif math.isinf(exponent):
        yield "a rest at the stop erases all memory: perturbations vanish (exponent -inf)"
    elif verdict.kind == "chaotic":
        ahead = -math.log(KNOWN) / exponent / period
        yield (
            f"perturbations double every {number(math.log(2.0) / exponent, 3)} s "
            f"(exponent {exponent:.4g} 1/s): a state known to {KNOWN:g} of its size is predictable for about "
            f"{number(ahead, 2)} periods"
        )
    elif exponent < 0.0 and verdict.kind == "periodic":
        half = -math.log(2.0) / exponent
        yield (
            f"perturbations halve every {number(half, 3)} s, {number(half / period, 2)} periods (exponent "
            f"{exponent:.4g} 1/s)"
        )
    elif abs(exponent) * period < NOISE:
        yield "perturbations neither decay nor grow"
    else:
        yield f"perturbations hardly decay or grow (exponent {exponent:.2g} 1/s)"


def _boundaries(verdict: Verdict) -> Iterator[str]:
    edges = verdict.boundaries
    for down, up in zip(edges[::2], edges[1::2], strict=True):
        if down.found or up.found or down.spacing or up.spacing or onset_words(down) or onset_words(up):
            yield f"{down.parameter}: {edge_words(verdict.model, down)}; {edge_words(verdict.model, up)}"
        elif math.isnan(down.searched_to) or math.isnan(up.searched_to):
            yield f"{down.parameter}: not sought, as the motion is not decided"
        else:
            span = " to ".join(f"{edge.searched_to:.4g}" for edge in (down, up))
            yield f"{down.parameter}: none from {span}"
    yield from _about_edges(verdict)


def _about_edges(verdict: Verdict) -> Iterator[str]:
    """Yield for which initial conditions boundaries hold, and what was sampled."""
    edges = verdict.boundaries
    if verdict.kind in ("no_impact", "stuck_forever") and any(edge.from_some for edge in edges):
        hitting = sum(motion.share for motion in verdict.attractors if motion.max_velocity > 0.0)
        if any(edge.from_some and edge.from_some.change == 0.0 and not edge.at_once for edge in edges):
            share = percent(hitting) if hitting else "some"
            yield f"here already {share} of the initial conditions settle to impacts"
        else:
            yield (
                f"up to there, at {PLACES} values per side, neither a start from rest nor the other ones tried go on "
                f"hitting for {LONG.transient + LONG.keep} impacts: windows between these values may lie nearer"
            )
    elif any(edge.found for edge in edges):
        yield "these hold for the motion from rest, carried along in small steps"
    if any(edge.spacing for edge in edges):
        yield "steps are those between the values tried: narrower windows of other motions may lie nearer"
    if any(edge.found and not edge.at_once and abs(edge.change) < FINE for edge in edges):
        yield f"changes of less than {percent(FINE)} lead to other motions: expect those around it in a machine"


def edge_words(model: Model, edge: Edge) -> str:
    """Return a boundary in words, such as 'up 3.1 % to 2.693 rad/s (period doubling; period-2 impact-2 at 2.695)'.

    Of a motion without impacts others come first, where they differ: from where on some initial condition settles to
    impacts, and a start from rest strikes the stop or settles to impacts.
    """
    way = "down" if edge.direction < 0 else "up"
    then = _seen_beyond(model, edge) if edge.beyond and edge.kind != "change" else ""
    if edge.at_once:
        return f"{way} at once ({edge.what}{then})"
    parts = [_place(model, edge, onset, [what]) for onset, what in onset_words(edge)]
    steps = f"in steps of {percent(edge.spacing)}{f' of {edge.of}' if edge.of else ''}" if edge.spacing else ""
    if edge.found:
        parts.append(_place(model, edge, edge, [edge.what + then, "" if edge.exact else edge.accuracy, steps]))
    else:
        own = "of the motion itself " if parts else ""
        parts.append(f"{own}none to {edge.searched_to:.4g}{f' ({steps})' if steps else ''}")
    return f"{way} {', '.join(parts)}"


def _seen_beyond(model: Model, edge: Edge) -> str:
    """Return the motion that was seen beyond an edge, and where."""
    if math.isnan(edge.beyond_at):
        return f"; {edge.beyond} beyond"
    return f"; {edge.beyond} at {report.quantity(edge.beyond_at, model.parameters[edge.parameter].unit, 6)}"


def onset_words(edge: Edge) -> list[tuple[Onset, str]]:
    """Return the sentences on where other motions begin to hit, the nearest first, and on what happens there."""
    values = {name: onset.value for name in ONSETS if (onset := getattr(edge, name))}
    if values.get("strikes") == values.get("from_rest"):
        values.pop("strikes", None)
    if values.get("from_some") == values.get("from_rest"):
        values.pop("from_some", None)
    known = [(getattr(edge, name), ONSETS[name]) for name, value in values.items() if value != edge.value]
    return sorted((part for part in known if part[0].change), key=lambda part: abs(part[0].change))


def _place(model: Model, edge: Edge, at: Edge | Onset, about: list[str]) -> str:
    """Return a value on the way along a parameter, and what is known of it."""
    present, digits = range_of(model, edge.parameter, 1.0).value, 6 if at.half_width == 0.0 else 5
    while digits < EXACT and f"{at.value:.{digits}g}" == f"{present:.{digits}g}" and at.value != present:
        digits += 1
    place = quantity(model, edge.parameter, at.value, digits)
    known = "; ".join(part for part in about if part)
    return f"{change_words(model, edge.parameter, at.value)} to {place} ({known})"


def change_words(model: Model, parameter: str, value: float) -> str:
    """Return the size of a change, of the gap also relative to the gap itself: '3.1 %', or '14 % (4.1 % of f/k)'."""
    varied = range_of(model, parameter, 1.0)
    size = varied.percent(value)
    if varied.of != "f/k" or not varied.value:
        return size
    share = abs(value / varied.value - 1.0)
    return f"{percent(share)} ({size})" if share < MANY_GAPS else size


def _coexisting(verdict: Verdict) -> Iterator[str]:
    """Yield the motions that initial conditions settle to; for systems, on which stops these are impacts."""
    motions, sample, of = verdict.attractors, f"{SPREAD} spread initial conditions", " of the initial conditions"
    undecided = 1.0 - sum(motion.share for motion in motions)
    if verdict.of_system:
        sample += f", impacts on {listed(list(verdict.oscillator.stop_names)) or 'no stop'}"
    if len(motions) == 1 and undecided < 1e-9:
        mixed = verdict.of_system and not motions[0].repeats
        comma, but = "," * verdict.of_system, f", but all {motions[0].name} motions count as one" * mixed
        yield f"none found: {sample}{comma} settle to this motion{but}{_slow(motions[0])}"
        return
    if verdict.of_system and motions:
        yield f"of {sample}:"
        of = ""
    for motion in motions[:SHOWN]:
        lasting = " as far as it was watched" * (verdict.of_system and motion.name in ("chaotic", "quasi-periodic"))
        hit = f", hardest hit {speed(motion.max_velocity)}" if motion.max_velocity > 0.0 else ""
        hit += f" on {motion.stop}" if hit and motion.stop else ""
        rare = motion.share == 0.0 and not motion.from_rest
        share = "stable, but reached from none of them" if rare else f"{100.0 * motion.share:.3g} %{of}"
        here = " (this motion)" if motion.from_rest else ""
        yield f"{share}: {motion.name}{lasting}{here}{hit}{_slow(motion)}"
    if len(motions) > SHOWN:
        yield f"and {len(motions) - SHOWN} more"
    if motions and undecided >= 1e-9:
        yield f"{100.0 * undecided:.3g} %{of}: undecided"


def _slow(motion: Coexisting) -> str:
    """Return the words on how long and hard initial conditions may hit before they settle, if that is notable."""
    long = motion.transient_impacts > PAPER.transient + PAPER.keep
    if not (long and motion.repeats and motion.transient_velocity > HARDER * motion.max_velocity):
        return ""
    often = number(motion.transient_impacts, 2)
    return f", some after up to {often} impacts and hits of up to {speed(motion.transient_velocity)}"


def advice_lines(verdict: Verdict) -> Iterator[str]:
    """Yield what softens the impacts."""
    if not verdict.complete:
        return
    if verdict.worst is None and verdict.kind == "budget":
        yield "none, as the motion from rest was not followed to its end"
    elif verdict.worst is None and (undecided := 1.0 - sum(motion.share for motion in verdict.attractors)) >= 1e-9:
        yield f"none: no impacts from rest, but {100.0 * undecided:.3g} % of the initial conditions are undecided"
    elif verdict.worst is None:
        yield f"no impacts from rest or from any of {SPREAD} spread initial conditions"
    elif not verdict.boundaries:
        yield "no parameter was varied"
    elif not verdict.advice:
        names = list(dict.fromkeys(edge.parameter for edge in verdict.boundaries))
        varied = "one parameter" if len(names) == len(verdict.model.values) else " or ".join(names) + " alone"
        yield f"no change of {varied} within its range softens the impacts from all initial conditions tried"
    else:
        smallest = verdict.advice[:ADVICE]
        ends = [advice for advice in verdict.advice if advice.benefit == "no_impact"]
        aims = {
            "to soften the impacts": [advice for advice in smallest if advice not in ends],
            "to end the impacts": [advice for advice in smallest if advice in ends] or ends[:1],
        }
        for aim, ways in aims.items():
            for i, advice in enumerate(ways):
                yield ("or " if i else f"{aim}, ") + advice_words(verdict.model, advice)
        if tried := [advice.tried for advice in verdict.advice if advice.tried]:
            yield (
                f"each holds from {min(tried)} initial conditions or more: rest, {SPREAD} spread ones and the present "
                f"motions, changed at {INSTANTS} instants of each cycle"
            )


def advice_words(model: Model, advice: Advice) -> str:
    """Return a piece of advice in words."""
    change = change_words(model, advice.parameter, advice.value)
    verb = "raise" if advice.change > 0.0 else "lower"
    head = f"{verb} {advice.parameter} by {change} to {quantity(model, advice.parameter, advice.value, 6)}: "
    if advice.benefit == "no_impact":
        return f"{head}{advice.motion}"
    softer = 100.0 * (1.0 - advice.max_velocity / advice.before)
    size = f"{abs(softer):.2g} % {'softer' if softer > 0.0 else 'harder'}"
    calmed = ", no longer chaotic" if advice.benefit == "no_chaos" else ""
    hits = f"hardest hit {advice.max_velocity:.4g} instead of {speed(advice.before)} ({size})"
    return f"{head}{advice.motion}{calmed}, {hits}"
