"""Section 4.5: the effects of the coefficient of restitution."""

from __future__ import annotations

import numpy as np

from vibroimpact.studies.lee.claims.base import Finding, Section
from vibroimpact.studies.lee.claims.maps import map_claims
from vibroimpact.studies.lee.claims.motions import sticks
from vibroimpact.studies.lee.claims.resonances import axis_height
from vibroimpact.studies.lee.claims.section_4_2 import rates
from vibroimpact.studies.lee.laboratory import Laboratory, intervals, repeats
from vibroimpact.studies.lee.paper import OSCILLATOR, pair_of
from vibroimpact.studies.lee.rules import falls, is_true, nearly_all

restitution = Section("4.5")

map_claims(
    restitution, pair_of("restitution"),
    "the mountain-like area indicates unstable motions",
    "The flat area indicates stable motions",
    "the stable and unstable boundaries of the impact motions are classified in the (w, r) domain",
    "the horizontal line represents the indication of Std when r = 0.8 ... presented in Fig. 3",
)  # fmt: skip


@restitution.claim(
    "When r increases, the motions with a high impacting rate occur within the full w range", "more impacts", 1
)
def rate_rises(lab: Laboratory) -> Finding:
    """Compare impacts per period at the same w for r = 0.1 and 1, sticking motions left out."""
    low, high = rates(lab, restitution=0.1), rates(lab, restitution=1.0)
    both = np.isfinite(low) & np.isfinite(high)
    omega = np.round(lab.line(restitution=0.1)["omega"].values, 4)
    less = both & (high < low - 1e-6)
    share = 1.0 - float(less.sum() / both.sum())
    return Finding(
        nearly_all(share, "the frequencies without sticking have no fewer impacts a period at r = 1 than at r = 0.1"),
        f"{share:.0%} of {both.sum()} frequencies",
        f"mean {low[both].mean():.3g} impacts a period at r = 0.1, {high[both].mean():.3g} at r = 1; "
        f"fewer at r = 1 {intervals(omega, less)}",
    )


@restitution.claim("[r = 1] two impact resonances dominate the system", "two dominant peaks")
def two_peaks(lab: Laboratory) -> Finding:
    """Compare the largest velocity near 2 and 4 with the largest anywhere else."""
    line = lab.line(restitution=1.0)
    height = line["max_velocity"].fillna(0.0)
    near = (abs(line["omega"] - 2) < 0.3) | (abs(line["omega"] - 4) < 0.3)
    first, second = (float(height.where(abs(line["omega"] - w) < 0.3).max()) for w in (2, 4))
    rest = float(height.where(~near).max())
    return Finding(
        is_true(min(first, second) > 2 * rest, "both peaks are more than twice as high as any velocity elsewhere"),
        f"{first:.4g} and {second:.4g} m/s, else at most {rest:.3g}",
        f"peaks within 0.3 of w = 2 and 4; everywhere else at most {rest:.3g} m/s",
    )


axis_height(restitution, "[r = 1] The amplitude on the y-axis is increased to 35", "35", importance=6, restitution=1.0)


@restitution.claim(
    "[r = 1] the periodic motions are disrupted by high strength impact responses", "fewer periodic motions"
)
def periodic_disrupted(lab: Laboratory) -> Finding:
    """Compare the shares of settled frequencies for r = 1 and 0.8."""
    shares = [lab.scan(step=lab.scale.variant_step, restitution=r).share(repeats) for r in (0.8, 1.0)]
    return Finding(
        falls(shares, "the share of frequencies whose motion repeats"),
        f"{shares[1]:.0%} against {shares[0]:.0%}",
        f"motions repeat at {shares[0]:.0%} of the frequencies for r = 0.8, at {shares[1]:.0%} for r = 1",
    )


@restitution.claim("Conversely, when r decreases, the impact response is attenuated gradually", "softer with r")
def attenuated(lab: Laboratory) -> Finding:
    """Compare the mean over w of the largest velocity for falling r."""
    values = (1.0, 0.8, 0.6, 0.4, 0.2, 0.1)
    means = [float(lab.line(restitution=r)["max_velocity"].mean()) for r in values]
    return Finding(
        falls(means, "the mean over w of the largest velocity, r falling,"),
        " → ".join(f"{mean:.3g}" for mean in means) + " m/s",
        "mean over w of the largest impact velocity at r = " + ", ".join(f"{r:g}" for r in values),
    )


@restitution.claim("[r = 0.1] the impact resonances are reduced", "lower peaks at 2 and 4")
def peaks_reduced(lab: Laboratory) -> Finding:
    """Compare the velocities at the two resonances for r = 0.8 and 0.1."""
    pairs = [[lab.peak(w, restitution=r)[1] for r in (0.8, 0.1)] for w in (2.0, 4.0)]
    told = "; ".join(f"{high:.3g} → {low:.3g} m/s at w = {w}" for w, (high, low) in zip((2, 4), pairs, strict=True))
    return Finding(
        is_true(all(low < high for high, low in pairs), "both peaks are lower at r = 0.1 than at r = 0.8"),
        told,
        f"from r = 0.8 to r = 0.1: {told}",
    )


restitution.value(
    "[r = 0.1] the first impact resonance shifts to w = 1", "1", "rad/s", lambda lab: lab.largest(restitution=0.1)[0],
    what="the largest impact velocity stands where w",
)  # fmt: skip


@restitution.claim("[r = 0.1] the chattering motions decay to sticking motions", "more sticking")
def chatter_sticks(lab: Laboratory) -> Finding:
    """Compare the shares of sticking frequencies for r = 0.8 and 0.1."""
    scans = [lab.scan(step=lab.scale.variant_step, restitution=r) for r in (OSCILLATOR.restitution, 0.1)]
    before, after = (scan.share(sticks) for scan in scans)
    return Finding(
        is_true(after > before, "sticking motions take a larger share of the frequencies at r = 0.1 than at r = 0.8"),
        f"{after:.0%} against {before:.0%}",
        f"sticking at r = 0.1 {intervals(scans[1].omega, scans[1].where(sticks))}",
    )


@restitution.claim("[r = 0.1] ... and the chaotic motions decay to periodic motions", "chaos becomes periodic")
def chaos_decays(lab: Laboratory) -> Finding:
    """Count the frequencies unstable at r = 0.8 that are settled at r = 0.1."""
    scans = [lab.scan(step=lab.scale.variant_step, restitution=r) for r in (OSCILLATOR.restitution, 0.1)]
    omega, (before, after) = scans[0].omega, (scan.where(repeats) for scan in scans)
    share = float(np.mean(after[~before]))
    return Finding(
        nearly_all(share, "the frequencies unstable at r = 0.8 have a periodic or sticking cycle at r = 0.1"),
        f"{share:.1%} of {np.sum(~before)} frequencies",
        f"still aperiodic at r = 0.1 {intervals(omega, ~after)}",
    )
