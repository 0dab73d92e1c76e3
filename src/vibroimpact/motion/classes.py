"""The class of a motion, decided from the indices of a sweep."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.dataset import arguments_of, dataset_of, flags, model_of, variable
from vibroimpact.motion import NAMING, MotionClass, decide, may_wind, stored
from vibroimpact.parameters import invalid

if TYPE_CHECKING:
    import xarray as xr

NEEDED = (*NAMING, "status")


def classify(sweep: xr.Dataset) -> xr.Dataset:
    r"""Return the class of motion of every cell of a sweep: periodic, sticking, chaotic, quasi-periodic, or none.

    The first rule that applies decides:

    1. *no impact*: the status is `no_impact`, `stopped_impacting`, `stuck_forever` or `decaying`;
    2. *undecided*: the status is `budget`, `interrupted` or `invalid_restitution`;
    3. *sticking*: the mass comes to rest at the stop again and again, which erases all memory: a cycle with
       :math:`\lambda = -\infty`, or complete chatter (`n_impacts` = -1). With `n_periods` = 0 it is intermittent:
       perturbations grow by more than 1e13 between two rests, and double precision does not resolve when the next one
       comes;
    4. *periodic*: a cycle of another kind was found. With several coordinates this includes cycles that rest at a stop
       with r = 0, without a chatter, while another coordinate remembers: they have a number of impacts;
    5. *chaotic*: no cycle, and over the N sampled impacts perturbations grow so much that the last binary digit of the
       initial condition reaches the size of the motion,

       .. math:: N \lambda_\mathrm{impact} > 53 \ln 2 \approx 36.7,

       in a window of at least 10 driving periods;
    6. *quasi-periodic*, for systems of two coordinates or more, not counting a free centre: no cycle, and over
       N >= 1000 sampled impacts perturbations keep their size, or grow no faster than in proportion to N,

       .. math:: -1 \le N \lambda_\mathrm{impact} \le \ln N;

    7. *undecided*: all other motions: one that settles or diverges too slowly, one that came to rest only once, or a
       `short_window`.

    Parameters
    ----------
    sweep : xarray.Dataset
        The result of `parameter_map` over any number of axes, with the indices `lyapunov_per_impact` (or, for an
        oscillator, `lyapunov` and `impacts_per_period`), `n_periods` and `n_impacts`.

    Returns
    -------
    xarray.Dataset
        `motion` (flags undecided, no_impact, periodic, sticking, chaotic and, for systems of several coordinates,
        quasi_periodic), `n_periods` and `n_impacts` of its cycle (0 if none was found; n_impacts = -1 for complete
        chatter), and the `status` used for the decision.

    Raises
    ------
    ValueError
        `sweep` lacks one of the indices (the message lists them), or the number of sampled impacts.

    Notes
    -----
    "Periodic" is certain, since a cycle is named only if it is stable and reached. "Chaotic" refers to the window: long
    transient chaos cannot be distinguished from chaos in it. Of the cells of the paper's (w, m) map, about 0.5 % remain
    undecided after 5000 impacts, nearly all of them still converging to a cycle. A mass that rests only once within the
    sample is on a long cycle or chaotic: skip more impacts. The cost is negligible compared with the sweep.

    "Quasi-periodic" refers to the window, too. The name also covers cycles whose perturbations shrink by less than e
    over the N impacts, and motions whose perturbations grow with an exponent below ln N / N. Near Neimark-Sacker points
    of 80 systems, with 2000 of 7000 impacts skipped, and compared with exponents over 200 000 impacts: 269 of 277
    quasi-periodic motions had that name, 7 none, and one was named chaotic; 38 of 331 motions that settle also had it.

    Examples
    --------
    >>> import vibroimpact as vi
    >>> sweep = vi.parameter_map(vi.ImpactOscillator(), omega=[0.1, 2.0, 2.8], sample_impacts=500,
    ...                          indices=("lyapunov_per_impact", "n_periods", "n_impacts"))
    >>> [MotionClass(code).word for code in classify(sweep)["motion"].values]
    ['sticking', 'periodic', 'chaotic']
    """
    _check(sweep)
    status = sweep["status"]
    dims = tuple(map(str, status.dims))
    growth = _growth(sweep).transpose(*dims).values
    n_periods, n_impacts = (sweep[name].transpose(*dims).values for name in ("n_periods", "n_impacts"))
    winds = may_wind(model_of(sweep))
    impacts = (_sampled_impacts(sweep) + 0 * status).transpose(*dims).values if winds else 0
    motion = stored(decide(status.values, growth, n_periods, n_impacts, impacts))
    n_impacts = np.where((n_periods > 0) | (motion == MotionClass.STICKING), n_impacts, 0)
    content = {
        "motion": motion_variable(dims, motion, winds=winds),
        "n_periods": variable("n_periods", dims, n_periods.astype(np.int32)),
        "n_impacts": variable("n_impacts", dims, n_impacts.astype(np.int32)),
        "status": status.variable,
    }
    return dataset_of(content, coords=status.coords, attrs=sweep.attrs | {"function": "classify"})


def motion_variable(dims: Any, codes: NDArray[Any], *, winds: bool = False) -> xr.Variable:
    """Return classes of motion with their CF flag values and meanings; quasi-periodic is included if motion `winds`."""
    kinds = [kind for kind in MotionClass if kind == kind.stored and (winds or kind != MotionClass.QUASI_PERIODIC)]
    return flags(dims, codes, "class of motion", [kind.word for kind in kinds])


def _growth(sweep: xr.Dataset) -> Any:
    """Return ln of the factor by which perturbations grow over the sampled impacts."""
    if "lyapunov_per_impact" in sweep:
        return sweep["lyapunov_per_impact"] * _sampled_impacts(sweep)
    return sweep["lyapunov"] * _period(sweep) / sweep["impacts_per_period"] * _sampled_impacts(sweep)


def _sampled_impacts(sweep: xr.Dataset) -> Any:
    arguments = arguments_of(sweep)
    if "sample_impacts" in arguments:
        return float(arguments["sample_impacts"])
    if "count" in sweep and "impact" in sweep.dims:
        return sweep["count"]
    raise ValueError(
        "`sweep` must hold the number of sampled impacts in its attributes; "
        "keep attributes in computations: xarray.set_options(keep_attrs=True)"
    )


def _period(sweep: xr.Dataset) -> Any:
    """Return the driving period in s, for every cell if an axis varies it."""
    if "frequency" in sweep.coords:
        return 1.0 / sweep["frequency"]
    return 2.0 * math.pi / sweep["omega"] if "omega" in sweep.coords else model_of(sweep).period


def _check(sweep: Any) -> None:
    import xarray as xr

    if not isinstance(sweep, xr.Dataset):
        raise invalid("sweep", sweep, "a Dataset", "give the result of `parameter_map`")
    names = set(map(str, sweep.data_vars))
    if {"lyapunov", "impacts_per_period"} <= names and "model" not in sweep.attrs:  # a family has its own periods
        names.add("lyapunov_per_impact")
    missing = [name for name in NEEDED if name not in names]
    if missing:
        indices = ", ".join(map(repr, NAMING))
        raise ValueError(
            f"`sweep` must hold exponents and cycles, but lacks {', '.join(missing)}; "
            f"run parameter_map with indices=({indices})"
        )
