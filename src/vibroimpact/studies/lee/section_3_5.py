"""Sections 3.5 and 5: what the standard deviation of the impact velocities says about a motion; the conclusions."""

from __future__ import annotations

from functools import partial

import numpy as np

import vibroimpact as vi
from vibroimpact.studies.lee.claims import Outcome, Section, shares
from vibroimpact.studies.lee.laboratory import (
    Floats,
    Laboratory,
    aperiodic,
    commonest,
    intervals,
    period_impact,
    periodic,
    sticks,
)
from vibroimpact.studies.lee.paper import OSCILLATOR, PAIRS
from vibroimpact.studies.lee.rules import all_of, fills_interval, is_true, nearly_all

statistical = Section("3.5")
conclusions = Section("5")


def std_at(lab: Laboratory, omega: Floats) -> Floats:
    """Return Std at the scanned frequencies, at the sampling of the maps."""
    # the line's grid is the scan's: both are multiples of the scan step up to TOP
    line = lab.line(columns=round(float(lab.scan().omega[-1]) / lab.scale.scan_step))
    return np.asarray(line["std"].sel(omega=omega, method="nearest").values, dtype=np.float64)


@statistical.claim("the Std of the impact series in the impact map is calculated as follows (eq. 2)", "population Std")
def formula(lab: Laboratory) -> Outcome:
    """Compare the index of a sweep with NumPy's standard deviation of the section."""
    errors = []
    for omega in (0.9, 2.0, 3.5):
        hits = vi.impact_section(OSCILLATOR.replace(omega=omega))["velocity"].values
        sweep = vi.parameter_map(OSCILLATOR, omega=np.array([omega]), indices=("std",))
        errors.append(abs(float(sweep["std"][0]) - float(np.std(hits))))
    return Outcome(
        is_true(max(errors) < 1e-9, "index and NumPy's population formula differ by less than 1e-9 m/s"),
        f"differ by {max(errors):.1e} m/s",
        "the sweep's running sums and the formula applied to 100 + 5000 impacts, at w = 0.9, 2 and 3.5",
    )


@statistical.claim("To ensure the accuracy of the results, 5000 impact series are considered", "5000 are enough")
def enough_impacts(lab: Laboratory) -> Outcome:
    """Compare the Std of successive stretches of 5000 chaotic impacts."""
    spread = []
    for omega in (0.75, 2.8):
        hits = vi.impact_section(OSCILLATOR.replace(omega=omega), sample_impacts=20000)["velocity"].values
        parts = hits.reshape(4, 5000).std(axis=1)
        spread.append(float((parts.max() - parts.min()) / parts.mean()))
    return Outcome(
        is_true(max(spread) < 0.05, "four successive stretches of 5000 impacts differ by less than 5 %"),
        f"differ by {max(spread):.1%}",
        f"Std of four stretches differs by {spread[0]:.1%} at w = 0.75 and {spread[1]:.1%} at w = 2.8",
    )


@statistical.claim(
    "the bifurcation diagram and statistical index (Std) results are consistent and in strong agreement",
    "low Std where stable, high Std where unstable",
    importance=10,
)
def strong_agreement(lab: Laboratory) -> Outcome:
    """Compare Std below the level with motions that repeat, frequency by frequency."""
    scan = lab.scan()
    std, stable = std_at(lab, scan.omega), ~scan.where(aperiodic)
    single = scan.where(lambda motion: motion.n_impacts == 1)
    missed = stable & ~(std < lab.level)
    agree, alike = float(np.mean((std < lab.level) == stable)), float(np.mean((std < 1e-6) == single))
    best = max(float(np.mean((std < level) == stable)) for level in np.unique(std[np.isfinite(std)]))
    return Outcome(
        nearly_all(agree, f"the frequencies have Std < {lab.level:g} m/s exactly where the motion repeats"),
        f"{agree:.1%} of {len(std)} frequencies agree",
        f"{np.mean(missed):.0%} of the frequencies carry a stable motion with a large Std "
        f"({commonest(scan.motions, missed)}), {intervals(scan.omega, missed)}; no other level agrees at more than "
        f"{best:.1%}. A vanishing Std separates one impact per cycle from several: {alike:.1%} agree at 1e-6 m/s",
    )


@statistical.claim("In the low-Std regions, the motion is stable", "low Std means stable")
def low_std_is_stable(lab: Laboratory) -> Outcome:
    """Count repeating motions among frequencies with a small Std."""
    scan = lab.scan()
    low, stable = std_at(lab, scan.omega) < lab.level, ~scan.where(aperiodic)
    rule = f"the frequencies with Std < {lab.level:g} m/s have motions that repeat"
    return Outcome(
        nearly_all(float(np.mean(stable[low])), rule),
        f"{np.mean(stable[low]):.1%} of {low.sum()} frequencies",
        f"aperiodic in spite of a small Std {intervals(scan.omega, low & ~stable)}",
    )


@statistical.claim("In the large-Std and moderate-Std regions, the motions are unstable", "high Std means unstable", 3)
def high_std_is_unstable(lab: Laboratory) -> Outcome:
    """Count aperiodic motions among frequencies with a large Std."""
    scan = lab.scan()
    high, unstable = std_at(lab, scan.omega) >= lab.level, scan.where(aperiodic)
    example, motion = lab.line(low=0.94, high=0.95, columns=1), lab.motion(omega=0.95)
    return Outcome(
        nearly_all(float(np.mean(unstable[high])), f"the frequencies with Std >= {lab.level:g} m/s are aperiodic"),
        f"{np.mean(unstable[high]):.1%} of {high.sum()} frequencies",
        f"stable in spite of a large Std {intervals(scan.omega, high & ~unstable)}; at w = 0.95 the motion is "
        f"{motion.name} and Std = {float(example['std'][0]):.3f} m/s",
    )


def _low_and_stable(lab: Laboratory, low: str, high: str, what: str) -> Outcome:
    has = sticks if what == "sticking" else period_impact(int(what[7]), 1)
    scan = lab.scan().between(low, high)
    flags, std = scan.where(has), std_at(lab, scan.omega)
    large = ~(std < lab.level)
    return Outcome(
        all_of([fills_interval(list(scan.omega), list(fits), low, high) for fits in (flags, ~large)]),
        f"{what} at {np.mean(flags):.0%}, Std < {lab.level:g} m/s at {1 - np.mean(large):.0%} of the frequencies",
        f"another motion {intervals(scan.omega, ~flags)}; Std up to {np.nanmax(std):.3g} m/s, above the level "
        f"{intervals(scan.omega, large)}" + ("; in a chatter it depends on the cut-off" if what == "sticking" else ""),
    )


for _low, _high, _what in (
    ("0.00", "0.25", "sticking"),
    ("1.5", "2.5", "period-1 impact-1"),
    ("3.5", "4.5", "period-2 impact-1"),
):
    statistical.claim(f"[low Std] the {_what} motion in [{float(_low):g}, {_high}]", f"{_what}, low Std")(
        partial(_low_and_stable, low=_low, high=_high, what=_what)
    )
for _low, _high, _which, _weight in (("0.25", "1.45", "I", 5), ("2.5", "3.5", "II", 2)):
    statistical.chaotic(f"the chaotic motion {_which} in [{_low}, {_high}]", _low, _high, _weight)


@conclusions.claim("the sticking, periodic, and chaotic motions are characterised", "all three kinds occur")
def three_kinds(lab: Laboratory) -> Outcome:
    """Count the kinds of motion in the scan."""
    found = {has.__name__: lab.scan().share(has) for has in (sticks, periodic, aperiodic)}
    text = ", ".join(f"{kind} {share:.0%}" for kind, share in found.items()).replace("sticks", "sticking")
    return Outcome(is_true(min(found.values()) > 0, "each kind is recognised at some frequency"), text, f"{text} of w")


conclusions.claim(
    "The results for the bifurcation diagram and statistical index Std are consistent and in strong agreement",
    "low Std where stable, high Std where unstable",
)(strong_agreement)


def _over_all(lab: Laboratory, part: int, rule: str) -> Outcome:
    found = [shares(lab, pair)[part] for pair in PAIRS]
    text = ", ".join(f"(w, {pair.symbol}) {share:.1%}" for pair, share in zip(PAIRS, found, strict=True))
    return Outcome(nearly_all(min(found), f"{rule.format(lab.level)} in each of the five maps"), text, text)


for _part, (_quotation, _says, _rule) in enumerate((
    (
        "the mountain-like area indicates unstable regions", "mountain = unstable",
        "the cells with Std >= {:g} m/s have motions that never repeat",
    ),
    (
        "the flat area indicates stable regions", "flat = stable",
        "the cells with Std < {:g} m/s have motions that repeat",
    ),
    (
        "the contour plots display the boundaries of the stable and unstable motions", "contours divide them",
        "the cells lie on the right side of the boundary at {:g} m/s",
    ),
)):  # fmt: skip
    conclusions.claim(_quotation, _says)(partial(_over_all, part=_part, rule=_rule))
