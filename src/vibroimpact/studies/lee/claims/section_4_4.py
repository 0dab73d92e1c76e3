"""Section 4.4: the effects of the forcing amplitude."""

from __future__ import annotations

from functools import partial

import numpy as np

from vibroimpact.studies.lee.claims.base import Finding, Section
from vibroimpact.studies.lee.claims.maps import map_claims
from vibroimpact.studies.lee.laboratory import Floats, Laboratory, Scan, intervals
from vibroimpact.studies.lee.paper import OSCILLATOR, pair_of
from vibroimpact.studies.lee.rules import nearly_all, proportional

amplitude = Section("4.4")

map_claims(
    amplitude, pair_of("amplitude"),
    "the mountain-like area indicates unstable motions",
    "The flat area indicates stable motions",
    "the stable and unstable boundaries of the impact motions are classified in the (w, f) domain",
    "the horizontal line represents the indication of Std when f = 1 ... depicted in Fig. 3",
)  # fmt: skip


@amplitude.claim(
    "When f changes, the boundaries of the impact motions remain largely unchanged", "unchanged", importance=2
)
def boundaries_stay(lab: Laboratory) -> Finding:
    """Compare the motions of every row of the map with those of the row nearest f = 1; also the drawn boundary."""
    cells = lab.cells("amplitude")
    forces = np.unique(cells.parameter)
    stable = cells.stable.reshape(-1, len(forces))
    same = float(np.mean(stable == stable[:, [_nearest(forces)]]))
    sweep = lab.results[pair_of("amplitude").key].transpose("omega", "amplitude")
    high = sweep["std"].values >= lab.level
    drawn = float(np.mean(high == high[:, [_nearest(sweep["amplitude"].values)]]))
    return Finding(
        nearly_all(same, "the named cells are stable or unstable as at the same w in the row nearest f = 1"),
        f"{same:.1%} of the cells",
        f"with g = 0 every motion scales with f, and its kind cannot depend on it; a boundary drawn at a fixed Std of "
        f"{lab.level:g} m/s does move with f: {drawn:.1%} of the cells stay on their side",
    )


def _nearest(forces: Floats) -> int:
    return int(np.argmin(np.abs(forces - OSCILLATOR.amplitude)))


def _pair(lab: Laboratory, f: float) -> tuple[Scan, Scan]:
    """Return the scans at the paper's amplitude and at another."""
    return lab.scan(step=lab.scale.variant_step), lab.scan(step=lab.scale.variant_step, amplitude=f)


def _similar(lab: Laboratory, f: float) -> Finding:
    mine, theirs = _pair(lab, f)
    same = np.array([a.name == b.name for a, b in zip(mine.motions, theirs.motions, strict=True)])
    return Finding(
        nearly_all(float(np.mean(same)), "the frequencies carry a motion of the same name at f = 1"),
        f"{np.mean(same):.1%} of {len(same)} frequencies",
        f"names differ {intervals(mine.omega, ~same)}, where long chaotic transients magnify rounding"
        if not same.all()
        else "every frequency carries the same motion",
    )


def _scaled(lab: Laboratory, f: float) -> Finding:
    mine, theirs = _pair(lab, f)
    ratios = [
        max(b.velocities) / max(a.velocities)
        for a, b in zip(mine.motions, theirs.motions, strict=True)
        if a.kind == b.kind == "periodic" and a.n_impacts == b.n_impacts
    ]
    worst = max(abs(ratio / f - 1.0) for ratio in ratios)
    return Finding(
        proportional(ratios, f),
        f"ratio {f:g} to a relative {worst:.1e}",
        f"the hardest hits of {len(ratios)} periodic motions stand in the ratio of the forces to {worst:.1e}",
    )


for _f in (0.1, 5.0):
    amplitude.claim(f"The various types of impact motions exhibit similar patterns (f = {_f:g})", "similar patterns")(
        partial(_similar, f=_f)
    )
for _f in (0.1, 5.0):
    amplitude.claim(f"the magnitudes of the impact velocities are proportioned to f (f = {_f:g})", "proportional to f")(
        partial(_scaled, f=_f)
    )
