"""Section 3.1: sticking at low driving frequencies."""

from __future__ import annotations

from functools import partial

import numpy as np

from vibroimpact.studies.lee.claims.base import Finding, Section
from vibroimpact.studies.lee.claims.motions import distinct_looks, sticks
from vibroimpact.studies.lee.laboratory import Laboratory, intervals
from vibroimpact.studies.lee.paper import OSCILLATOR
from vibroimpact.studies.lee.rules import fills_interval, is_true, rises

sticking = Section("3.1")


@sticking.claim("Sticking motion is present in regions where w < 0.25", "sticking for all w < 0.25")
def sticking_region(lab: Laboratory) -> Finding:
    """Scan below 0.25, and bisect where sticking ends."""
    scan = lab.scan().between(0.0, 0.25)
    flags = scan.where(sticks)
    end = lab.edge("period-1 sticking", 0.25, 0.5)
    return Finding(
        fills_interval(list(scan.omega), list(flags), "0.00", "0.25"),
        f"sticking at {np.mean(flags):.0%} of the frequencies",
        f"sticking fills the interval and goes on far beyond it, up to w = {end:.4f}"
        if flags.all() and end > 0.26
        else f"no stick {intervals(scan.omega, ~flags)}; sticking ends at w = {end:.4f}",
    )


@sticking.claim("the oscillator collides with the limited stop at low velocities", "low velocities")
def low_velocities(lab: Laboratory) -> Finding:
    """Compare the hardest hit of the sticking region with that at resonance."""
    line = lab.line()
    hardest, resonance = float(line["max_velocity"].sel(omega=slice(0, 0.25)).max()), lab.peak(2.0)[1]
    return Finding(
        is_true(hardest <= 0.1 * resonance, "no hit below w = 0.25 exceeds a tenth of that at the first resonance"),
        f"at most {hardest:.4g} m/s",
        f"the hardest hit below w = 0.25 is {hardest / resonance:.1%} of that at resonance ({resonance:.4g} m/s)",
    )


@sticking.claim("This phenomenon produces numerous low impact series", "many low impacts a period")
def numerous_low(lab: Laboratory) -> Finding:
    """Count the slow recorded impacts of one chatter at w = 0.1."""
    motion, seen = lab.motion(omega=0.1), lab.window(omega=0.1).velocity
    slow = sum(v < 0.01 * OSCILLATOR.velocity_scale for v in motion.velocities)
    return Finding(
        is_true(slow >= 10, "ten or more recorded impacts of a period at w = 0.1 are slower than 1 % of V"),
        f"{slow} of {len(motion.velocities)} recorded impacts",
        f"{len(motion.velocities)} impacts a period are faster than the chatter cut-off, {slow} of them below 1 % of V",
        f"{len(seen)} impacts, {np.sum(seen < 0.01 * OSCILLATOR.velocity_scale)} of them below 1 % of V: at rest it "
        "counts one false impact a step",
    )


@sticking.claim("the vibration eventually becomes stuck at the end-stop", "stuck in every period")
def becomes_stuck(lab: Laboratory) -> Finding:
    """Compare the number of sticks with the periods sampled at w = 0.1."""
    section, motion = lab.section(omega=0.1), lab.motion(omega=0.1)
    held = float((section["release_time"] - section["stick_time"])[-2]) / OSCILLATOR.replace(omega=0.1).period
    return Finding(
        is_true(sticks(motion) and motion.n_periods == 1, "the settled motion at w = 0.1 sticks once in each period"),
        motion.name,
        f"the mass rests at the stop for {held:.1%} of each period at w = 0.1",
    )


def _single_point(lab: Laboratory) -> Finding:
    looks = distinct_looks(lab, 0.1)
    return Finding(
        is_true(looks == 1, "the settled Poincaré map has one distinct point"),
        f"{looks} point{'' if looks == 1 else 's'}",
        "compared to 1e-6 of V over 64 periods at w = 0.1",
    )


sticking.claim("represented by a single point on the Poincaré map (period-1) (w = 0.1)", "one point")(_single_point)


def _sticking_name(lab: Laboratory, omega: float) -> Finding:
    motion = lab.motion(omega=omega)
    complete = sticks(motion) and motion.n_impacts == -1 and motion.n_periods == 1
    return Finding(
        is_true(complete, "the settled motion ends each period in a complete chatter (infinitely many impacts)"),
        motion.name,
        f"a complete chatter in each period, of which {len(motion.velocities)} impacts are above the cut-off",
    )


sticking.claim("and by a sequence of points on the impact map (impact-∞) (w = 0.1)", "impact-∞")(
    partial(_sticking_name, omega=0.1)
)


def _hardest(lab: Laboratory, omega: float, part: int) -> float:
    motion = lab.motion(omega=omega)
    at = int(np.argmax(motion.velocities))
    return (motion.velocities[at], motion.phases[at])[part]


def _hardest_in_window(lab: Laboratory, omega: float, part: int) -> str:
    return f"{lab.window(omega=omega).hardest[part]:.4g}"


def _stick_phase(lab: Laboratory, omega: float) -> float:
    section = lab.section(omega=omega)
    return float(section["stick_time"][-1]) / OSCILLATOR.replace(omega=omega).period % 1.0


for _omega, _velocity, _phase, _stick in ((0.1, "0.23", "0.03", "0.11"), (0.25, "0.62", "0.08", "0.33")):
    _at = f"(w = {_omega:g})"
    sticking.value(
        f"the maximum impact velocity is {_velocity} {_at}", _velocity, "m/s", partial(_hardest, omega=_omega, part=0),
        what="the hardest hit of the settled motion", fixed_step=partial(_hardest_in_window, omega=_omega, part=0),
    )  # fmt: skip
    sticking.value(
        f"at phase {_phase} {_at}", _phase, "", partial(_hardest, omega=_omega, part=1),
        what="the phase of the hardest hit", fixed_step=partial(_hardest_in_window, omega=_omega, part=1),
    )  # fmt: skip
    sticking.value(
        f"the sticking occurs at phase {_stick} {_at}", _stick, "", partial(_stick_phase, omega=_omega),
        what="the phase at which the chatter is complete",
    )  # fmt: skip


@sticking.claim("when w increases to 0.25, the maximum impact velocity increases", "harder at 0.25 than at 0.1")
def harder_at_quarter(lab: Laboratory) -> Finding:
    """Compare the hardest hits at the two frequencies."""
    values = [_hardest(lab, omega, 0) for omega in (0.1, 0.25)]
    return Finding(
        rises(values, "the hardest hit"),
        " → ".join(f"{value:.4g}" for value in values) + " m/s",
        f"the hardest hit grows by a factor {values[1] / values[0]:.3g}",
    )


for _omega in (0.1, 0.25):
    sticking.claim(f"periodic sticking motions, classified as period-1 impact-∞ (w = {_omega:g})", "period-1 impact-∞")(
        partial(_sticking_name, omega=_omega)
    )
