"""Boundaries of motions in a plane of two parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from vibroimpact.cli import output
from vibroimpact.cli.compute import hand_on, keep_finished
from vibroimpact.cli.finding import branches_of, check_inside, choice, given, near_of, ranges_of, tell_nothing
from vibroimpact.cli.progress import Meter
from vibroimpact.cli.request import WrongRequest, asked, numbers, read_request
from vibroimpact.continuation.results import KINDS

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.continuation import BifurcationPoint, Boundary
    from vibroimpact.oscillator import ImpactOscillator


def boundary(options: Mapping[str, Any]) -> None:
    """Follow boundaries through a plane of two parameters."""
    study = read_request(options, axes="span")
    box = ranges_of(study, 2)
    names, osc, kinds = tuple(box), study.make_oscillator(), _kinds(options.get("kinds"))
    from vibroimpact.indices import INDICES

    output.check(options, "boundary_curves", (*INDICES, output.MOTION))
    over = _map_beneath(options, names)
    compute = _of_orbits if options.get("near") or choice(options, "n_impacts", 1) != 1 else _all
    with Meter("boundaries") as meter, asked():
        curves = compute(osc, box, kinds, options, meter)
    if not curves and not meter.stopped:
        tell_nothing(f"no such boundary was met in the plane of {' and '.join(names)}", options)
    dataset = _joined(curves, osc, box) if curves else None
    if meter.stopped or dataset is None:
        keep_finished(dataset, options, meter.seconds, over=over)
    hand_on(dataset, options, meter.seconds, over=over)


def _joined(curves: list[Boundary], osc: ImpactOscillator, box: Mapping[str, Any]) -> xr.Dataset:
    """Return all curves as one dataset; of a chatter's impacts, scores of them, only the first."""
    from vibroimpact.bundles import bundle
    from vibroimpact.dataset import provenance

    parts = [curve.dataset for curve in curves]
    parts = [part.isel(impact=slice(0, 1)) if part.attrs["n_impacts"] == -1 else part for part in parts]
    arguments = {"parameters": tuple(box), "ranges": tuple(box.values())}
    return bundle(parts, "boundary_curves", provenance("boundary_curves", osc, arguments))


def _all(
    osc: ImpactOscillator, box: Mapping[str, Any], kinds: tuple[str, ...], options: Mapping[str, Any], meter: Meter
) -> list[Boundary]:
    """Return the curves of orbits with one impact and of sticking."""
    import vibroimpact

    more = given(options, "lines", "step") | {"n_periods": _periods(options, "1,2")}
    plane: Any = tuple(box), tuple(box.values())
    return vibroimpact.boundary_curves(osc, *plane, kinds=kinds, progress=meter, **more)


def _of_orbits(
    osc: ImpactOscillator, box: Mapping[str, Any], kinds: tuple[str, ...], options: Mapping[str, Any], meter: Meter
) -> list[Boundary]:
    """Return the boundaries that the orbits at the oscillator itself meet along the first parameter."""
    import vibroimpact
    from vibroimpact.continuation import curves_through

    check_inside(osc, box)
    step, (names, ranges) = given(options, "step"), (tuple(box), tuple(box.values()))
    points: list[BifurcationPoint] = []
    for n in _periods(options, "1"):
        wanted: dict[str, Any] = {"n_periods": n, "n_impacts": choice(options, "n_impacts", 1)}
        found = vibroimpact.find_orbit(osc, **wanted, near=near_of(options))
        for branch in branches_of(found, names[0], ranges[0], 0, meter, **step):
            points += [point for point in branch.special if point.kind in kinds]
    plane: Any = names, ranges
    return curves_through(points, *plane, progress=meter, **step)


def _periods(options: Mapping[str, Any], usual: str) -> Any:
    return numbers("--periods", options.get("periods_list") or usual, 0, "whole numbers such as 1,2")


def _kinds(text: str | None) -> tuple[str, ...]:
    if text is None:
        return KINDS
    chosen = tuple(part.strip().replace("-", "_").replace(" ", "_") for part in text.split(","))
    for kind in chosen:
        if kind not in KINDS:
            allowed = ", ".join(KINDS).replace("_", "-")
            raise WrongRequest(f"`--kind` is {text!r}; allowed are {allowed}; choose one or several")
    return chosen


def _map_beneath(options: Mapping[str, Any], names: tuple[str, ...]) -> xr.Dataset | None:
    """Return the saved map that the curves are drawn over."""
    over = output.read(options, "over")
    if over is None:
        return None
    if set(map(str, over.dims)) != set(names):
        dims = " and ".join(map(str, over.dims)) or "no axis"
        raise WrongRequest(
            f"`--over` is a result over {dims}; allowed is a map over {' and '.join(names)}, as the curves are; "
            "compute it with `vibroimpact map`"
        )
    index = options.get("index")
    needed = output.NEEDS["motion-map"] if index == output.MOTION else (index,) if index else ()
    if lacking := [name for name in needed if name not in over]:
        raise WrongRequest(f"`--over` is a map without {', '.join(lacking)}; allowed is one with it; compute it again")
    return over
