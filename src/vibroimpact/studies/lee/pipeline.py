"""The whole study, from its computations to its folder."""

from __future__ import annotations

import json
import os
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import xarray as xr

import vibroimpact as vi
from vibroimpact.files import replacing
from vibroimpact.parameters import invalid, real_number, whole_number
from vibroimpact.studies.lee import report
from vibroimpact.studies.lee.claims import Claim
from vibroimpact.studies.lee.laboratory import Laboratory
from vibroimpact.studies.lee.paper import LEVEL, OSCILLATOR, PAIRS, PAPER, QUICK, Job, Scale, Tick, draw, jobs, plates
from vibroimpact.studies.lee.section_3 import general, sticking
from vibroimpact.studies.lee.section_3_2 import between, conclusions, first_chaos, second_chaos, statistical
from vibroimpact.studies.lee.section_4 import amplitude, damping, mass, restitution, stiffness

SECTIONS = (
    general, sticking, first_chaos, between, second_chaos, statistical,
    mass, damping, stiffness, amplitude, restitution, conclusions,
)  # fmt: skip
CLAIMS: tuple[Claim, ...] = tuple(claim for section in SECTIONS for claim in section.claims)
RECORD, REPORT = "study.json", "report.html"  # the record also marks a folder as an earlier study
FIGURE_WEIGHT, CLAIM_WEIGHT = 5, 2  # of the progress shown, beside those of the jobs

Progress = bool | Callable[[int, int, str], Any]


def run(
    out: str | os.PathLike[str],
    *,
    quick: bool = False,
    level: float | None = None,
    overwrite: bool = False,
    workers: int | None = None,
    progress: Progress = False,
) -> Path:
    """Compute the source paper's figures and test its statements; write a folder with a report.

    Parameters
    ----------
    out : path
        The folder to create: `report.html`, `figures/` (PNG, SVG), `data/` (Zarr) and `study.json`.
    quick : bool
        Whether to use coarse grids (well under a minute) instead of the paper's.
    level : float, > 0
        Height in m/s of the boundaries of Std; None means 0.05, 5 % of f / sqrt(k m).
    overwrite : bool
        Whether an earlier study at `out` may be replaced; nothing else is ever replaced.
    workers : int, optional
        Threads of a sweep; None means one per core.
    progress : bool or callable
        True writes a line to the error stream as each step begins; a callable receives
        (work done, total work, text), and stops the study by returning False.

    Returns
    -------
    pathlib.Path
        The report.

    Raises
    ------
    ValueError
        `level` or `workers` is out of range.
    OSError
        `out` exists and may not be replaced, or cannot be written; existing files stay.
    KeyboardInterrupt
        The study was stopped; nothing was written under `out`.

    Notes
    -----
    The folder appears under its name once it is complete. Time on two cores: about half a minute with `quick`, a few
    minutes without.

    References
    ----------
    .. [1] J.-Y. Lee, sections 3 to 5, figures 1 to 20.

    Examples
    --------
    >>> run("study", level=-1.0)
    Traceback (most recent call last):
    ValueError: `level` must be a height above 0 m/s, got -1.0; leave it out for 0.05
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
        with replacing(target, overwrite=overwrite or target.exists()) as folder:
            for part in (folder, folder / "data", folder / "figures"):
                part.mkdir()
            _write_study(folder, stages, plan, scale, height, workers)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"stopped during {stages.text!r}; nothing was written under {str(out)!r}") from None
    return target / REPORT


def _height(level: float | None) -> float:
    allowed, hint = "a height above 0 m/s", f"leave it out for {LEVEL:g}"
    height = real_number("level", LEVEL if level is None else level, allowed, hint)
    if height <= 0.0:
        raise invalid("level", level, allowed, hint)
    return height


def _check_folder(out: str | os.PathLike[str], *, overwrite: bool) -> Path:
    """Return the path if the study can be put there; otherwise, raise before anything is computed."""
    target, shown = Path(out).absolute(), repr(str(out))
    if os.path.lexists(target) and not _is_empty_folder(target):
        if not (target / RECORD).is_file():
            raise FileExistsError(f"`out` {shown} exists and is not an earlier study; choose another name")
        if not overwrite:
            raise FileExistsError(f"`out` {shown} is an earlier study; allow overwriting or choose another name")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OSError(error.errno, f"`out` {shown}: its parent folder cannot be created ({error.strerror})") from error
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise PermissionError(f"`out` {shown}: its parent folder cannot be written to; choose another one")
    return target


def _is_empty_folder(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink() and not any(path.iterdir())


class Stages:
    """Reports progress for `run`, step by step out of the total of the steps' weights, and times each stage."""

    def __init__(self, progress: Progress, total: int) -> None:
        self.seconds: dict[str, float] = {}
        self.text = ""
        self._progress, self._total, self._done = progress, total, 0
        self._since = perf_counter()

    def begin(self, stage: str, text: str, weight: int) -> Tick:
        """Open a step of a stage; return the function that reports its completed part."""
        self._close()
        self._stage, self._weight, self.text = stage, weight, text
        if self._progress is True:
            print(f"[{self._done / self._total:4.0%}] {stage}: {text}", file=sys.stderr, flush=True)
        self._tick(0.0)
        return self._tick

    def finish(self) -> None:
        """Close the last step."""
        self._close()
        self._tick(0.0)

    def _tick(self, part: float) -> None:
        done = self._done + int(part * self._weight)
        if callable(self._progress) and self._progress(done, self._total, self.text) is False:
            raise KeyboardInterrupt

    def _close(self) -> None:
        now = perf_counter()
        if self.text:
            self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + now - self._since
            self._done += self._weight
        self._since = now


def _write_study(
    folder: Path, stages: Stages, plan: list[Job], scale: Scale, level: float, workers: int | None
) -> None:
    """Compute, draw, test and report into an unfinished folder."""
    results: dict[str, xr.Dataset] = {}
    for job in plan:
        tick = stages.begin("maps" if job.weight > 100 else "sections and diagrams", job.text, job.weight)
        results[job.key] = job.make(tick)
        vi.save(results[job.key], folder / "data" / f"{job.key}.zarr")
    drawn = list(plates(results, level))
    for plate in drawn:
        stages.begin("figures", f"figure {plate.number}", FIGURE_WEIGHT)
        draw(plate, folder / "figures", scale)
    lab = Laboratory(scale, results, level, workers)
    tested: list[report.Tested] = []
    for claim in CLAIMS:
        stages.begin("statements", f"statement {claim.id}", CLAIM_WEIGHT)
        tested.append((claim, claim.measure(lab)))
    stages.finish()
    facts = _facts(scale, level, results, stages)
    report.write(folder / REPORT, drawn, tested, facts, level)
    _write_record(folder / RECORD, tested, facts)


def _facts(scale: Scale, level: float, results: dict[str, xr.Dataset], stages: Stages) -> dict[str, str]:
    """Return the facts of a run: its computations, settings and versions, its date, and its duration."""
    osc = ", ".join(f"{name} {value:g}" for name, value in asdict(OSCILLATOR).items() if name != "omega")
    cells, each = len(PAIRS) * scale.map_points**2, scale.map_transient + scale.map_impacts
    ranges = "; ".join(f"{pair.symbol} {pair.low:g} to {pair.high:g}" for pair in PAIRS)
    facts = {
        "version": f"{results['figure-03'].attrs['source']}, Python {sys.version.split()[0]}, NumPy {np.__version__}",
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "oscillator": f"{osc} (unless varied); each motion begins at rest at the stop at time 0",
        "settings": ", ".join(f"{name} {value}" for name, value in asdict(scale).items()),
        "boundary level": f"{level:g} m/s",
        "axes of the maps": f"w above 0 to 5; {ranges} (the paper prints none beyond w)",
        "work": f"maps: {cells} cells of {scale.map_transient} + {scale.map_impacts} impacts, {cells * each:.3g} in "
        f"all; diagrams: {2 + 2 * len(PAIRS)} of {scale.columns} columns",
    }
    for pair in PAIRS:
        counts = Counter(int(code) for code in results[pair.key]["status"].values.ravel())
        outcomes = ", ".join(f"{count} {vi.Status(code).word}" for code, count in sorted(counts.items()))
        facts[f"cells of (w, {pair.symbol})"] = outcomes
    facts["duration"] = ", ".join(f"{stage} {seconds:.1f} s" for stage, seconds in stages.seconds.items())
    return facts


def _write_record(path: Path, tested: list[report.Tested], facts: dict[str, str]) -> None:
    claims = [
        {
            "id": claim.id,
            "section": claim.section,
            "quotation": claim.quotation,
            "says": claim.says,
            "exact": outcome.exact,
            "fixed_step": outcome.fixed_step,
            "verdict": outcome.assessment.verdict.value,
            "rule": outcome.assessment.rule,
            "because": outcome.because,
        }
        for claim, outcome in tested
    ]
    record = {"kind": "vibroimpact study", "facts": facts, "claims": claims}
    path.write_text(json.dumps(record, indent=1, ensure_ascii=False), encoding="utf-8")
