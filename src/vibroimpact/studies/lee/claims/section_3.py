"""Section 3: periods and resonances along the driving frequency."""

from __future__ import annotations

from functools import partial

import numpy as np

from vibroimpact.studies.lee.claims.base import Finding, Section
from vibroimpact.studies.lee.claims.motions import chaotic, distinct_looks, named
from vibroimpact.studies.lee.laboratory import Laboratory, intervals
from vibroimpact.studies.lee.paper import OSCILLATOR, WINDOW
from vibroimpact.studies.lee.rules import all_of, is_true, nearly_all, printed_value

general = Section("3")

general.value(
    "the resonance of free oscillation is w_n = sqrt(k/m) = 1", "1", "rad/s",
    lambda lab: OSCILLATOR.natural_frequency, what="w_n",
)  # fmt: skip


@general.claim(
    "the data from the first 100 s are excluded to ensure a steady system state", "steady from 100 s on", importance=7
)
def steady_after_100_s(lab: Laboratory) -> Finding:
    """Compare the exact orbit's impacts in the paper's window with the settled cycle, 1 % of V apart at most."""
    scan = lab.scan()
    chosen = [(w, m) for w, m in zip(scan.omega, scan.motions, strict=True) if m.kind == "periodic"]
    chosen = chosen[:: max(1, len(chosen) // 100)]
    strays = []
    for omega, motion in chosen:
        seen = lab.window(backend="cpu", omega=float(omega)).velocity
        nearest = np.abs(seen[:, None] - np.array(motion.velocities)[None]).min(axis=1, initial=np.inf)
        strays.append(bool(np.any(nearest > 0.01 * OSCILLATOR.velocity_scale)))
    frequencies, share = np.array([omega for omega, _ in chosen]), 1.0 - float(np.mean(strays))
    return Finding(
        nearly_all(share, "the frequencies with a periodic motion have settled to 1 % of V within the window"),
        f"settled at {share:.1%} of {len(chosen)} frequencies",
        f"from rest, these periodic motions are still on their way after {WINDOW[0]:g} s: "
        f"{intervals(frequencies, np.array(strays))}",
    )


for _n, _omega, _word in ((1, 2.0, "period-1"), (2, 4.0, "period-2")):

    def _poincare_period(lab: Laboratory, n: int, omega: float) -> Finding:
        looks = distinct_looks(lab, omega)
        points = f"{looks} distinct point{'' if looks == 1 else 's'}"
        return Finding(
            is_true(looks == n, "the settled Poincaré map has n distinct points"),
            points,
            f"the Poincaré map at w = {omega:g} has {points} to 1e-6 of V",
        )

    general.claim(f"the {_word} motion clearly appears at w = {_omega:g} (Fig. 2)", f"{_word} at w = {_omega:g}")(
        partial(_poincare_period, n=_n, omega=_omega)
    )

for _printed, _word in (("2", "first"), ("4", "second")):

    def _resonance(lab: Laboratory, printed: str, word: str) -> Finding:
        omega, height = lab.peak(float(printed))
        impacts = lab.motion(omega=omega).n_impacts
        return Finding(
            all_of([printed_value(omega, printed), is_true(impacts == 1, "the motion at the peak hits once a cycle")]),
            f"peak {height:.4g} m/s at w = {omega:.4g}",
            f"the {word} peak of the impact velocity stands at w = {omega:.4g} on an impact-{impacts} motion",
        )

    general.claim(f"the {_word} impact resonance impact-1 motion occurs at w = {_printed}", f"w = {_printed}")(
        partial(_resonance, printed=_printed, word=_word)
    )


@general.claim("These results are consistent with those obtained using the Poincaré map", "the same n in both maps")
def maps_agree(lab: Laboratory) -> Finding:
    """Count points of the Poincare map where the impact map closed a cycle of period n."""
    scan = lab.scan()
    chosen = [(w, m) for w, m in zip(scan.omega, scan.motions, strict=True) if m.kind == "periodic" and m.n_periods < 9]
    chosen = chosen[:: max(1, len(chosen) // 40)]
    same = np.array([distinct_looks(lab, float(omega)) == motion.n_periods for omega, motion in chosen])
    share, omega = float(np.mean(same)), np.array([omega for omega, _ in chosen])
    return Finding(
        nearly_all(share, "the periodic frequencies tried have n distinct points on the Poincaré map"),
        f"{share:.1%} of {len(chosen)} frequencies",
        f"n from the impacts and n from the Poincaré map differ {intervals(omega, ~same)}",
    )


@general.claim("most of the periodic impact motion can be described as period-n impact-p motion", "most")
def most_are_n_p(lab: Laboratory) -> Finding:
    """Count period-n impact-p among all motions that repeat."""
    scan = lab.scan()
    kinds = [motion.kind for motion in scan.motions if motion.kind in ("periodic", "sticking")]
    share = kinds.count("periodic") / len(kinds)
    return Finding(
        is_true(share > 0.5, "more than half of the frequencies whose motion repeats"),
        f"{share:.1%} of {len(kinds)} frequencies",
        "the rest of the motions that repeat contain a stick, and with it infinitely many impacts",
    )


named(general, "the period-1 ... impact-1 motion appears at w = 2", "period-1 impact-1", 2.0)
named(general, "the ... period-2 impact-1 motion appears at w = 4", "period-2 impact-1", 4.0)


@general.claim("a non-periodic (chaotic) region between two impact resonance peaks", "chaos between w = 2 and 4")
def chaos_between_peaks(lab: Laboratory) -> Finding:
    """Look for aperiodic motion between the first two resonances."""
    scan = lab.scan().between(2.0, 4.0)
    flags = scan.where(chaotic)
    return Finding(
        is_true(bool(np.sum(flags) * lab.scale.scan_step >= 0.1), "aperiodic motions over 0.1 rad/s or more"),
        f"{np.mean(flags):.0%} of the frequencies",
        f"aperiodic {intervals(scan.omega, flags)}",
    )
