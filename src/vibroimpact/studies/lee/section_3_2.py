"""Sections 3.2 to 3.5 and 5: chaos, the periodic motion between its regions, Std, and the conclusions."""

from __future__ import annotations

from functools import partial

import numpy as np

import vibroimpact as vi
from vibroimpact.cells import Floats
from vibroimpact.motion import Motion
from vibroimpact.studies.lee.claims import Outcome, Section, shares
from vibroimpact.studies.lee.laboratory import (
    Laboratory,
    aperiodic,
    commonest,
    intervals,
    period_impact,
    periodic,
    sticks,
)
from vibroimpact.studies.lee.paper import OSCILLATOR, PAIRS
from vibroimpact.studies.lee.rules import all_of, fills_interval, is_true, nearly_all, printed_value, trend

first_chaos = Section("3.2")
between = Section("3.3")
second_chaos = Section("3.4")
statistical = Section("3.5")
conclusions = Section("5")


# Sections 3.2 to 3.4: chaos below and above the first resonance, and the periodic motion between.


@first_chaos.claim(
    "the impact vibration does not remain stuck but departs after several impacts", "no stick above 0.25", importance=8
)
def leaves_the_stop(lab: Laboratory) -> Outcome:
    """Look for sticking motions between 0.25 and 1."""
    scan = lab.scan().between(0.25, 1.0)
    flags = scan.where(sticks) & (scan.omega > 0.25 + 1e-9)
    return Outcome(
        is_true(not flags.any(), "no scanned frequency in (0.25, 1] carries a sticking motion"),
        f"sticking at {np.mean(flags):.0%} of the frequencies",
        f"the mass still sticks in every cycle {intervals(scan.omega, flags)}",
    )


def complex_within(section: Section, quotation: str, low: str, high: str, importance: int) -> None:
    """Register "the motions are complex in [low, high]": neither sticking nor one impact per cycle."""

    def simple(motion: Motion) -> bool:
        return sticks(motion) or (periodic(motion) and motion.n_impacts == 1)

    @section.claim(quotation, f"complex motions in [{low}, {high}]", importance)
    def compare(lab: Laboratory) -> Outcome:
        scan = lab.scan().between(low, high)
        flags = scan.where(simple)
        return Outcome(
            nearly_all(1.0 - float(np.mean(flags)), "the frequencies carry neither sticking nor impact-1 motion"),
            f"{1 - np.mean(flags):.0%} of the frequencies; aperiodic at {scan.share(aperiodic):.0%}",
            f"sticking or impact-1 motions {intervals(scan.omega, flags)}; "
            f"aperiodic {intervals(scan.omega, scan.where(aperiodic))}",
            lab.unsettled(float(low), float(high)),
        )


complex_within(
    first_chaos, "The impact motions are complex within the driving frequency region of [0.25, 1]", "0.25", "1", 4
)


@first_chaos.claim(
    "this result further indicates a period-doubling route to chaotic behaviour", "period doubling to chaos"
)
def period_doubling(lab: Laboratory) -> Outcome:
    """Follow one window of period-1 motion inside the region downwards in w: 1, 2, 4, then chaos."""
    scan = lab.scan(0.416, 0.423, 0.0002)
    steps = [scan.where(period_impact(n, 6 * n)) for n in (1, 2, 4)] + [scan.where(aperiodic)]
    highest = [float(scan.omega[flags].max(initial=-np.inf)) for flags in steps]
    names = ("period-1 impact-6", "period-2 impact-12", "period-4 impact-24", "aperiodic")
    return Outcome(
        trend(highest, f"with w falling from {scan.omega[-1]:g}: the first w of {', '.join(names)}", grows=False),
        " → ".join(f"{w:.4f}" for w in highest),
        "first seen, w falling: " + ", ".join(f"{n} at {w:.4f}" for n, w in zip(names, highest, strict=True)),
    )


def complex_maps(section: Section, omega: float) -> None:
    """Register the two statements "fractal patterns" and "instability" at a frequency."""
    osc, at = OSCILLATOR.replace(omega=omega), f"w = {omega:g}"

    @section.claim(f"period-fractal and impact-fractal patterns on the maps ({at})", f"chaotic at {at}")
    def never_repeats(lab: Laboratory) -> Outcome:
        motion, velocity = lab.motion(omega=omega), lab.section(omega=omega)["velocity"]
        return Outcome(
            is_true(aperiodic(motion), "the settled impacts never repeat"),
            motion.name,
            f"{velocity.sizes['impact']} impacts from {float(velocity.min()):.3g} to {float(velocity.max()):.3g} m/s, "
            "no two cycles alike; whether the set is fractal is not tested, only that it does not repeat",
        )

    @section.claim(f"confirms the instability of the impact motion ({at})", f"unstable at {at}")
    def separates(lab: Laboratory) -> Outcome:
        first, second = (
            vi.impact_section(osc, start=start, transient_impacts=0, sample_impacts=60)["velocity"].values
            for start in (vi.State(-1.0, 0.0), vi.State(-1.0 - 1e-9, 0.0))
        )
        growth = float(np.abs(first - second).max()) / 1e-9
        return Outcome(
            is_true(growth > 1e3, "two motions from 1e-9 m apart differ more than a thousandfold within 60 impacts"),
            f"grows {growth:.2g}-fold",
            f"two motions that start 1e-9 m apart are {growth * 1e-9:.2g} m/s apart within 60 impacts",
        )


complex_maps(first_chaos, 0.75)
first_chaos.named("w = 0.86, the impact motion converges toward a period-1 impact-2 motion", "period-1 impact-2", 0.86)
first_chaos.value(
    "When the driving frequency increases to w = 0.86, [it] converges", "0.86", "rad/s",
    lambda lab: lab.edge("period-1 impact-2", 0.92, 0.8), what="the lower end w of the period-1 impact-2 motion",
)  # fmt: skip
first_chaos.fills(
    "the impact motions remain stable within the region of [0.86, 0.99]", "period-1 impact-2",
    "0.86", "0.99", period_impact(1, 2),
)  # fmt: skip
first_chaos.value(
    "when w = 1.0, the impact motion starts to bifurcate", "1.0", "rad/s",
    lambda lab: lab.edge("period-1 impact-2", 0.92, 1.1), what="the upper end w of the period-1 impact-2 motion",
)  # fmt: skip


@first_chaos.claim("again leading to a complex motion (w = 1.0, Fig. 7)", "complex motion at w = 1.0", importance=9)
def complex_at_one(lab: Laboratory) -> Outcome:
    """Name the settled motion at w = 1, and compare it with the paper's window."""
    motion, in_window = lab.motion(omega=1.0), lab.window(omega=1.0).velocity
    spread = np.unique(np.round(in_window, 2)).size
    because = "the settled impacts never repeat"
    if not aperiodic(motion):
        hits = " and ".join(f"{velocity:.4g}" for velocity in motion.velocities)
        because = f"the settled motion is a stable {motion.name} with impacts at {hits} m/s"
    if not aperiodic(motion) and spread > motion.n_impacts:
        because += "; in the paper's window the motion from rest has not settled, so its Fig. 7 shows a transient"
    return Outcome(
        is_true(aperiodic(motion), "the settled motion never repeats"),
        motion.name,
        because,
        f"{len(in_window)} impacts at {spread} different velocities (to 0.01 m/s)",
    )


@between.claim("When w = 1.4, the impact motion converges toward a periodic impact motion", "periodic at w = 1.4")
def periodic_at_1_4(lab: Laboratory) -> Outcome:
    """Name the motion at w = 1.4, and find where it begins."""
    motion, begins = lab.motion(omega=1.4), lab.edge("period-1 impact-1", 1.6, 1.1)
    return Outcome(
        is_true(periodic(motion), "the settled motion repeats"),
        motion.name,
        f"{motion.sentence(OSCILLATOR.replace(omega=1.4).period)}; "
        f"followed downwards, period-1 impact-1 is stable from w = {begins:.4f}",
    )


between.value(
    "When w = 2, the maximum impact velocity is reached", "2", "rad/s", lambda lab: lab.largest()[0],
    what="the frequency w of the largest impact velocity",
)  # fmt: skip
between.named("the corresponding results are presented with a period-1 impact-1 motion", "period-1 impact-1", 2.0)


@between.claim("This phenomenon is referred to as periodic impact resonance", "a peak at w = 2")
def resonance_peak(lab: Laboratory) -> Outcome:
    """Compare the velocity at 2 with those a quarter away."""
    heights = {omega: max(lab.motion(omega=omega).velocities, default=0.0) for omega in (1.5, 2.0, 2.5)}
    both = [trend([heights[2.0], heights[side]], "the velocity away from w = 2", grows=False) for side in (1.5, 2.5)]
    listing = ", ".join(f"{value:.4g} at {omega:g}" for omega, value in heights.items())
    return Outcome(all_of(both), f"{heights[2.0]:.5g} m/s", f"impact velocities in m/s at w: {listing}")


complex_within(
    second_chaos, "The impact motions in the driving frequency region of [2.5, 3.5] are complex", "2.5", "3.5", 3
)
complex_maps(second_chaos, 2.8)


@second_chaos.claim("The attractor that occurs at w = 0.75 is different from that occurring at w = 2.8", "different")
def attractors_differ(lab: Laboratory) -> Outcome:
    """Compare the hardest impacts and the number of impacts per period."""
    line = [lab.line(low=w - 0.01, high=w, columns=1) for w in (0.75, 2.8)]
    (hard, soft), (often, seldom) = (
        [float(one[index][-1]) for one in line] for index in ("max_velocity", "impacts_per_period")
    )
    return Outcome(
        is_true(hard > 2 * soft and often > 1.5 * seldom, "hardest impacts differ twofold, impact rates by half"),
        f"{hard:.3g} and {soft:.3g} m/s; {often:.3g} and {seldom:.3g} impacts per period",
        f"hardest impacts differ by a factor {hard / soft:.3g}, impacts per period by {often / seldom:.3g}",
    )


def _range_from_zero(lab: Laboratory, omega: float, high: str) -> Outcome:
    velocity, in_window = lab.section(omega=omega)["velocity"], lab.window(omega=omega).velocity
    least, most = float(velocity.min()), float(velocity.max())
    return Outcome(
        all_of([printed_value(least, "0.0"), printed_value(most, high)]),
        f"{least:.3g} to {most:.4g} m/s",
        f"{velocity.sizes['impact']} settled impacts lie between {least:.3g} and {most:.4g} m/s; "
        f"the paper gives 0.0 to {high}",
        f"{in_window.min():.3g} to {in_window.max():.4g} m/s in {len(in_window)} impacts",
    )


second_chaos.claim("impact velocities of moderate magnitude (range: 0-2.5) (w = 0.75)", "0 to 2.5 m/s", importance=4)(
    partial(_range_from_zero, omega=0.75, high="2.5")
)
second_chaos.claim("impact velocities of low magnitude (range: 0-0.7) (w = 2.8)", "0 to 0.7 m/s")(
    partial(_range_from_zero, omega=2.8, high="0.7")
)


# Section 3.5: the standard deviation of the impact velocities.


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


# Section 5: conclusions.


@conclusions.claim("the sticking, periodic, and chaotic motions are characterised", "all three kinds occur")
def three_kinds(lab: Laboratory) -> Outcome:
    """Count the kinds of motion in the scan."""
    share_by_kind = {has.__name__: lab.scan().share(has) for has in (sticks, periodic, aperiodic)}
    text = ", ".join(f"{kind} {share:.0%}" for kind, share in share_by_kind.items()).replace("sticks", "sticking")
    return Outcome(
        is_true(min(share_by_kind.values()) > 0, "each kind is recognised at some frequency"), text, f"{text} of w"
    )


conclusions.claim(
    "The results for the bifurcation diagram and statistical index Std are consistent and in strong agreement",
    "low Std where stable, high Std where unstable",
)(strong_agreement)


def _over_all(lab: Laboratory, part: int, rule: str) -> Outcome:
    share_by_pair = [shares(lab, pair)[part] for pair in PAIRS]
    text = ", ".join(f"(w, {pair.symbol}) {share:.1%}" for pair, share in zip(PAIRS, share_by_pair, strict=True))
    return Outcome(nearly_all(min(share_by_pair), f"{rule.format(lab.level)} in each of the five maps"), text, text)


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
