"""Statements that several effects of section 4 share: resonances, axis heights, sticking."""

from __future__ import annotations

from vibroimpact.studies.lee.claims.base import Finding, Section
from vibroimpact.studies.lee.laboratory import Laboratory
from vibroimpact.studies.lee.paper import OSCILLATOR, TOP
from vibroimpact.studies.lee.rules import all_of, axis_limit, falls, is_true, printed_value, rises


def natural(section: Section, quotation: str, printed: str, **changes: float) -> None:
    """Register a printed resonance of free oscillation."""
    section.value(
        quotation, printed, "rad/s", lambda lab: OSCILLATOR.replace(**changes).natural_frequency,
        what="w_n = sqrt(k/m)",
    )  # fmt: skip


def first_resonance(section: Section, quotation: str, printed: str, **changes: float) -> None:
    """Register where the first impact resonance is said to be; searched up to 1.5 times that frequency."""

    def where(lab: Laboratory) -> float:
        return lab.peak(float(printed), 0.15 * float(printed), **changes)[0]

    section.value(quotation, printed, "rad/s", where, what="the peak of the impact velocity near 2 w_n stands where w")


def axis_height(section: Section, quotation: str, printed: str, importance: int = 0, **changes: float) -> None:
    """Register the end of a velocity axis."""

    def judge(lab: Laboratory) -> Finding:
        omega, height = lab.largest(**changes)
        seen, _ = lab.window(omega=omega, **changes).hardest
        because = (
            f"the largest velocity in (0, {TOP:g}] is {height:.4g} m/s at w = {omega:.4g}; the axis ends at {printed}"
        )
        if seen < 0.9 * height:
            because += "; in the paper's window that motion is still growing"
        return Finding(
            axis_limit(height, printed), f"at most {height:.4g} m/s", because, f"at most {seen:.4g} m/s at that w"
        )

    section.claim(quotation, f"axis to {printed}", importance)(judge)


def natural_trend(section: Section, quotation: str, name: str, values: tuple[float, ...], grows: bool) -> None:
    """Register that w_n rises or falls along values of a parameter."""

    def judge(lab: Laboratory) -> Finding:
        found = [OSCILLATOR.replace(**{name: value}).natural_frequency for value in values]
        return Finding(
            (rises if grows else falls)(found, "w_n"),
            " → ".join(f"{w:.4g}" for w in found) + " rad/s",
            f"w_n = sqrt(k/m) at {name} = " + ", ".join(f"{value:g}" for value in values),
        )

    section.claim(quotation, "w_n " + ("rises" if grows else "falls"))(judge)


def resonance_series(section: Section, quotation: str, count: int, omega_n: float, **changes: float) -> None:
    """Register "n impact resonances": a peak of the velocity at each 2 n w_n on a period-n impact-1 motion."""

    def judge(lab: Laboratory) -> Finding:
        names, places = [], []
        for n in range(1, int(TOP / (2 * omega_n)) + 1):
            omega, _ = lab.peak(2 * n * omega_n, 0.1 * omega_n, **changes)
            motion = lab.motion(omega=omega, **changes)
            names.append(motion.name == f"period-{n} impact-1")
            places.append(f"{omega:.3f} ({motion.name})")
        return Finding(
            all_of([printed_value(sum(names), str(count)), is_true(all(names), "the n-th hits once in n periods")]),
            f"{sum(names)} resonances",
            f"peaks of the impact velocity at w = {', '.join(places)}",
        )

    section.claim(quotation, f"{count} resonances")(judge)


def sticking_height(lab: Laboratory, name: str, above: bool) -> tuple[float, float]:
    """Return the largest impact velocity of sticking cells and their share, above or below the value 1."""
    cells = lab.cells(name)
    side = cells.parameter > 1 if above else cells.parameter < 1
    held = [m for m, here in zip(cells.motions, side, strict=True) if here and m.kind == "sticking"]
    return max((max(m.velocities) for m in held), default=0.0), len(held) / int(side.sum())
