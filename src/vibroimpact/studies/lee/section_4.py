"""Sections 4.1 to 4.5: the effects of mass, damping, stiffness, forcing amplitude and restitution."""

from __future__ import annotations

from functools import partial

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.studies.lee.claims import Outcome, Section, sticking_cells
from vibroimpact.studies.lee.laboratory import (
    Laboratory,
    Scan,
    intervals,
    period_impact,
    periodic,
    repeats,
    sticks,
)
from vibroimpact.studies.lee.paper import OSCILLATOR
from vibroimpact.studies.lee.rules import all_of, is_true, nearly_all, printed_value, proportional

mass = Section("4.1")
damping = Section("4.2")
stiffness = Section("4.3")
amplitude = Section("4.4")
restitution = Section("4.5")


# Section 4.1: mass.

MASS = mass.map_claims(
    "The high mountain-like pattern indicates that the Std is high, indicating unstable motions",
    "The flat area represents small Std values, indicating periodic motions",
    "the stable and unstable boundaries of the impact motions are classified",
    "the horizontal line represents the indication of Std when m = 1 ... depicted in Fig. 3",
)
mass.natural("the resonance of free oscillation is w_n = 1", "1")
mass.region_count("Six regions are classified by impact motion at the driving frequency w = [1, 5]")
mass.fills("The sticking motion is within [0, 0.25]", "sticking", "0.00", "0.25", sticks)
for _n, _low, _high in ((1, "1.25", "2.5"), (2, "3.5", "4.5")):
    _name = f"period-{_n} impact-1"
    mass.fills(f"the {_name} motion is within [{_low}, {_high}]", _name, _low, _high, period_impact(_n, 1))
for _low, _high in (("0.25", "1.25"), ("2.5", "3.5"), ("4.5", "5.0")):
    mass.chaotic(f"the unstable motions are within [{_low}, {float(_high):g}]", _low, _high)
mass.natural_trend(
    "When the mass is small (m < 1), the resonance of free oscillation increases", "mass", (1.0, 0.5, 0.1), grows=True
)


def _mean_std(lab: Laboratory) -> tuple[float, float]:
    std = lab.results[MASS.key]["std"]
    return float(std.where(std["mass"] > 1).mean()), float(std.where(std["mass"] < 1).mean())


mass.trend(
    "[m < 1] the impact motions correspond to high Std values", "higher Std for m < 1", _mean_std,
    "the mean of Std from m > 1 to m < 1", "mean Std of the map over all w, for m > 1 and for m < 1",
    grows=True, form="{:.3g}", unit="m/s",
)  # fmt: skip
mass.trend(
    "[m < 1] ... and increases in the amplitudes of sticking and chattering motions", "harder sticking motions",
    lambda lab: [sticking_cells(lab, "mass", above=above)[0] for above in (True, False)],
    "the hardest impact of sticking cells from m > 1 to m < 1",
    "the hardest impact among sticking cells, for m > 1 and for m < 1", grows=True, form="{:.3g}", unit="m/s",
)  # fmt: skip
mass.natural("[m = 0.1] The resonance of free oscillation is w_n = 3.1", "3.1", mass=0.1)
mass.first_resonance("[m = 0.1] the first impact resonance is approximately 6.2", "6.2", mass=0.1)
mass.axis_height("[m = 0.1] Thus, the amplitude on the y-axis is increased to 8", "8", resonance=6.2, mass=0.1)
mass.natural_trend(
    "When the mass increases (m > 1), the resonance of free oscillation decreases", "mass", (1.0, 2.0, 5.0), grows=False
)
mass.trend(
    "Consequently, the period-n impact resonances also decrease", "resonances move down with m",
    lambda lab: [lab.first_resonance(mass=m)[0] for m in (1.0, 2.0, 5.0)],
    "the frequency of the first impact resonance", "first impact resonance at m = 1, 2, 5", grows=False, unit="rad/s",
)  # fmt: skip
mass.natural("[m = 5] The resonance of free oscillation is w_n = 0.44", "0.44", mass=5.0)
mass.first_resonance("[m = 5] the first impact resonance is approximately 0.88", "0.88", mass=5.0)
mass.resonance_series("[m = 5] The period-n impact resonances for n = 1 to 5 are presented", 5, mass=5.0)


# Section 4.2: damping.

DAMPINGS = (OSCILLATOR.damping, 0.5, 1.0)
DAMPING = damping.map_claims(
    "the mountain-like area indicates unstable motions",
    "The flat area indicates stable motions",
    "the stable and unstable regions of the impact motions are classified in the (w, c) domain",
    "the horizontal line represents the indication of Std when c = 0.01 ... depicted in Fig. 3",
)
damping.impact_rate(
    "When the damping c increases, the impacting rate ... [is] reduced", "fewer impacts", "damping", DAMPINGS, 3
)
damping.trend(
    "... and the amplitude of impact resonance [is] reduced", "lower peaks",
    lambda lab: [lab.largest(damping=c)[1] for c in DAMPINGS], "the largest impact velocity over all w, c rising,",
    lambda lab: "at c = " + ", ".join(f"{c:g} (w = {lab.largest(damping=c)[0]:.3g})" for c in DAMPINGS),
    grows=False, unit="m/s",
)  # fmt: skip


@damping.claim(
    "when the pair of w and c varies, the stable and unstable boundaries appear in the (w, c) domain", "boundaries"
)
def boundaries_appear(lab: Laboratory) -> Outcome:
    """Count rows of the map in which Std crosses the level."""
    high = lab.results[DAMPING.key]["std"].transpose("damping", "omega").values >= lab.level
    crossings = np.sum(high[:, 1:] != high[:, :-1], axis=1)
    return Outcome(
        nearly_all(float(np.mean(crossings > 0)), "the rows of the map have a boundary"),
        f"{crossings.min()} to {crossings.max()} crossings per row",
        f"{crossings[0]} boundaries along w at the smallest c, {crossings[-1]} at the largest",
    )


# Section 4.3: stiffness.

stiffness.map_claims(
    "the mountain-like area indicates unstable motions",
    "the flat area indicates stable motions",
    "the stable and unstable boundaries of the impact motions are classified in the (w, k) domain",
    "the horizontal line represents the indication of Std when k = 1 ... depicted in Fig. 3",
)
stiffness.natural("the resonance of free oscillation is w_n = 1", "1")
stiffness.region_count("Six regions are classified by impact motion at the driving frequency w = [1, 5]")
SOFTER, STIFFER = (1.0, 0.5, 0.1), (1.0, 2.0, 5.0)
stiffness.natural_trend(
    "When the stiffness k decreases, so does the resonance of the free oscillation", "stiffness", SOFTER, grows=False
)
stiffness.trend(
    "Thus, the location of the impact resonances shifts forward", "towards lower w",
    lambda lab: [lab.first_resonance(stiffness=k)[0] for k in SOFTER],
    "the frequency of the first impact resonance, k falling,",
    "frequency of the first impact resonance at k = 1, 0.5, 0.1", grows=False, unit="rad/s",
)  # fmt: skip
stiffness.trend(
    "and the amplitude of the impact motions increases", "harder impacts",
    lambda lab: [lab.first_resonance(stiffness=k)[1] for k in SOFTER],
    "the height of the first impact resonance, k falling,",
    "height of the first impact resonance at k = 1, 0.5, 0.1", grows=True, unit="m/s",
)  # fmt: skip
stiffness.natural("[k = 0.1] The resonance of free oscillation is w_n = 0.31", "0.31", stiffness=0.1)
stiffness.first_resonance("[k = 0.1] the first impact resonance is approximately 0.62", "0.62", stiffness=0.1)
stiffness.resonance_series("[k = 0.1] Seven impact resonances appear", 7, stiffness=0.1)
stiffness.value(
    "[k = 0.1] the impact magnitude is amplified by a factor of 3 relative to k = 1", "3", "",
    lambda lab: lab.largest(stiffness=0.1)[1] / lab.largest()[1], what="the ratio of the largest impact velocities",
)  # fmt: skip
stiffness.natural_trend(
    "When the stiffness k increases, so do the resonance of free oscillation ...", "stiffness", STIFFER, grows=True
)


def _first_resonances(lab: Laboratory) -> str:
    places = " → ".join(f"{lab.first_resonance(stiffness=k)[0]:.4g}" for k in STIFFER)
    return (
        "mean impact velocity over all w at k = 1, 2, 5; the paper says that the amplitude of the impact motions "
        f"increases as k decreases; only the frequency of the first impact resonance rises: {places} rad/s"
    )


stiffness.trend(
    "When the stiffness k increases, so do ... the impact motions", "stronger impact motions",
    lambda lab: [float(lab.line(stiffness=k)["mean_velocity"].mean()) for k in STIFFER],
    "the mean impact velocity, k rising,", _first_resonances, grows=True, form="{:.3g}", unit="m/s",
)  # fmt: skip
stiffness.trend(
    "As a result, the effect of the impact resonances decreases", "weaker resonances",
    lambda lab: [lab.largest(stiffness=k)[1] for k in STIFFER], "the largest impact velocity, k rising,",
    "largest impact velocity over all w at k = 1, 2, 5", grows=False, unit="m/s",
)  # fmt: skip
stiffness.trend(
    "... and the sticking and chattering motions increase", "more sticking at larger k",
    lambda lab: [sticking_cells(lab, "stiffness", above=above)[1] for above in (False, True)],
    "the share of sticking cells from k < 1 to k > 1", "sticking cells of the map, for k < 1 and for k > 1",
    grows=True, form="{:.1%}",
)  # fmt: skip
stiffness.natural("[k = 5] The resonance of free oscillation is w_n = 2.23", "2.23", stiffness=5.0)
stiffness.first_resonance("[k = 5] the first impact resonance is approximately 4.46", "4.46", stiffness=5.0)
stiffness.axis_height("[k = 5] Thus, the amplitude in the y-axis is reduced to 3", "3", resonance=4.46, stiffness=5.0)


# Section 4.4: forcing amplitude.

AMPLITUDE = amplitude.map_claims(
    "the mountain-like area indicates unstable motions",
    "The flat area indicates stable motions",
    "the stable and unstable boundaries of the impact motions are classified in the (w, f) domain",
    "the horizontal line represents the indication of Std when f = 1 ... depicted in Fig. 3",
)


@amplitude.claim(
    "When f changes, the boundaries of the impact motions remain largely unchanged", "unchanged", importance=2
)
def boundaries_stay(lab: Laboratory) -> Outcome:
    """Compare the motions of every row of the map with those of the row nearest f = 1; also the drawn boundary."""
    cells = lab.cells("amplitude")
    forces = np.unique(cells.parameter)
    stable = cells.stable.reshape(-1, len(forces))
    same = float(np.mean(stable == stable[:, [_nearest(forces)]]))
    sweep = lab.results[AMPLITUDE.key].transpose("omega", "amplitude")
    high = sweep["std"].values >= lab.level
    drawn = float(np.mean(high == high[:, [_nearest(sweep["amplitude"].values)]]))
    return Outcome(
        nearly_all(same, "the named cells are stable or unstable as at the same w in the row nearest f = 1"),
        f"{same:.1%} of the cells",
        f"with g = 0 every motion scales with f, and its kind cannot depend on it; a boundary drawn at a fixed Std of "
        f"{lab.level:g} m/s does move with f: {drawn:.1%} of the cells stay on their side",
    )


def _nearest(forces: Floats) -> int:
    return int(np.argmin(np.abs(forces - OSCILLATOR.amplitude)))


def _two_scans(lab: Laboratory, f: float) -> tuple[Scan, Scan]:
    """Return the scans at the paper's amplitude and at another."""
    return lab.variant(), lab.variant(amplitude=f)


def _similar(lab: Laboratory, f: float) -> Outcome:
    usual, other = _two_scans(lab, f)
    same = np.array([a.name == b.name for a, b in zip(usual.motions, other.motions, strict=True)])
    return Outcome(
        nearly_all(float(np.mean(same)), "the frequencies carry a motion of the same name at f = 1"),
        f"{np.mean(same):.1%} of {len(same)} frequencies",
        f"names differ {intervals(usual.omega, ~same)}, where long chaotic transients magnify rounding"
        if not same.all()
        else "every frequency carries the same motion",
    )


def _scaled(lab: Laboratory, f: float) -> Outcome:
    usual, other = _two_scans(lab, f)
    pairs = [(a, b) for a, b in zip(usual.motions, other.motions, strict=True) if periodic(a) and periodic(b)]
    ratios = [max(b.velocities) / max(a.velocities) for a, b in pairs if a.n_impacts == b.n_impacts]
    worst = max(abs(ratio / f - 1.0) for ratio in ratios)
    return Outcome(
        proportional(ratios, f),
        f"ratio {f:g} to a relative {worst:.1e}",
        f"the ratio of the hardest impacts of {len(ratios)} periodic motions equals that of the forces to {worst:.1e}",
    )


for _f in (0.1, 5.0):
    amplitude.claim(f"The various types of impact motions exhibit similar patterns (f = {_f:g})", "similar patterns")(
        partial(_similar, f=_f)
    )
for _f in (0.1, 5.0):
    amplitude.claim(f"the magnitudes of the impact velocities are proportioned to f (f = {_f:g})", "proportional to f")(
        partial(_scaled, f=_f)
    )


# Section 4.5: coefficient of restitution.

restitution.map_claims(
    "the mountain-like area indicates unstable motions",
    "The flat area indicates stable motions",
    "the stable and unstable boundaries of the impact motions are classified in the (w, r) domain",
    "the horizontal line represents the indication of Std when r = 0.8 ... presented in Fig. 3",
)
restitution.impact_rate(
    "When r increases, the motions with a high impacting rate occur within the full w range", "more impacts",
    "restitution", (1.0, 0.1), 1,
)  # fmt: skip


@restitution.claim("[r = 1] two impact resonances dominate the system", "two dominant peaks")
def two_peaks(lab: Laboratory) -> Outcome:
    """Compare the largest velocity near 2 and 4 with the largest anywhere else."""
    line = lab.line(restitution=1.0)
    height = line["max_velocity"].fillna(0.0)
    near = [abs(line["omega"] - w) < 0.3 for w in (2, 4)]
    first, second = (float(height.where(part).max()) for part in near)
    rest = float(height.where(~(near[0] | near[1])).max())
    return Outcome(
        is_true(min(first, second) > 2 * rest, "both peaks are more than twice as high as any velocity elsewhere"),
        f"{first:.4g} and {second:.4g} m/s, else at most {rest:.3g}",
        f"peaks within 0.3 of w = 2 and 4; everywhere else at most {rest:.3g} m/s",
    )


restitution.axis_height("[r = 1] The amplitude on the y-axis is increased to 35", "35", importance=6, restitution=1.0)
restitution.trend(
    "[r = 1] the periodic motions are disrupted by high strength impact responses", "fewer periodic motions",
    lambda lab: [lab.variant(restitution=r).share(repeats) for r in (0.8, 1.0)],
    "the share of frequencies whose motion repeats", "share of frequencies whose motion repeats at r = 0.8 and 1",
    grows=False, form="{:.0%}",
)  # fmt: skip
RESTITUTIONS = (1.0, 0.8, 0.6, 0.4, 0.2, 0.1)
restitution.trend(
    "Conversely, when r decreases, the impact response is attenuated gradually", "softer with r",
    lambda lab: [float(lab.line(restitution=r)["max_velocity"].mean()) for r in RESTITUTIONS],
    "the mean over w of the largest velocity, r falling,",
    "mean over w of the largest impact velocity at r = " + ", ".join(f"{r:g}" for r in RESTITUTIONS),
    grows=False, form="{:.3g}", unit="m/s",
)  # fmt: skip


@restitution.claim("[r = 0.1] the impact resonances are reduced", "lower peaks at 2 and 4")
def peaks_reduced(lab: Laboratory) -> Outcome:
    """Compare the velocities at the two resonances for r = 0.8 and 0.1."""
    pairs = [[lab.peak(w, restitution=r)[1] for r in (0.8, 0.1)] for w in (2.0, 4.0)]
    listing = "; ".join(f"{high:.3g} → {low:.3g} m/s at w = {w}" for w, (high, low) in zip((2, 4), pairs, strict=True))
    lower = is_true(all(low < high for high, low in pairs), "both peaks are lower at r = 0.1 than at r = 0.8")
    return Outcome(lower, listing, f"from r = 0.8 to r = 0.1: {listing}")


@restitution.claim("[r = 0.1] the first impact resonance shifts to w = 1", "1 rad/s")
def resonance_shifts(lab: Laboratory) -> Outcome:
    """Look at the motion where the velocity is largest, and follow the resonance from r = 0.8."""
    omega, _ = lab.largest(restitution=0.1)
    motion, near, places = lab.motion(omega=omega, restitution=0.1), 2.0, []
    for r in (0.8, 0.6, 0.4, 0.2):
        near, _ = lab.peak(near, 0.3, restitution=r)
        places.append(f"{near:.3g} at r = {r:g}")
    name = period_impact(1, 1)(motion)
    rules = printed_value(omega, "1"), is_true(name, "the first impact resonance hits once per period")
    return Outcome(
        all_of(rules),
        f"{omega:.4g} rad/s, {motion.name}",
        f"the largest velocity at r = 0.1 is at w = {omega:.4g}, on a {motion.name} motion; the first impact "
        f"resonance, followed as r falls, is at w = {', '.join(places)}",
    )


@restitution.claim("[r = 0.1] the chattering motions decay to sticking motions", "more sticking")
def chatter_sticks(lab: Laboratory) -> Outcome:
    """Compare the shares of sticking frequencies for r = 0.8 and 0.1."""
    scans = [lab.variant(restitution=r) for r in (OSCILLATOR.restitution, 0.1)]
    before, after = (scan.share(sticks) for scan in scans)
    return Outcome(
        is_true(after > before, "sticking motions take a larger share of the frequencies at r = 0.1 than at r = 0.8"),
        f"{after:.0%} against {before:.0%}",
        f"sticking at r = 0.1 {intervals(scans[1].omega, scans[1].where(sticks))}",
    )


@restitution.claim("[r = 0.1] ... and the chaotic motions decay to periodic motions", "chaos becomes periodic")
def chaos_decays(lab: Laboratory) -> Outcome:
    """Count the frequencies unstable at r = 0.8 that are settled at r = 0.1."""
    scans = [lab.variant(restitution=r) for r in (OSCILLATOR.restitution, 0.1)]
    omega, (before, after) = scans[0].omega, (scan.where(repeats) for scan in scans)
    share = float(np.mean(after[~before]))
    return Outcome(
        nearly_all(share, "the frequencies unstable at r = 0.8 have a periodic or sticking cycle at r = 0.1"),
        f"{share:.1%} of {np.sum(~before)} frequencies",
        f"still aperiodic at r = 0.1 {intervals(omega, ~after)}",
    )
