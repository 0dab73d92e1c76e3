"""Section 5: the conclusions."""

from __future__ import annotations

from vibroimpact.studies.lee.claims.base import Finding, Section
from vibroimpact.studies.lee.claims.maps import shares
from vibroimpact.studies.lee.claims.motions import chaotic, sticks
from vibroimpact.studies.lee.claims.section_3_5 import strong_agreement
from vibroimpact.studies.lee.laboratory import Laboratory
from vibroimpact.studies.lee.paper import PAIRS
from vibroimpact.studies.lee.rules import is_true, nearly_all

conclusions = Section("5")


@conclusions.claim("the sticking, periodic, and chaotic motions are characterised", "all three kinds occur")
def three_kinds(lab: Laboratory) -> Finding:
    """Count the kinds of motion in the scan."""
    scan = lab.scan()
    shares_found = [scan.share(sticks), scan.share(lambda m: m.kind == "periodic"), scan.share(chaotic)]
    told = ", ".join(
        f"{what} {share:.0%}" for what, share in zip(("sticking", "periodic", "aperiodic"), shares_found, strict=True)
    )
    return Finding(is_true(min(shares_found) > 0, "each kind is recognised at some frequency"), told, f"{told} of w")


conclusions.claim(
    "The results for the bifurcation diagram and statistical index Std are consistent and in strong agreement",
    "low Std where stable, high Std where unstable",
)(strong_agreement)


def _over_all(lab: Laboratory, part: int, rule: str) -> Finding:
    found = [shares(lab, pair)[part] for pair in PAIRS]
    told = ", ".join(f"(w, {pair.symbol}) {share:.1%}" for pair, share in zip(PAIRS, found, strict=True))
    return Finding(nearly_all(min(found), f"{rule} in each of the five maps"), told, f"{told}")


@conclusions.claim("the mountain-like area indicates unstable regions", "mountain = unstable")
def all_mountains(lab: Laboratory) -> Finding:
    """Gather the shares of unstable mountain cells."""
    return _over_all(lab, 0, f"the cells with Std >= {lab.level:g} m/s have motions that never repeat")


@conclusions.claim("the flat area indicates stable regions", "flat = stable")
def all_plains(lab: Laboratory) -> Finding:
    """Gather the shares of stable cells in the plain."""
    return _over_all(lab, 1, f"the cells with Std < {lab.level:g} m/s have motions that repeat")


@conclusions.claim(
    "the contour plots display the boundaries of the stable and unstable motions", "contours divide them"
)
def all_contours(lab: Laboratory) -> Finding:
    """Gather the shares of cells on the right side of the boundary."""
    return _over_all(lab, 2, f"the cells lie on the right side of the boundary at {lab.level:g} m/s")
