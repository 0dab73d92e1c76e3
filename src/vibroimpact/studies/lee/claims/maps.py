"""What section 4 says of each of its five maps: mountains, plains, boundaries, marker line, six regions."""

from __future__ import annotations

import numpy as np

from vibroimpact.motion import Motion
from vibroimpact.studies.lee.claims.base import Finding, Section
from vibroimpact.studies.lee.claims.motions import chaotic, commonest, fills, period_impact, sticks
from vibroimpact.studies.lee.laboratory import Laboratory, intervals
from vibroimpact.studies.lee.paper import Pair
from vibroimpact.studies.lee.rules import nearly_all, printed_value


def shares(lab: Laboratory, pair: Pair) -> tuple[float, float, float]:
    """Return the shares of mountain cells that are unstable, of flat cells that are stable, and of both right."""
    cells = lab.cells(pair.name)
    high = cells.std >= lab.level
    right = np.where(high, ~cells.stable, cells.stable)
    return float(np.mean(~cells.stable[high])), float(np.mean(cells.stable[~high])), float(np.mean(right))


def stable_mountains(lab: Laboratory, pair: Pair) -> str:
    """Return the commonest stable motions above the level, in words."""
    cells = lab.cells(pair.name)
    flags = (cells.std >= lab.level) & cells.stable
    return commonest(cells.motions, flags)


def map_claims(section: Section, pair: Pair, mountain: str, flat: str, contour: str, marker: str) -> None:
    """Register the four statements that the paper makes of every map."""
    figure = pair.map_figure

    def mountains(lab: Laboratory) -> Finding:
        share, _, _ = shares(lab, pair)
        return Finding(
            nearly_all(share, f"the cells with Std >= {lab.level:g} m/s have motions that never repeat"),
            f"{share:.1%} of the mountain",
            f"the other {1 - share:.1%} of the mountain is stable motion whose impacts differ within a cycle "
            f"({stable_mountains(lab, pair)}); {len(lab.cells(pair.name).std)} cells of the map were named",
        )

    def plains(lab: Laboratory) -> Finding:
        _, share, _ = shares(lab, pair)
        return Finding(
            nearly_all(share, f"the cells with Std < {lab.level:g} m/s have motions that repeat"),
            f"{share:.1%} of the plain",
            f"{1 - share:.1%} of the plain is chaos of low velocity, or settles more slowly than was sampled",
        )

    def boundaries(lab: Laboratory) -> Finding:
        _, _, share = shares(lab, pair)
        return Finding(
            nearly_all(share, f"the cells lie on the right side of the boundary drawn at {lab.level:g} m/s"),
            f"{share:.1%} of the cells",
            f"a boundary of Std at {lab.level:g} m/s puts {1 - share:.1%} of the cells on the wrong side, "
            "nearly all of them stable motions with several hits a cycle or a stick",
        )

    def marker_line(lab: Laboratory) -> Finding:
        diagram, line = lab.results["figure-03"], lab.results["figure-10"]["std"]
        differ = (diagram["velocity"].std("impact").values >= lab.level) != (line.values >= lab.level)
        nearest = float(lab.results[pair.key][pair.name].sel({pair.name: pair.reference}, method="nearest"))
        return Finding(
            nearly_all(1.0 - float(np.mean(differ)), "the frequencies lie on the same side of the level in both"),
            f"{1 - np.mean(differ):.1%} of {len(differ)} frequencies",
            f"Std at {pair.symbol} = {pair.reference:g} at the sampling of the map, against that of the velocities in "
            f"Fig. 3; the sides differ {intervals(np.round(diagram['omega'].values, 4), differ)}; the map's nearest "
            f"row is {pair.symbol} = {nearest:.4g}",
        )

    section.claim(f"{mountain} (Fig. {figure}a)", "mountain = unstable", 1)(mountains)
    section.claim(f"{flat} (Fig. {figure}a)", "flat = stable")(plains)
    section.claim(f"{contour} (Fig. {figure}b)", "the contour divides stable from unstable", 1)(boundaries)
    section.claim(f"{marker} (Fig. {figure}b)", f"the line {pair.symbol} = {pair.reference:g} is Fig. 3")(marker_line)


def region_count(section: Section, quotation: str) -> None:
    """Register "six regions": sticking, period-1 impact-1, period-2 impact-1 and the rest, 0.2 rad/s wide or more."""

    def kind(motion: Motion) -> str:
        if sticks(motion):
            return "sticking"
        return motion.name if motion.n_impacts == 1 and motion.n_periods in (1, 2) else "other"

    def judge(lab: Laboratory) -> Finding:
        scan = lab.scan()
        kinds = [kind(motion) for motion in scan.motions]
        regions = merge_runs(list(scan.omega), kinds, 0.2)
        told = "; ".join(f"{what} {low:g} to {high:g}" for what, low, high in regions)
        return Finding(
            printed_value(len(regions), "6"),
            f"{len(regions)} regions",
            f"{told}. The paper prints the range as w = [1, 5]; its own list begins at 0",
        )

    section.claim(quotation, "six regions")(judge)


def merge_runs(positions: list[float], kinds: list[str], least: float) -> list[tuple[str, float, float]]:
    """Return runs of equal kind at least so wide; what is narrower counts as "other".

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


def six_regions(section: Section) -> None:
    """Register the six regions that section 4.1 lists at m = 1."""
    fills(section, "The sticking motion is within [0, 0.25]", "sticking", "0.00", "0.25", sticks)
    for n, low, high in ((1, "1.25", "2.5"), (2, "3.5", "4.5")):
        quotation = f"the period-{n} impact-1 motion is within [{low}, {high}]"
        fills(section, quotation, f"period-{n} impact-1", low, high, period_impact(n, 1))
    for low, high in (("0.25", "1.25"), ("2.5", "3.5"), ("4.5", "5.0")):

        def judge(lab: Laboratory, low: str = low, high: str = high) -> Finding:
            scan = lab.scan().between(float(low), float(high))
            flags = scan.where(chaotic)
            return Finding(
                nearly_all(float(np.mean(flags)), "the frequencies of the interval are aperiodic"),
                f"aperiodic at {np.mean(flags):.0%} of the frequencies",
                f"motions that repeat {intervals(scan.omega, ~flags)}",
                lab.restless(float(low), float(high)),
            )

        section.claim(f"the unstable motions are within [{low}, {float(high):g}]", f"unstable in [{low}, {high}]")(
            judge
        )
