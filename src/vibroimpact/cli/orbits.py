"""The commands that find periodic orbits, and that follow orbits, responses and boundaries."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from vibroimpact.cli import output
from vibroimpact.cli import schema as o
from vibroimpact.cli.endings import Ended, WrongRequest, refusing
from vibroimpact.cli.options import Options, numbers, with_options
from vibroimpact.cli.study import Study, study_of
from vibroimpact.compiling import before_compiling, clock
from vibroimpact.model.units import quantity
from vibroimpact.parameters import choice
from vibroimpact.progress import Meter, duration
from vibroimpact.showing import plain

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.continuation import Boundaries, Branch
    from vibroimpact.model import Model
    from vibroimpact.orbits import Orbit, Orbits

Range = tuple[float, float]

DIAGRAM_VALUES = 400  # of the diagram beneath a branch
DIAGRAM = {"transient_impacts": 500, "sample_impacts": 100}  # of each value, unless the study gives them


# Orbits


@with_options(o.MODEL, o.ORBIT, o.STRUCK, o.ORBIT_OUT)
def orbit(options: Options) -> None:
    """Periodic orbits of one (n, p) type, stable or not: impacts, Floquet multipliers.

    For example:

      vibroimpact orbit -p omega=2.0
      vibroimpact orbit -p omega=0.9 --impacts 2 --out orbit.json
      vibroimpact orbit -p omega=0.1 --impacts -1
      vibroimpact orbit --model impact_damper --stops left --symmetric
      vibroimpact orbit --model idle_gear --stops left,right --near 0.005,0.015
    """
    study = study_of(options)
    output.check_looks(options, (".json",))
    began = clock()
    with before_compiling(study.announce):
        orbits = _find(study, options)
    out = options["out"]
    if out is not None and out.suffix.lower() == ".json":
        output.write_json(orbits_json(orbits, study.model), options, out)
        typer.echo(f"wrote {out} ({duration(clock() - began)})")
        return
    arguments = {name: options[name] for name in ("stops", "symmetric", "near") if options[name]}
    arguments = (
        {"n_periods": options.value("n_periods"), **arguments} if "stops" in arguments else _type(options) | arguments
    )
    from vibroimpact.orbits.results import orbits_dataset

    output.hand_on(orbits_dataset(orbits, study.model, arguments), options, clock() - began)


def _type(options: Options) -> dict[str, Any]:
    return {name: options.value(name) for name in ("n_periods", "n_impacts")}


def _find(study: Study, options: Options, **orbit_type: Any) -> Orbits:
    """Return the orbits that strike the given stops in turn, or have the given type, or that of the options."""
    import vibroimpact

    names, symmetric, near = (options.get(name) for name in ("stops", "symmetric", "near"))
    kind = orbit_type or _type(options)
    with refusing():
        impact_is_state = study.model.at().forgets
        if not (names or symmetric):
            if near and not impact_is_state:
                raise WrongRequest("`--near` for a system needs `--stops`, and a time in s for each of them")
            start: Any = near and numbers("--near", near, "PHASE,VELOCITY such as 0.25,1.4", 2)
            return vibroimpact.find_orbit(study.model, **kind, near=start)
        if impact_is_state:
            flag = "--stops" if names else "--symmetric"
            raise WrongRequest(
                f"`{flag}` applies only to systems, and {study.model!s} is one mass with one stop; leave it out"
            )
        if options["n_impacts"] is not None:
            raise WrongRequest("give either `--impacts` or the stops that are struck, not both")
        times: Any = near and numbers("--near", near, "times in s such as 0.1,0.3")
        only = {"stops": options.value("stops"), "symmetric": bool(symmetric)}
        return vibroimpact.find_orbit(study.model, n_periods=kind["n_periods"], **only, near=times)


def orbits_json(orbits: Orbits, model: Model) -> dict[str, Any]:
    """Return orbits as plain dictionaries, lists, numbers and text: NaN as None, multipliers as pairs."""
    design = model.at()
    return {
        design.kind: design.plain(),
        "outcome": orbits.outcome,
        "message": orbits.sentence,
        "orbits": [_described(orbit) for orbit in orbits],
    }


SUMMED = "name", "stable", "impulses", "trace", "determinant"


def _described(orbit: Orbit) -> dict[str, Any]:
    names = (part.name for part in fields(orbit) if part.name not in ("oscillator", "family"))
    content = {name: getattr(orbit, name) for name in (*names, *SUMMED)}
    content |= {key: [each._asdict() for each in content[key]] for key in ("contacts", "rests")}
    return {key: plain(value) for key, value in content.items()}


# Branches


@with_options(o.MODEL, o.RANGE, o.ORBIT, o.STRUCK, o.DOUBLINGS, o.STEP, o.WORKERS, o.OUT, o.DIAGRAM, o.PICTURE)
def follow(options: Options) -> None:
    """Follow the orbits of one (n, p) type along a parameter, through folds; report where they change.

    The orbits are searched for at -p; the range must contain that value.
    Ctrl-C keeps what is finished.

    For example:

      vibroimpact continue -p omega=2.0 --x omega=0.8:3
      vibroimpact continue -p w=2.6 --x w=2:3 --doublings 2 -o branch.zarr
      vibroimpact continue -p w=2.6 --x w=2:3:400 --diagram --out branch.png
      vibroimpact continue -p w=0.9 --impacts 2 --x gap=-0.5:0.5
      vibroimpact continue --model impact_damper --stops left --symmetric --x frequency=25:35
    """
    study = study_of(options)
    ((parameter, span),) = _ranges(study, 1).items()
    output.check(options, "continue_orbit")
    if options["diagram"] and not output.is_figure(options["out"]):
        raise WrongRequest("`--diagram` needs a figure; add for example --out branch.png")
    from vibroimpact.dataset import bundle, provenance

    with Meter("orbits", opening=study.announce) as meter, refusing():
        doublings = options.value("doublings")
        orbits = _find(study, options)
        branches = _branches(orbits, parameter, span, meter, options.value("step"), doublings)
    if not branches:
        _nothing(orbits.message, options)
    beneath = _diagram(study, parameter, span) if options["diagram"] and not meter.stopped else None
    arguments = {"parameter": parameter, "range": span, **_type(options), "doublings": doublings}
    attrs = provenance("continue_orbit", study.model, arguments)
    dataset = bundle([branch.dataset for branch in branches], "continue_orbit", attrs)
    output.finish(dataset, options, meter, beneath, study.units)


def _branches(
    orbits: Orbits, parameter: str, span: Range, meter: Meter, step: float, doublings: int = 0
) -> list[Branch]:
    """Return the branches of the orbits found, then of those that are born at their period doublings."""
    from vibroimpact.continuation import continue_orbit, follow_all

    if orbits and orbits[0].sticks:
        return [continue_orbit(orbits[0], parameter, span, step=step, progress=meter)]
    return follow_all(
        [orbit for orbit in orbits if orbit.admissible] or orbits,
        parameter,
        span,
        longest=math.inf,
        most=math.inf,
        doublings=doublings,
        step=step,
        virtual=True,
        amplitude=1e-3,
        progress=meter,
    )


def _diagram(study: Study, parameter: str, span: Range) -> xr.Dataset:
    """Return the settled motions over the same range."""
    import numpy as np

    import vibroimpact

    values = study.axes[parameter]
    axis: dict[str, Any] = {parameter: values if len(values) > 2 else np.linspace(*span, DIAGRAM_VALUES)}
    chosen = DIAGRAM | study.arguments("bifurcation_diagram") | {"section": "impact", "indices": ()}
    with Meter("diagram") as meter, refusing():
        return vibroimpact.bifurcation_diagram(study.model, progress=meter, **chosen, **axis)


def _ranges(study: Study, count: int, *, contain: bool = True) -> dict[str, Range]:
    """Return the parameters to vary and their ranges, which contain the model whose orbits are followed."""
    from vibroimpact.orbits.orbit import value_of

    if len(study.axes) != count:
        wanted, example = {1: ("one axis", ""), 2: ("two axes", " --y mass=0.1:5")}[count]
        raise WrongRequest(
            f"this command needs exactly {wanted}, got {' and '.join(study.axes) or 'none'}; for example --x "
            f"omega=0.8:3{example}"
        )
    for name, values in study.axes.items():
        if len(values) < 2:
            raise WrongRequest(f"`{name}` must be a range, got one value; write {name}=FROM:TO")
        low, high, value = float(values[0]), float(values[-1]), value_of(study.model, name)
        if contain and not low <= value <= high:
            at, first, last = (quantity(study.model, name, each, 6, study.units) for each in (value, low, high))
            raise WrongRequest(
                f"`{name}` must have a range that contains {at}, where the orbit is searched for, got {first} to "
                f"{last}; widen it, or search elsewhere with -p {name}=..."
            )
    return {name: (float(values[0]), float(values[-1])) for name, values in study.axes.items()}


def _nothing(message: str, options: Options) -> NoReturn:
    """End a command that found nothing: a failure only if a file was to be written."""
    if options["out"] is not None:
        raise Ended(f"{message}; nothing was written")
    typer.echo(message)
    raise typer.Exit


# Responses


@with_options(o.MODEL, o.RANGE, o.OF, o.STEP, o.OUT, o.PICTURE)
def response(options: Options) -> None:
    """Response curve along a parameter: amplitudes without and with contact, folds, where contact begins.

    Period-1 motions with one impact, or with one in each half of the period,
    stable and unstable. Ctrl-C keeps what is finished.

    For example:

      vibroimpact response --model bilinear_oscillator --x frequency=2:9
      vibroimpact response --x omega=0.3:3 -p gap=1.5 -p damping=0.1 --out curve.png
      vibroimpact response --model tube_in_supports --of 0 --x frequency=20:60 --out curve.nc
    """
    import vibroimpact
    from vibroimpact.continuation.response import NoCurve

    study = study_of(options)
    ((parameter, span),) = _ranges(study, 1, contain=False).items()
    output.check(options, "response_curve")
    dataset, of = None, study.settings.get("of")
    with Meter("orbits", opening=study.announce) as meter:
        try:
            with refusing():
                curve = vibroimpact.response_curve(
                    study.model, of=of, step=options.value("step"), progress=meter, **{parameter: span}
                )
            dataset = curve.dataset
        except NoCurve as error:
            if not meter.stopped:
                _nothing(str(error), options)
        except WrongRequest:
            if not meter.stopped:
                raise
    output.finish(dataset, options, meter, units=study.units)


# Boundaries


@with_options(
    o.MODEL, o.RANGE_X, o.RANGE_Y, o.KINDS, o.PERIODS_LIST, o.ORBIT_IMPACTS, o.NEAR, o.LINES, o.STEP, o.OUT, o.OVER,
    o.INDEX, o.PICTURE,
)  # fmt: skip
def boundary(options: Options) -> None:
    """Exact curves in a plane of two parameters on which motions fold, double, graze or cease to stick.

    Motions from rest that cover more than 1 % of a coarse map are followed to their ends,
    and so are orbits with one impact that cross a grid of lines.
    With --periods: only period-n impact-1 orbits and period-n sticking, on these lines.
    With --impacts: the bifurcations of the orbit at -p along --x.
    Ctrl-C keeps what is finished.

    For example:

      vibroimpact boundary --x omega=0.025:5 --y mass=0.1:5 --out curves.zarr
      vibroimpact boundary --x w=2:3 --y r=0.5:0.9 --kind fold,grazing
      vibroimpact boundary --x w=1:5 --y m=0.1:5 --over map.zarr -o plane.png
      vibroimpact boundary -p w=0.9 --impacts 2 --x w=0.6:1.1 --y r=0.5:0.9
    """
    study = study_of(options)
    of_orbits = options["near"] is not None or options.value("n_impacts") != 1
    box = _ranges(study, 2, contain=of_orbits)
    names, kinds = tuple(box), _kinds(options, study)
    from vibroimpact.figures import MOTION
    from vibroimpact.indices import INDICES

    output.check(options, "boundary_curves", (*INDICES, MOTION))
    over = output.map_beneath(options, names)
    with Meter("boundaries", opening=study.announce) as meter, refusing():
        curves = (_of_orbits if of_orbits else _all)(study, box, kinds, options, meter)
    if not curves and not meter.stopped:
        _nothing(f"no such boundary found in the plane of {' and '.join(names)}: {curves.message}", options)
    output.finish(_bundled(curves, study, box) if curves else None, options, meter, over, study.units)


def _bundled(curves: Boundaries, study: Study, box: Mapping[str, Range]) -> xr.Dataset:
    """Return all curves as one dataset, with only the first impact of a chatter."""
    from vibroimpact.dataset import bundle, provenance

    parts = [curve.dataset for curve in curves]
    parts = [part.isel(impact=slice(0, 1)) if part.attrs["n_impacts"] == -1 else part for part in parts]
    arguments = {"parameters": tuple(box), "ranges": tuple(box.values())}
    attrs = provenance("boundary_curves", study.model, arguments) | {"message": curves.message}
    return bundle(parts, "boundary_curves", attrs)


def _all(study: Study, box: Mapping[str, Range], kinds: tuple[str, ...], options: Options, meter: Meter) -> Boundaries:
    """Return the curves of motions on a coarse map or, with --periods, of orbits with one impact and of sticking."""
    import vibroimpact

    more = options.given("lines", "step")
    if options["periods_list"]:
        more["n_periods"] = options.value("periods_list")
    plane: Any = tuple(box), tuple(box.values())
    return vibroimpact.boundary_curves(study.model, *plane, kinds=kinds, progress=meter, **more)


def _of_orbits(
    study: Study, box: Mapping[str, Range], kinds: tuple[str, ...], options: Options, meter: Meter
) -> Boundaries:
    """Return the boundaries that the orbits at the model's own values meet along the first parameter."""
    from vibroimpact.continuation import curves_through
    from vibroimpact.motion import listed

    step, names = options.value("step"), tuple(box)
    branches: list[Branch] = []
    for n in options.value("periods_list") or (1,):
        orbits = _find(study, options, n_periods=n, n_impacts=options.value("n_impacts"))
        branches += _branches(orbits, names[0], box[names[0]], meter, step)
    points = [point for branch in branches for point in branch.special if point.kind in kinds]
    plane: Any = names, tuple(box.values())
    curves = curves_through(points, *plane, progress=meter, step=step)
    followed = listed(sorted({branch.orbits[0].name for branch in branches})) or "no orbit"
    curves.message = f"followed {followed} from the oscillator at -p along {names[0]} only; other motions end elsewhere"
    return curves


def _kinds(options: Options, study: Study) -> tuple[str, ...]:
    """Return the kinds of boundaries: those typed, or all that the model may have."""
    from vibroimpact.continuation.results import kinds_of

    with refusing():
        possible = kinds_of(study.model)
        names = {kind.replace("_", "-"): kind for kind in possible}
        typed = [re.sub("[ _]", "-", kind) for kind in options.value("kinds") or names]
        return tuple(names[choice("--kind", kind, names)] for kind in typed)
