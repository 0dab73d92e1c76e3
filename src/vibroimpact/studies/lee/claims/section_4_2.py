"""Section 4.2: the effects of damping."""

from __future__ import annotations

import numpy as np

from vibroimpact.status import Status
from vibroimpact.studies.lee.claims.base import Finding, Section
from vibroimpact.studies.lee.claims.maps import map_claims
from vibroimpact.studies.lee.laboratory import Floats, Laboratory, intervals
from vibroimpact.studies.lee.paper import OSCILLATOR, pair_of
from vibroimpact.studies.lee.rules import falls, nearly_all

damping = Section("4.2")
VALUES = (OSCILLATOR.damping, 0.5, 1.0)

map_claims(
    damping, pair_of("damping"),
    "the mountain-like area indicates unstable motions",
    "The flat area indicates stable motions",
    "the stable and unstable regions of the impact motions are classified in the (w, c) domain",
    "the horizontal line represents the indication of Std when c = 0.01 ... depicted in Fig. 3",
)  # fmt: skip


def rates(lab: Laboratory, **changes: float) -> Floats:
    """Return impacts per driving period along w; NaN where the motion sticks and the count is the cut-off's."""
    line = lab.line(**changes)
    chattering = np.isin(line["status"], [Status.STICKING, Status.SHORT_WINDOW])
    return np.where(chattering, np.nan, line["impacts_per_period"])


@damping.claim("When the damping c increases, the impacting rate ... [is] reduced", "fewer impacts", importance=3)
def rate_falls(lab: Laboratory) -> Finding:
    """Compare impacts per period at the same w for the smallest and the largest damping, sticking motions left out."""
    found = [rates(lab, damping=c) for c in VALUES]
    both = np.all(np.isfinite(found), axis=0)
    more = both & (found[-1] > found[0] + 1e-6)
    share = 1.0 - float(more.sum() / both.sum())
    means = ", ".join(f"{rate[both].mean():.3g}" for rate in found)
    return Finding(
        nearly_all(share, "the frequencies without sticking have no more impacts a period at c = 1 than at c = 0.01"),
        f"{share:.0%} of {both.sum()} frequencies",
        f"more impacts at c = 1 {intervals(np.round(lab.line()['omega'].values, 4), more)}; mean impacts a period "
        f"{means} at c = {', '.join(f'{c:g}' for c in VALUES)}; a stick makes it infinite",
    )


@damping.claim("... and the amplitude of impact resonance [is] reduced", "lower peaks")
def amplitude_falls(lab: Laboratory) -> Finding:
    """Compare the largest impact velocity over all w for three dampings."""
    heights = [lab.largest(damping=c) for c in VALUES]
    return Finding(
        falls([height for _, height in heights], "the largest impact velocity over all w, c rising,"),
        " → ".join(f"{height:.4g}" for _, height in heights) + " m/s",
        "at c = " + ", ".join(f"{c:g} (w = {w:.3g})" for c, (w, _) in zip(VALUES, heights, strict=True)),
    )


@damping.claim(
    "when the pair of w and c varies, the stable and unstable boundaries appear in the (w, c) domain", "boundaries"
)
def boundaries_appear(lab: Laboratory) -> Finding:
    """Count rows of the map in which Std crosses the level."""
    high = lab.results[pair_of("damping").key]["std"].transpose("damping", "omega").values >= lab.level
    crossings = np.sum(high[:, 1:] != high[:, :-1], axis=1)
    return Finding(
        nearly_all(float(np.mean(crossings > 0)), "the rows of the map have a boundary"),
        f"{crossings.min()} to {crossings.max()} crossings a row",
        f"{crossings[0]} boundaries along w at the smallest c, {crossings[-1]} at the largest",
    )
