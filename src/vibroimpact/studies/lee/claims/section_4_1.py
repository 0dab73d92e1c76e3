"""Section 4.1: the effects of mass."""

from __future__ import annotations

from vibroimpact.studies.lee.claims.base import Finding, Section
from vibroimpact.studies.lee.claims.maps import map_claims, region_count, six_regions
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

mass = Section("4.1")

map_claims(
    mass, pair_of("mass"),
    "The high mountain-like pattern indicates that the Std is high, indicating unstable motions",
    "The flat area represents small Std values, indicating periodic motions",
    "the stable and unstable boundaries of the impact motions are classified",
    "the horizontal line represents the indication of Std when m = 1 ... depicted in Fig. 3",
)  # fmt: skip
natural(mass, "the resonance of free oscillation is w_n = 1", "1")
region_count(mass, "Six regions are classified by impact motion at the driving frequency w = [1, 5]")
six_regions(mass)
natural_trend(
    mass, "When the mass is small (m < 1), the resonance of free oscillation increases", "mass", (1.0, 0.5, 0.1), True
)


@mass.claim("[m < 1] the impact motions correspond to high Std values", "higher Std for m < 1")
def lighter_is_rougher(lab: Laboratory) -> Finding:
    """Compare the mean Std of the map above and below m = 1."""
    std = lab.results[pair_of("mass").key]["std"]
    heavy, light = float(std.where(std["mass"] > 1).mean()), float(std.where(std["mass"] < 1).mean())
    return Finding(
        rises([heavy, light], "the mean of Std from m > 1 to m < 1"),
        f"{light:.3g} against {heavy:.3g} m/s",
        f"mean Std over all w: {light:.3g} m/s for m < 1, {heavy:.3g} m/s for m > 1",
    )


@mass.claim("[m < 1] ... and increases in the amplitudes of sticking and chattering motions", "harder sticking motions")
def lighter_sticks_harder(lab: Laboratory) -> Finding:
    """Compare the hardest hits of sticking cells above and below m = 1."""
    (heavy, _), (light, _) = sticking_height(lab, "mass", True), sticking_height(lab, "mass", False)
    return Finding(
        rises([heavy, light], "the hardest hit of sticking cells from m > 1 to m < 1"),
        f"{light:.3g} against {heavy:.3g} m/s",
        f"the hardest hit among sticking cells is {light:.3g} m/s for m < 1 and {heavy:.3g} m/s for m > 1",
    )


natural(mass, "[m = 0.1] The resonance of free oscillation is w_n = 3.1", "3.1", mass=0.1)
first_resonance(mass, "[m = 0.1] the first impact resonance is approximately 6.2", "6.2", mass=0.1)
axis_height(mass, "[m = 0.1] the amplitude on the y-axis is increased to 8", "8", mass=0.1)
natural_trend(
    mass, "When the mass increases (m > 1), the resonance of free oscillation decreases", "mass", (1.0, 2.0, 5.0), False
)


@mass.claim("Consequently, the period-n impact resonances also decrease", "resonances move down with m")
def resonances_move_down(lab: Laboratory) -> Finding:
    """Find the first impact resonance for three masses."""
    found = [lab.peak(2 * OSCILLATOR.replace(mass=m).natural_frequency, mass=m)[0] for m in (1.0, 2.0, 5.0)]
    return Finding(
        falls(found, "the frequency of the first impact resonance"),
        " → ".join(f"{w:.4g}" for w in found) + " rad/s",
        "first impact resonance at m = 1, 2, 5",
    )


natural(mass, "[m = 5] The resonance of free oscillation is w_n = 0.44", "0.44", mass=5.0)
first_resonance(mass, "[m = 5] the first impact resonance is approximately 0.88", "0.88", mass=5.0)
resonance_series(
    mass, "[m = 5] The period-n impact resonances for n = 1 to 5 are presented", 5,
    OSCILLATOR.replace(mass=5.0).natural_frequency, mass=5.0,
)  # fmt: skip
