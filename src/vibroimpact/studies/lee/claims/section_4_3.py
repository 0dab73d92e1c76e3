"""Section 4.3: the effects of stiffness."""

from __future__ import annotations

from functools import partial

from vibroimpact.studies.lee.claims.base import Finding, Section
from vibroimpact.studies.lee.claims.maps import map_claims, region_count
from vibroimpact.studies.lee.claims.resonances import (
    axis_height,
    first_resonance,
    natural,
    natural_trend,
    resonance_series,
    sticking_height,
)
from vibroimpact.studies.lee.laboratory import Laboratory
from vibroimpact.studies.lee.paper import OSCILLATOR, pair_of
from vibroimpact.studies.lee.rules import falls, rises

stiffness = Section("4.3")

map_claims(
    stiffness, pair_of("stiffness"),
    "the mountain-like area indicates unstable motions",
    "the flat area indicates stable motions",
    "the stable and unstable boundaries of the impact motions are classified in the (w, k) domain",
    "the horizontal line represents the indication of Std when k = 1 ... depicted in Fig. 3",
)  # fmt: skip
natural(stiffness, "the resonance of free oscillation is w_n = 1", "1")
region_count(stiffness, "Six regions are classified by impact motion at the driving frequency w = [1, 5]")
natural_trend(
    stiffness, "When the stiffness k decreases, so does the resonance of the free oscillation", "stiffness",
    (1.0, 0.5, 0.1), False,
)  # fmt: skip


def _softer(lab: Laboratory, part: int) -> Finding:
    peaks = [lab.peak(2 * OSCILLATOR.replace(stiffness=k).natural_frequency, stiffness=k) for k in (1.0, 0.5, 0.1)]
    found = [peak[part] for peak in peaks]
    what, unit = (("frequency", "rad/s"), ("height", "m/s"))[part]
    return Finding(
        (falls, rises)[part](found, f"the {what} of the first impact resonance, k falling,"),
        " → ".join(f"{value:.4g}" for value in found) + f" {unit}",
        f"{what} of the first impact resonance at k = 1, 0.5, 0.1",
    )


stiffness.claim("Thus, the location of the impact resonances shifts forward", "towards lower w")(
    partial(_softer, part=0)
)
stiffness.claim("and the amplitude of the impact motions increases", "harder hits")(partial(_softer, part=1))
natural(stiffness, "[k = 0.1] The resonance of free oscillation is w_n = 0.31", "0.31", stiffness=0.1)
first_resonance(stiffness, "[k = 0.1] the first impact resonance is approximately 0.62", "0.62", stiffness=0.1)
resonance_series(
    stiffness, "[k = 0.1] Seven impact resonances appear", 7, OSCILLATOR.replace(stiffness=0.1).natural_frequency,
    stiffness=0.1,
)  # fmt: skip
stiffness.value(
    "[k = 0.1] the impact magnitude is amplified by a factor of 3 relative to k = 1", "3", "",
    lambda lab: lab.largest(stiffness=0.1)[1] / lab.largest()[1], what="the ratio of the largest impact velocities",
)  # fmt: skip
natural_trend(
    stiffness, "When the stiffness k increases, so do the resonance of free oscillation ...", "stiffness",
    (1.0, 2.0, 5.0), True,
)  # fmt: skip


def _stiffer(lab: Laboratory) -> Finding:
    heights = [lab.largest(stiffness=k)[1] for k in (1.0, 2.0, 5.0)]
    return Finding(
        falls(heights, "the largest impact velocity, k rising,"),
        " → ".join(f"{value:.4g}" for value in heights) + " m/s",
        "largest impact velocity over all w at k = 1, 2, 5",
    )


@stiffness.claim("When the stiffness k increases, so do ... the impact motions", "impact motions move up in w")
def impact_motions_move_up(lab: Laboratory) -> Finding:
    """Find the first impact resonance for rising stiffness; the mean velocity goes the other way."""
    values = (1.0, 2.0, 5.0)
    found = [lab.peak(2 * OSCILLATOR.replace(stiffness=k).natural_frequency, stiffness=k)[0] for k in values]
    means = [float(lab.line(stiffness=k)["mean_velocity"].mean()) for k in values]
    return Finding(
        rises(found, "the frequency of the first impact resonance, k rising,"),
        " → ".join(f"{w:.4g}" for w in found) + " rad/s",
        "read as frequencies, as the first half of the sentence is; the mean impact velocity over all w does not rise: "
        + " → ".join(f"{mean:.3g}" for mean in means)
        + " m/s",
    )


stiffness.claim("As a result, the effect of the impact resonances decreases", "weaker resonances")(_stiffer)


@stiffness.claim("... and the sticking and chattering motions increase", "more sticking at larger k")
def stiffer_sticks_more(lab: Laboratory) -> Finding:
    """Compare the shares of sticking cells above and below k = 1."""
    (_, stiff), (_, soft) = sticking_height(lab, "stiffness", True), sticking_height(lab, "stiffness", False)
    return Finding(
        rises([soft, stiff], "the share of sticking cells from k < 1 to k > 1"),
        f"{stiff:.1%} against {soft:.1%}",
        f"sticking cells: {stiff:.1%} of the map for k > 1, {soft:.1%} for k < 1",
    )


natural(stiffness, "[k = 5] The resonance of free oscillation is w_n = 2.23", "2.23", stiffness=5.0)
first_resonance(stiffness, "[k = 5] the first impact resonance is approximately 4.46", "4.46", stiffness=5.0)
axis_height(stiffness, "[k = 5] the amplitude in the y-axis is reduced to 3", "3", stiffness=5.0)
