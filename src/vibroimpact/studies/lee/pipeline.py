"""The whole study, from nothing to its folder."""

from __future__ import annotations

import json
import os
import sys
from collections import Counter
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact import files
from vibroimpact.dataset import package_version
from vibroimpact.parameters import real_number, whole_number
from vibroimpact.status import Status
from vibroimpact.studies.lee import figures, report
from vibroimpact.studies.lee.claims import CLAIMS, Claim, Finding
from vibroimpact.studies.lee.laboratory import Laboratory
from vibroimpact.studies.lee.paper import LEVEL, OSCILLATOR, PAIRS
from vibroimpact.studies.lee.results import Job, jobs
from vibroimpact.studies.lee.scale import PAPER, QUICK, Scale
from vibroimpact.studies.lee.stages import Progress, Stages

RECORD, REPORT = "study.json", "report.html"  # the record is also what tells a former study from any other folder
FIGURE_WEIGHT, CLAIM_WEIGHT = 5, 2


def run(
    out: str | os.PathLike[str],
    *,
    quick: bool = False,
    level: float | None = None,
    overwrite: bool = False,
    workers: int | None = None,
    progress: Progress = False,
) -> Path:
    """Compute the source paper's figures and judge its statements; write a folder with a report.

    Parameters
    ----------
    out : path
        The folder to be made: `report.html`, `figures/` (PNG, SVG), `data/` (Zarr) and `study.json`.
    quick : bool
        Whether to use coarse grids (well under a minute) in place of the paper's.
    level : float, > 0
        Height in m/s at which boundaries of Std are drawn and judged; None is 0.05, 5 % of f / sqrt(k m).
    overwrite : bool
        Whether a former study at `out` may be replaced; nothing else ever is.
    workers : int, optional
        Threads of a sweep; None is one a core.
    progress : bool or callable
        True writes a line to the error stream as each step begins; a callable is given
        (work done, work in all, text), and stops the study by returning False.

    Returns
    -------
    pathlib.Path
        The report.

    Raises
    ------
    ValueError
        `level` or `workers` is out of its range.
    OSError
        `out` exists and must not be replaced, or cannot be written; what was there stays.
    KeyboardInterrupt
        The study was stopped; nothing new lies under `out`.

    Notes
    -----
    The folder appears under its name when it is complete. Cost on two cores: about half a minute quick, a few
    minutes in full.

    References
    ----------
    .. [1] J.-Y. Lee, sections 3 to 5, figures 1 to 20.

    Examples
    --------
    >>> run("study", level=-1.0)
    Traceback (most recent call last):
    ValueError: `level` is -1.0; allowed is a height above 0 m/s; leave it out for 0.05
    """
    height = _height(level)
    if workers is not None:
        whole_number("workers", workers, 1)
    target = _check_folder(out, overwrite=overwrite)
    scale = QUICK if quick else PAPER
    plan = list(jobs(scale, workers))
    total = sum(job.weight for job in plan) + 20 * FIGURE_WEIGHT + len(CLAIMS) * CLAIM_WEIGHT
    stages = Stages(progress, total)
    try:
        with files.replacing(target, overwrite=overwrite or target.exists()) as folder:
            for part in (folder, folder / "data", folder / "figures"):
                part.mkdir()
            _write_study(folder, stages, plan, scale, height, workers)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"stopped during {stages.text!r}; nothing new lies under {str(out)!r}") from None
    return target / REPORT


def _height(level: float | None) -> float:
    allowed, remedy = "a height above 0 m/s", f"leave it out for {LEVEL:g}"
    height = real_number("level", LEVEL if level is None else level, allowed, remedy)
    if height <= 0.0:
        raise ValueError(f"`level` is {level!r}; allowed is {allowed}; {remedy}")
    return height


def _check_folder(out: str | os.PathLike[str], *, overwrite: bool) -> Path:
    """Return the path if the study can be put there, else raise before anything is computed."""
    target, shown = Path(out).absolute(), repr(str(out))
    if os.path.lexists(target) and not _is_empty_folder(target):
        if not (target / RECORD).is_file():
            raise FileExistsError(f"`out` is {shown}, which exists and is no former study; choose another name")
        if not overwrite:
            raise FileExistsError(f"`out` is {shown}, a former study; allow overwriting or choose another name")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OSError(error.errno, f"`out` is {shown}; its parent folder cannot be made ({error.strerror})") from error
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise PermissionError(f"`out` is {shown}; its parent folder cannot be written to; choose another one")
    return target


def _is_empty_folder(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink() and not any(path.iterdir())


def _write_study(
    folder: Path, stages: Stages, plan: list[Job], scale: Scale, level: float, workers: int | None
) -> None:
    """Compute, draw, judge and report into an unfinished folder."""
    results: dict[str, xr.Dataset] = {}
    for job in plan:
        tick = stages.begin("maps" if job.weight > 100 else "sections and diagrams", job.text, job.weight)
        results[job.key] = job.make(tick)
        files.save(results[job.key], folder / "data" / f"{job.key}.zarr")
    plates = list(figures.plates(results, level))
    for plate in plates:
        stages.begin("figures", f"figure {plate.number}", FIGURE_WEIGHT)
        figures.draw(plate, folder / "figures", scale)
    lab = Laboratory(scale, results, level, workers)
    judged: list[tuple[Claim, Finding]] = []
    for claim in CLAIMS:
        stages.begin("statements", f"statement {claim.id}", CLAIM_WEIGHT)
        judged.append((claim, claim.measure(lab)))
    stages.finish()
    facts = _facts(scale, level, results, stages)
    report.write(folder / REPORT, plates, judged, facts, level)
    _write_record(folder / RECORD, judged, facts)


def _facts(scale: Scale, level: float, results: dict[str, xr.Dataset], stages: Stages) -> dict[str, str]:
    """Return what was computed, with what, when, and how long it took."""
    osc = ", ".join(f"{name} {value:g}" for name, value in asdict(OSCILLATOR).items() if name != "omega")
    settings = ", ".join(f"{name} {value}" for name, value in asdict(scale).items())
    facts = {
        "version": f"vibroimpact {package_version()}, Python {sys.version.split()[0]}, NumPy {np.__version__}",
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "oscillator": osc + " (unless varied); each motion starts from rest at the stop at time 0",
        "settings": settings,
        "boundary level": f"{level:g} m/s",
        "axes of the maps": "w above 0 to 5; "
        + "; ".join(f"{pair.symbol} {pair.low:g} to {pair.high:g}" for pair in PAIRS)
        + " (the paper prints none beyond w)",
    }
    cells = len(PAIRS) * scale.map_points**2
    each = scale.map_transient + scale.map_impacts
    facts["work"] = (
        f"maps: {cells} cells of {scale.map_transient} + {scale.map_impacts} impacts, {cells * each:.3g} in all; "
        f"diagrams: {2 + 2 * len(PAIRS)} of {scale.columns} columns"
    )
    for pair in PAIRS:
        facts[f"cells of (w, {pair.symbol})"] = _outcomes(results[pair.key])
    facts["duration"] = ", ".join(f"{stage} {seconds:.1f} s" for stage, seconds in stages.seconds.items())
    return facts


def _outcomes(sweep: xr.Dataset) -> str:
    counts = Counter(int(code) for code in sweep["status"].values.ravel())
    return ", ".join(f"{count} {Status(code).word}" for code, count in sorted(counts.items()))


def _write_record(path: Path, judged: list[tuple[Claim, Finding]], facts: dict[str, str]) -> None:
    claims: list[dict[str, Any]] = [
        {
            "id": claim.id,
            "section": claim.section,
            "quotation": claim.quotation,
            "says": claim.says,
            "exact": finding.exact,
            "fixed_step": finding.fixed_step,
            "verdict": finding.judgement.verdict.value,
            "rule": finding.judgement.rule,
            "because": finding.because,
        }
        for claim, finding in judged
    ]
    record = {"kind": "vibroimpact study", "facts": facts, "claims": claims}
    path.write_text(json.dumps(record, indent=1, ensure_ascii=False), encoding="utf-8")
