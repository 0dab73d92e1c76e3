"""Measurements of motions that several sections ask for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import vibroimpact as vi
from vibroimpact.motion import Motion
from vibroimpact.studies.lee.claims.base import Finding, Section
from vibroimpact.studies.lee.laboratory import Flags, Laboratory, intervals
from vibroimpact.studies.lee.paper import OSCILLATOR
from vibroimpact.studies.lee.rules import fills_interval, same_name


def sticks(motion: Motion) -> bool:
    """Whether the mass comes to rest at the stop in each cycle."""
    return motion.kind == "sticking"


def chaotic(motion: Motion) -> bool:
    """Whether the impacts never repeat."""
    return motion.kind == "aperiodic"


def period_impact(n_periods: int, n_impacts: int) -> Callable[[Motion], bool]:
    """Return a test for period-n impact-p motions."""
    name = Motion("periodic", n_periods, n_impacts).name
    return lambda motion: motion.name == name


def distinct_looks(lab: Laboratory, omega: float) -> int:
    """Return how many points of a settled Poincare map differ by more than 1e-6 V."""
    osc = OSCILLATOR.replace(omega=omega)
    looks = vi.stroboscopic_section(osc, transient_periods=lab.scale.settle_impacts, sample_periods=64)
    points = np.stack([looks["displacement"].values * osc.natural_frequency, looks["velocity"].values], axis=1)
    gaps = np.abs(points[:, None] - points[None]).max(axis=2) > 1e-6 * osc.velocity_scale
    return int(np.sum(~np.tril(~gaps, -1).any(axis=1)))


def named(section: Section, quotation: str, name: str, omega: float, importance: int = 0) -> None:
    """Register the name of a motion at a frequency."""

    def judge(lab: Laboratory) -> Finding:
        motion = lab.motion(omega=omega)
        seen = lab.window(omega=omega).velocity
        return Finding(
            same_name(motion.name, name),
            motion.name,
            f"after {lab.scale.settle_impacts} impacts: {motion.sentence(OSCILLATOR.replace(omega=omega).period)}",
            f"{len(seen)} impacts, {seen.min():.3g} to {seen.max():.3g} m/s" if len(seen) else "no impact",
        )

    section.claim(quotation, f"{name} at w = {omega:g}", importance)(judge)


def fills(
    section: Section, quotation: str, what: str, low: str, high: str, has: Callable[[Motion], bool], importance: int = 0
) -> None:
    """Register "this motion throughout [low, high]"."""

    def judge(lab: Laboratory) -> Finding:
        scan = lab.scan().between(float(low), float(high))
        flags = scan.where(has)
        return Finding(
            fills_interval(list(scan.omega), list(flags), low, high),
            f"at {np.mean(flags):.0%} of the frequencies",
            f"it is there at every scanned frequency of the interval ({len(flags)} in all)"
            if flags.all()
            else f"other motions {intervals(scan.omega, ~flags)}: {commonest(scan.motions, ~flags)}",
        )

    section.claim(quotation, f"{what} in [{low}, {high}]", importance)(judge)


def commonest(motions: tuple[Motion, ...], flags: Flags, most: int = 4) -> str:
    """Return the names of the commonest flagged motions and how often each occurs."""
    names = [motion.name for motion, has in zip(motions, flags, strict=True) if has]
    ranked = sorted(set(names), key=lambda name: (-names.count(name), name))[:most]
    return ", ".join(f"{name} {names.count(name)}x" for name in ranked) or "none"
