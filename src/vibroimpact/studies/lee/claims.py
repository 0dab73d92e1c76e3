"""A statement of the paper and the measurement that tests it; patterns of statements that recur in its sections."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

import vibroimpact as vi
from vibroimpact.cells import Floats
from vibroimpact.motion import Motion
from vibroimpact.studies.lee.laboratory import (
    Laboratory,
    Test,
    aperiodic,
    commonest,
    intervals,
    period_impact,
    sticks,
)
from vibroimpact.studies.lee.paper import OSCILLATOR, PAIRS, TOP, Pair, pair_of
from vibroimpact.studies.lee.rules import (
    Assessment,
    Verdict,
    all_of,
    axis_limit,
    cut_like,
    fills_interval,
    is_true,
    nearly_all,
    printed_value,
    trend,
)


@dataclass(frozen=True)
class Outcome:
    """The result for one statement: the verdict and its rule, the numbers, and the reason in a sentence."""

    assessment: Assessment
    exact: str
    because: str
    fixed_step: str = ""


Measure = Callable[[Laboratory], Outcome]


@dataclass(frozen=True)
class Claim:
    """One statement of the paper and the measurement that tests it.

    `importance` orders the discrepancies in the summary, the largest first; it does not affect verdicts.
    """

    id: str
    section: str
    quotation: str
    says: str
    measure: Measure
    importance: int = 0


@dataclass
class Section:
    """Collects the statements of one section in the order in which they are written."""

    number: str
    claims: list[Claim] = field(default_factory=list)

    def claim(self, quotation: str, says: str, importance: int = 0) -> Callable[[Measure], Measure]:
        """Register the measurement that tests a statement."""

        def register(measure: Measure) -> Measure:
            identity = f"{self.number}-{len(self.claims) + 1:02d}"
            self.claims.append(Claim(identity, self.number, quotation, says, measure, importance))
            return measure

        return register

    def value(
        self,
        quotation: str,
        printed: str,
        unit: str,
        measure: Callable[[Laboratory], float],
        *,
        what: str,
        fixed_step: Callable[[Laboratory], str] | None = None,
    ) -> None:
        """Register a printed number; `what` names the quantity in the reason."""
        suffix = f" {unit}" if unit else ""

        @self.claim(quotation, f"{printed}{suffix}")
        def compare(lab: Laboratory) -> Outcome:
            measured = measure(lab)
            assessment = printed_value(measured, printed)
            because = f"{what} is {measured:.5g}{suffix}; the paper prints {printed}"
            if assessment.verdict is Verdict.LAST_DIGIT and cut_like(measured, printed):
                because += ", cut off instead of rounded"
            return Outcome(assessment, f"{measured:.6g}{suffix}", because, fixed_step(lab) if fixed_step else "")

    def trend(
        self,
        quotation: str,
        says: str,
        measure: Callable[[Laboratory], Sequence[float]],
        what: str,
        because: str | Callable[[Laboratory], str],
        *,
        grows: bool,
        form: str = "{:.4g}",
        unit: str = "",
    ) -> None:
        """Register that a quantity rises or falls; `what` names it, and `because` is where it was found."""

        @self.claim(quotation, says)
        def compare(lab: Laboratory) -> Outcome:
            values = measure(lab)
            numbers = " → ".join(form.format(value) for value in values) + (f" {unit}" if unit else "")
            reason = because if isinstance(because, str) else because(lab)
            return Outcome(trend(values, what, grows=grows), numbers, reason)

    def named(self, quotation: str, name: str, omega: float) -> None:
        """Register the name of a motion at a frequency."""

        @self.claim(quotation, f"{name} at w = {omega:g}")
        def compare(lab: Laboratory) -> Outcome:
            motion = lab.motion(omega=omega)
            hits = lab.window(omega=omega).velocity
            other = motion.name != name and beside(lab, [omega], name, lambda motion: motion.name == name)
            return Outcome(
                is_true(motion.name == name, "the recognised motion has the name that the paper gives"),
                motion.name,
                f"after {lab.scale.settle_impacts} impacts: {motion.sentence(OSCILLATOR.replace(omega=omega).period)}"
                + (f"; {other}" if other else ""),
                f"{len(hits)} impacts, {hits.min():.3g} to {hits.max():.3g} m/s" if len(hits) else "no impact",
            )

    def fills(self, quotation: str, what: str, low: str, high: str, has: Test) -> None:
        """Register "this motion throughout [low, high]"."""

        @self.claim(quotation, f"{what} in [{low}, {high}]")
        def compare(lab: Laboratory) -> Outcome:
            scan = lab.scan().between(low, high)
            flags = scan.where(has)
            return Outcome(
                fills_interval(list(scan.omega), list(flags), low, high),
                f"at {np.mean(flags):.0%} of the frequencies",
                f"present at every scanned frequency of the interval ({len(flags)} in all)"
                if flags.all()
                else f"from rest, other motions {intervals(scan.omega, ~flags)}: {commonest(scan.motions, ~flags)}; "
                f"{beside(lab, scan.omega[~flags], what, has)}",
            )

    def chaotic(self, quotation: str, low: str, high: str, importance: int = 0) -> None:
        """Register "the motions are unstable in [low, high]"."""

        @self.claim(quotation, f"unstable in [{low}, {high}]", importance)
        def compare(lab: Laboratory) -> Outcome:
            scan = lab.scan().between(low, high)
            flags = scan.where(aperiodic)
            return Outcome(
                nearly_all(float(np.mean(flags)), "the frequencies of the interval are aperiodic"),
                f"aperiodic at {np.mean(flags):.0%} of the frequencies",
                f"motions that repeat {intervals(scan.omega, ~flags)} ({commonest(scan.motions, ~flags)})",
                lab.unsettled(float(low), float(high)),
            )

    # The following patterns recur in the subsections of section 4.

    def natural(self, quotation: str, printed: str, **changes: float) -> None:
        """Register a printed natural frequency."""
        frequency = OSCILLATOR.replace(**changes).natural_frequency
        self.value(quotation, printed, "rad/s", lambda lab: frequency, what="w_n = sqrt(k/m)")

    def natural_trend(self, quotation: str, name: str, values: tuple[float, ...], *, grows: bool) -> None:
        """Register that w_n rises or falls along values of a parameter."""
        frequencies = [OSCILLATOR.replace(**{name: value}).natural_frequency for value in values]
        because = f"w_n = sqrt(k/m) at {name} = " + ", ".join(f"{value:g}" for value in values)
        says = "w_n rises" if grows else "w_n falls"
        self.trend(quotation, says, lambda lab: frequencies, "w_n", because, grows=grows, unit="rad/s")

    def first_resonance(self, quotation: str, printed: str, **changes: float) -> None:
        """Register the first impact resonance; the peak is searched for within 15 % of the printed frequency."""
        near = float(printed)
        what = "the frequency w of the peak of the impact velocity near 2 w_n"
        self.value(quotation, printed, "rad/s", lambda lab: lab.peak(near, 0.15 * near, **changes)[0], what=what)

    def resonance_series(self, quotation: str, count: int, **changes: float) -> None:
        """Register "n impact resonances": a peak of the velocity at each 2 n w_n on a period-n impact-1 motion."""
        omega_n = OSCILLATOR.replace(**changes).natural_frequency

        @self.claim(quotation, f"{count} resonances")
        def compare(lab: Laboratory) -> Outcome:
            names, places = [], []
            for n in range(1, int(TOP / (2 * omega_n)) + 1):
                omega, _ = lab.peak(2 * n * omega_n, 0.1 * omega_n, **changes)
                motion = lab.motion(omega=omega, **changes)
                names.append(period_impact(n, 1)(motion))
                places.append(f"{omega:.3f} ({motion.name})")
            rules = printed_value(sum(names), str(count)), is_true(all(names), "the n-th hits once in n periods")
            because = f"peaks of the impact velocity at w = {', '.join(places)}"
            return Outcome(all_of(rules), f"{sum(names)} resonances", because)

    def axis_height(
        self, quotation: str, printed: str, importance: int = 0, resonance: float | None = None, **changes: float
    ) -> None:
        """Register the upper end of a velocity axis and, if the paper gives it as the reason, a resonance."""

        @self.claim(quotation, f"axis to {printed}", importance)
        def compare(lab: Laboratory) -> Outcome:
            omega, height = lab.largest(**changes)
            in_window, _ = lab.window(omega=omega, **changes).hardest
            because = f"the largest velocity in (0, {TOP:g}] is {height:.4g} m/s at w = {omega:.4g}"
            because += f"; the axis ends at {printed}"
            because += "; in the paper's window that motion is still growing" if in_window < 0.9 * height else ""
            window_text = f"at most {in_window:.4g} m/s at that w"
            rules = [axis_limit(height, printed)]
            if resonance is not None:
                at, peak = lab.peak(resonance, 0.15 * resonance, **changes)
                rules.append(is_true(peak <= float(printed), "the axis holds the first impact resonance, its reason"))
                because += f"; the first impact resonance, the reason given, reaches {peak:.4g} m/s at w = {at:.4g}"
            return Outcome(all_of(rules), f"at most {height:.4g} m/s", because, window_text)

    def impact_rate(self, quotation: str, says: str, name: str, values: tuple[float, ...], importance: int) -> None:
        """Register that the first value of a parameter gives the most impacts per period, the last one the fewest."""
        symbol = pair_of(name).symbol
        many, few = (f"{symbol} = {value:g}" for value in (values[0], values[-1]))

        @self.claim(quotation, says, importance)
        def compare(lab: Laboratory) -> Outcome:
            per_value = [rates(lab, **{name: value}) for value in values]
            both = np.all(np.isfinite(per_value), axis=0)
            wrong = both & (per_value[-1] > per_value[0] + 1e-6)
            share, omega = 1.0 - float(wrong.sum() / both.sum()), lab.line(**{name: values[0]})["omega"].values
            rule = f"the frequencies without sticking have no more impacts per period at {few} than at {many}"
            means = ", ".join(
                f"{rate[both].mean():.3g} at {value:g}" for rate, value in zip(per_value, values, strict=True)
            )
            return Outcome(
                nearly_all(share, rule),
                f"{share:.0%} of {both.sum()} frequencies",
                f"more impacts at {few} {intervals(np.round(omega, 4), wrong)}; mean impacts per period by {symbol}: "
                f"{means}; a stick has infinitely many",
            )

    def map_claims(self, mountain: str, flat: str, contour: str, marker: str) -> Pair:
        """Register the paper's four statements about the map of this section; return its pair of parameters."""
        pair = next(pair for pair in PAIRS if pair.section == self.number)
        figure = pair.map_figure

        @self.claim(f"{mountain} (Fig. {figure}a)", "mountain = unstable", 1)
        def mountains(lab: Laboratory) -> Outcome:
            share, _, _ = shares(lab, pair)
            cells = lab.cells(pair.name)
            stable = commonest(cells.motions, (cells.std >= lab.level) & cells.stable)
            return Outcome(
                nearly_all(share, f"the cells with Std >= {lab.level:g} m/s have motions that never repeat"),
                f"{share:.1%} of the mountain",
                f"the other {1 - share:.1%} of the mountain is stable motion whose impacts differ within a cycle "
                f"({stable}); {len(cells.std)} cells of the map were named",
            )

        @self.claim(f"{flat} (Fig. {figure}a)", "flat = stable")
        def plains(lab: Laboratory) -> Outcome:
            _, share, _ = shares(lab, pair)
            return Outcome(
                nearly_all(share, f"the cells with Std < {lab.level:g} m/s have motions that repeat"),
                f"{share:.1%} of the plain",
                f"{1 - share:.1%} of the plain is chaos of low velocity, or settles more slowly than was sampled",
            )

        @self.claim(f"{contour} (Fig. {figure}b)", "the contour divides stable from unstable", 1)
        def boundaries(lab: Laboratory) -> Outcome:
            _, _, share = shares(lab, pair)
            return Outcome(
                nearly_all(share, f"the cells lie on the right side of the boundary drawn at {lab.level:g} m/s"),
                f"{share:.1%} of the cells",
                f"a boundary of Std at {lab.level:g} m/s puts {1 - share:.1%} of the cells on the wrong side, "
                "nearly all of them stable motions with several impacts per cycle or a stick",
            )

        @self.claim(f"{marker} (Fig. {figure}b)", f"the line {pair.symbol} = {pair.reference:g} is Fig. 3")
        def marker_line(lab: Laboratory) -> Outcome:
            diagram, line = lab.results["figure-03"], lab.results["figure-10"]["std"]
            differ = (diagram["velocity"].std("impact").values >= lab.level) != (line.values >= lab.level)
            nearest = float(lab.results[pair.key][pair.name].sel({pair.name: pair.reference}, method="nearest"))
            return Outcome(
                nearly_all(1.0 - float(np.mean(differ)), "the frequencies lie on the same side of the level in both"),
                f"{1 - np.mean(differ):.1%} of {len(differ)} frequencies",
                f"Std at {pair.symbol} = {pair.reference:g} at the sampling of the map, against that of the velocities "
                f"in Fig. 3; the sides differ {intervals(np.round(diagram['omega'].values, 4), differ)}; the map's "
                f"nearest row is {pair.symbol} = {nearest:.4g}",
            )

        return pair

    def region_count(self, quotation: str) -> None:
        """Register "six regions" of sticking, period-1 impact-1, period-2 impact-1 and the rest, >= 0.2 rad/s wide."""

        def kind(motion: Motion) -> str:
            if sticks(motion):
                return "sticking"
            return motion.name if motion.n_impacts == 1 and motion.n_periods in (1, 2) else "other"

        @self.claim(quotation, "six regions")
        def compare(lab: Laboratory) -> Outcome:
            scan = lab.scan()
            regions = merge_runs(list(scan.omega), [kind(motion) for motion in scan.motions], 0.2)
            listing = "; ".join(f"{what} {low:g} to {high:g}" for what, low, high in regions)
            because = f"{listing}. The paper prints the range as w = [1, 5]; its own list begins at 0"
            return Outcome(printed_value(len(regions), "6"), f"{len(regions)} regions", because)


def beside(lab: Laboratory, frequencies: Sequence[float] | Floats, what: str, has: Test) -> str:
    """Return the share of a motion among those that coexist, at up to 12 of the frequencies, spread evenly."""
    chosen = [float(frequencies[i]) for i in np.unique(np.linspace(0, len(frequencies) - 1, 12).round().astype(int))]
    shares = [sum(attractor.share for attractor in lab.coexisting(omega) if has(attractor.motion)) for omega in chosen]
    flags = np.array(shares) > 0.0
    looked = f"of 256 other initial conditions at {len(chosen)} of these frequencies" if len(chosen) > 1 else ""
    if not flags.any():
        return f"no {what} motion coexists: none {looked or 'of 256 other initial conditions'} leads to one"
    reached = [share for share in shares if share > 0.0]
    parts = f"{min(reached):.0%}" + (f" to {max(reached):.0%}" if len(reached) > 1 else "")
    gone = "" if flags.all() else f", not {intervals(chosen, ~flags)}"
    return f"coexistence: {parts} {looked or 'of 256 other initial conditions'} lead to {what} motions{gone}"


def shares(lab: Laboratory, pair: Pair) -> tuple[float, float, float]:
    """Return the shares of mountain cells that are unstable, of flat cells that are stable, and of both right."""
    cells = lab.cells(pair.name)
    high = cells.std >= lab.level
    right = np.where(high, ~cells.stable, cells.stable)
    return float(np.mean(~cells.stable[high])), float(np.mean(cells.stable[~high])), float(np.mean(right))


def rates(lab: Laboratory, **changes: float) -> Floats:
    """Return impacts per driving period along w; NaN if the motion sticks, as the count depends on the cut-off then."""
    line = lab.line(**changes)
    chattering = np.isin(line["status"], [vi.Status.STICKING, vi.Status.SHORT_WINDOW])
    return np.where(chattering, np.nan, line["impacts_per_period"])


def sticking_cells(lab: Laboratory, name: str, *, above: bool) -> tuple[float, float]:
    """Return the largest impact velocity of sticking cells and their share, above or below the parameter's value 1."""
    cells = lab.cells(name)
    side = cells.parameter > 1 if above else cells.parameter < 1
    sticking = [motion for motion, inside in zip(cells.motions, side, strict=True) if inside and sticks(motion)]
    return max((max(motion.velocities) for motion in sticking), default=0.0), len(sticking) / int(side.sum())


def merge_runs(positions: list[float], kinds: list[str], least: float) -> list[tuple[str, float, float]]:
    """Return runs of equal kind of at least width `least`; narrower ones count as "other".

    Examples
    --------
    >>> merge_runs([0.1, 0.2, 0.3, 0.4, 0.5], ["a", "a", "b", "a", "c"], 0.1)
    [('a', 0.1, 0.2), ('other', 0.3, 0.5)]
    """
    runs: list[tuple[str, float, float]] = []
    for position, kind in zip(positions, kinds, strict=True):
        if runs and runs[-1][0] == kind:
            runs[-1] = (kind, runs[-1][1], position)
        else:
            runs.append((kind, position, position))
    if all(high - low >= least - 1e-9 or kind == "other" for kind, low, high in runs):
        return [run for run in runs if run[2] - run[1] >= least - 1e-9]
    spread = {position: kind if high - low >= least - 1e-9 else "other"
              for kind, low, high in runs for position in positions if low <= position <= high}  # fmt: skip
    return merge_runs(positions, [spread[position] for position in positions], least)
