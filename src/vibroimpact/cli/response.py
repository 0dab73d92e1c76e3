"""The command that follows how far a system swings along a parameter."""

from __future__ import annotations

from vibroimpact.cli import output
from vibroimpact.cli import schema as o
from vibroimpact.cli.endings import WrongRequest, refusing
from vibroimpact.cli.options import Options, with_options
from vibroimpact.cli.orbits import nothing, one_range
from vibroimpact.cli.study import study_of
from vibroimpact.progress import Meter


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
    parameter, span = one_range(study)
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
                nothing(str(error), options)
        except WrongRequest:
            if not meter.stopped:
                raise
    output.finish(dataset, options, meter, units=study.units)
