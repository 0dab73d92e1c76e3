"""Sections 3 and 3.1: periods and resonances along the driving frequency, and sticking at low frequencies."""

from __future__ import annotations

from functools import partial

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.motion import Motion
from vibroimpact.parameters import counted
from vibroimpact.studies.lee.claims import Outcome, Section
from vibroimpact.studies.lee.laboratory import (
    Flags,
    Laboratory,
    aperiodic,
    intervals,
    periodic,
    repeats,
    sticks,
)
from vibroimpact.studies.lee.paper import OSCILLATOR, WINDOW
from vibroimpact.studies.lee.rules import all_of, fills_interval, is_true, nearly_all, printed_value

general = Section("3")
sticking = Section("3.1")


# Section 3: periods and resonances along the driving frequency.

general.value(
    "the resonance of free oscillation is w_n = sqrt(k/m) = 1", "1", "rad/s",
    lambda lab: OSCILLATOR.natural_frequency, what="w_n",
)  # fmt: skip


def _cycles(lab: Laboratory, at_most: int, longest: int = 64) -> list[tuple[float, Motion]]:
    """Return about `at_most` frequencies of the scan, evenly chosen, that have a cycle of up to `longest` periods."""
    scan = lab.scan()
    cycles = [(float(w), m) for w, m in zip(scan.omega, scan.motions, strict=True) if periodic(m)]
    cycles = [(omega, motion) for omega, motion in cycles if motion.n_periods <= longest]
    return cycles[:: max(1, len(cycles) // at_most)]


def _split(cycles: list[tuple[float, Motion]], flags: list[bool]) -> tuple[float, Floats, Flags]:
    """Return the share of flagged cycles, all their frequencies, and the flags as an array."""
    return float(np.mean(flags)), np.array([omega for omega, _ in cycles]), np.array(flags)


@general.claim(
    "the data from the first 100 s are excluded to ensure a steady system state", "steady from 100 s on", importance=7
)
def steady_after_100_s(lab: Laboratory) -> Outcome:
    """Compare the exact orbit's impacts in the paper's window with the settled cycle, 1 % of V apart at most."""
    cycles, settled = _cycles(lab, 100), []
    for omega, motion in cycles:
        velocities = lab.window(backend="cpu", omega=omega).velocity
        nearest = np.abs(velocities[:, None] - np.array(motion.velocities)[None]).min(axis=1, initial=np.inf)
        settled.append(not np.any(nearest > 0.01 * OSCILLATOR.velocity_scale))
    share, frequencies, flags = _split(cycles, settled)
    return Outcome(
        nearly_all(share, "the frequencies with a periodic motion have settled to 1 % of V within the window"),
        f"settled at {share:.1%} of {len(cycles)} frequencies",
        f"from rest, these periodic motions are still transient after {WINDOW[0]:g} s: "
        f"{intervals(frequencies, ~flags)}",
    )


def _poincare_period(lab: Laboratory, n: int, omega: float) -> Outcome:
    looks = lab.distinct_looks(omega)
    points = counted(looks, "distinct point")
    rule = is_true(looks == n, "the settled Poincaré map has n distinct points")
    return Outcome(rule, points, f"the Poincaré map at w = {omega:g} has {points} to 1e-6 of V")


def _resonance(lab: Laboratory, printed: str, word: str) -> Outcome:
    omega, height = lab.peak(float(printed))
    impacts = lab.motion(omega=omega).n_impacts
    return Outcome(
        all_of([printed_value(omega, printed), is_true(impacts == 1, "the motion at the peak hits once a cycle")]),
        f"peak {height:.4g} m/s at w = {omega:.4g}",
        f"the {word} peak of the impact velocity lies at w = {omega:.4g} on an impact-{impacts} motion",
    )


for _n, _omega, _word in ((1, 2.0, "period-1"), (2, 4.0, "period-2")):
    general.claim(f"the {_word} motion clearly appears at w = {_omega:g} (Fig. 2)", f"{_word} at w = {_omega:g}")(
        partial(_poincare_period, n=_n, omega=_omega)
    )
for _printed, _word in (("2", "first"), ("4", "second")):
    general.claim(f"the {_word} impact resonance impact-1 motion occurs at w = {_printed}", f"w = {_printed}")(
        partial(_resonance, printed=_printed, word=_word)
    )


@general.claim("These results are consistent with those obtained using the Poincaré map", "the same n in both maps")
def maps_agree(lab: Laboratory) -> Outcome:
    """Count points of the Poincare map where the impact map closed a cycle of period n."""
    cycles = _cycles(lab, 40, longest=8)
    share, omega, same = _split(cycles, [lab.distinct_looks(w) == motion.n_periods for w, motion in cycles])
    return Outcome(
        nearly_all(share, "the periodic frequencies tried have n distinct points on the Poincaré map"),
        f"{share:.1%} of {len(cycles)} frequencies",
        f"n from the impacts and n from the Poincaré map differ {intervals(omega, ~same)}",
    )


@general.claim("most of the periodic impact motion can be described as period-n impact-p motion", "most")
def most_are_n_p(lab: Laboratory) -> Outcome:
    """Count period-n impact-p among all motions that repeat."""
    repeating = [motion for motion in lab.scan().motions if repeats(motion)]
    share = sum(map(periodic, repeating)) / len(repeating)
    return Outcome(
        is_true(share > 0.5, "more than half of the frequencies whose motion repeats"),
        f"{share:.1%} of {len(repeating)} frequencies",
        "the rest of the motions that repeat contain a stick, and with it infinitely many impacts",
    )


general.named("the period-1 ... impact-1 motion appears at w = 2", "period-1 impact-1", 2.0)
general.named("the ... period-2 impact-1 motion appears at w = 4", "period-2 impact-1", 4.0)


@general.claim("a non-periodic (chaotic) region between two impact resonance peaks", "chaos between w = 2 and 4")
def chaos_between_peaks(lab: Laboratory) -> Outcome:
    """Look for aperiodic motion between the first two resonances."""
    scan = lab.scan().between(2.0, 4.0)
    flags = scan.where(aperiodic)
    return Outcome(
        is_true(bool(np.sum(flags) * lab.scale.scan_step >= 0.1), "aperiodic motions over 0.1 rad/s or more"),
        f"{np.mean(flags):.0%} of the frequencies",
        f"aperiodic {intervals(scan.omega, flags)}",
    )


# Section 3.1: sticking at low driving frequencies.


@sticking.claim("Sticking motion is present in regions where w < 0.25", "sticking for all w < 0.25")
def sticking_region(lab: Laboratory) -> Outcome:
    """Scan below 0.25, and bisect where sticking ends."""
    scan = lab.scan().between(0.0, 0.25)
    flags = scan.where(sticks)
    end = lab.edge("period-1 sticking", 0.25, 0.5)
    return Outcome(
        fills_interval(list(scan.omega), list(flags), "0.00", "0.25"),
        f"sticking at {np.mean(flags):.0%} of the frequencies",
        f"sticking fills the interval and continues far beyond it, up to w = {end:.4f}"
        if flags.all() and end > 0.26
        else f"no stick {intervals(scan.omega, ~flags)}; sticking ends at w = {end:.4f}",
    )


@sticking.claim("the oscillator collides with the limited stop at low velocities", "low velocities")
def low_velocities(lab: Laboratory) -> Outcome:
    """Compare the hardest impact of the sticking region with that at resonance."""
    hardest, resonance = float(lab.line()["max_velocity"].sel(omega=slice(0, 0.25)).max()), lab.peak(2.0)[1]
    return Outcome(
        is_true(hardest <= 0.1 * resonance, "no impact below w = 0.25 exceeds a tenth of that at the first resonance"),
        f"at most {hardest:.4g} m/s",
        f"the hardest impact below w = 0.25 is {hardest / resonance:.1%} of that at resonance ({resonance:.4g} m/s)",
    )


@sticking.claim("This phenomenon produces numerous low impact series", "many low impacts per period")
def numerous_low(lab: Laboratory) -> Outcome:
    """Count the slow recorded impacts of one chatter at w = 0.1."""
    hits, in_window = lab.motion(omega=0.1).velocities, lab.window(omega=0.1).velocity
    limit = 0.01 * OSCILLATOR.velocity_scale
    slow = sum(v < limit for v in hits)
    return Outcome(
        is_true(slow >= 10, "ten or more recorded impacts of a period at w = 0.1 are slower than 1 % of V"),
        f"{slow} of {len(hits)} recorded impacts",
        f"{len(hits)} impacts per period are faster than the chatter cut-off, {slow} of them below 1 % of V",
        f"{len(in_window)} impacts, {np.sum(in_window < limit)} of them below 1 % of V: at rest it counts one false "
        "impact per step",
    )


@sticking.claim("the vibration eventually becomes stuck at the end-stop", "stuck in every period")
def becomes_stuck(lab: Laboratory) -> Outcome:
    """Compare the number of sticks with the periods sampled at w = 0.1."""
    section, motion = lab.section(omega=0.1), lab.motion(omega=0.1)
    resting = float((section["release_time"] - section["stick_time"])[-2]) / OSCILLATOR.replace(omega=0.1).period
    return Outcome(
        is_true(sticks(motion) and motion.n_periods == 1, "the settled motion at w = 0.1 sticks once in each period"),
        motion.name,
        f"the mass rests at the stop for {resting:.1%} of each period at w = 0.1",
    )


@sticking.claim("represented by a single point on the Poincaré map (period-1) (w = 0.1)", "one point")
def single_point(lab: Laboratory) -> Outcome:
    """Count the points of the Poincare map at w = 0.1."""
    looks = lab.distinct_looks(0.1)
    rule = is_true(looks == 1, "the settled Poincaré map has one distinct point")
    return Outcome(rule, counted(looks, "point"), "compared to 1e-6 of V over 64 periods at w = 0.1")


def _complete_chatter(lab: Laboratory, omega: float) -> Outcome:
    motion = lab.motion(omega=omega)
    complete = sticks(motion) and motion.n_impacts == -1 and motion.n_periods == 1
    return Outcome(
        is_true(complete, "the settled motion ends each period in a complete chatter (infinitely many impacts)"),
        motion.name,
        f"a complete chatter in each period, of which {len(motion.velocities)} impacts are above the cut-off",
    )


sticking.claim("and by a sequence of points on the impact map (impact-∞) (w = 0.1)", "impact-∞")(
    partial(_complete_chatter, omega=0.1)
)


def _hardest(lab: Laboratory, omega: float, part: int) -> float:
    motion = lab.motion(omega=omega)
    at = int(np.argmax(motion.velocities))
    return (motion.velocities[at], motion.phases[at])[part]


def _hardest_in_window(lab: Laboratory, omega: float, part: int) -> str:
    return f"{lab.window(omega=omega).hardest[part]:.4g}"


def _stick_phase(lab: Laboratory, omega: float) -> float:
    return float(lab.section(omega=omega)["stick_time"][-1]) / OSCILLATOR.replace(omega=omega).period % 1.0


for _omega, _velocity, _phase, _stick in ((0.1, "0.23", "0.03", "0.11"), (0.25, "0.62", "0.08", "0.33")):
    _at = f"(w = {_omega:g})"
    sticking.value(
        f"the maximum impact velocity is {_velocity} {_at}", _velocity, "m/s", partial(_hardest, omega=_omega, part=0),
        what="the hardest impact of the settled motion", fixed_step=partial(_hardest_in_window, omega=_omega, part=0),
    )  # fmt: skip
    sticking.value(
        f"at phase {_phase} {_at}", _phase, "", partial(_hardest, omega=_omega, part=1),
        what="the phase of the hardest impact", fixed_step=partial(_hardest_in_window, omega=_omega, part=1),
    )  # fmt: skip
    sticking.value(
        f"the sticking occurs at phase {_stick} {_at}", _stick, "", partial(_stick_phase, omega=_omega),
        what="the phase at which the chatter is complete",
    )  # fmt: skip
sticking.trend(
    "when w increases to 0.25, the maximum impact velocity increases", "harder at 0.25 than at 0.1",
    lambda lab: [_hardest(lab, omega, 0) for omega in (0.1, 0.25)],
    "the hardest impact", "the hardest impact at w = 0.1 and 0.25", grows=True, unit="m/s",
)  # fmt: skip
for _omega in (0.1, 0.25):
    sticking.claim(f"periodic sticking motions, classified as period-1 impact-∞ (w = {_omega:g})", "period-1 impact-∞")(
        partial(_complete_chatter, omega=_omega)
    )
