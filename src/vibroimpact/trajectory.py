"""One orbit, followed in time."""

from __future__ import annotations

import numpy as np
import xarray as xr

from vibroimpact.backends import StroboscopicWindow, get_backend
from vibroimpact.backends.starts import check_start, make_cells
from vibroimpact.dataset import provenance, seconds, status_variable, stick_times, variable
from vibroimpact.options import Tolerances, whole_number
from vibroimpact.oscillator import ImpactOscillator, State, real_number


def simulate(
    osc: ImpactOscillator,
    *,
    start: State | None = None,
    periods: float = 20,
    samples_per_period: int = 200,
    backend: str = "cpu",
    time_step: float | None = None,
    tolerances: Tolerances | None = None,
) -> xr.Dataset:
    r"""Follow the mass from its start for some driving periods.

    .. math:: m \ddot y + c \dot y + k y = f \sin \omega t \quad (y < g), \qquad
              \dot y \to -r \dot y \quad (y = g,\ \dot y > 0)

    Parameters
    ----------
    osc : ImpactOscillator
        The seven numbers.
    start : State, optional
        Where, how fast and when; None is at rest at min(0, gap), time 0.
    periods : float, > 0
        How long, in driving periods T = 2 pi / omega.
    samples_per_period : int, >= 1
        Displacements and velocities given a period; impacts are found exactly, whatever this is.
    backend : {"cpu", "cuda", "reference", "fixed-step"}
        Who computes; `time_step` in s is for "fixed-step" alone.
    tolerances : Tolerances, optional
        How small is small.

    Returns
    -------
    xarray.Dataset
        `displacement` in m and `velocity` in m/s over `time` in s; `impact_time`, `impact_velocity` (dim
        `impact`, the speed just before contact); `stick_time`, `release_time` (dim `stick`, NaN where the mass had
        not left yet); `status`. At an impact instant the velocity given is the one after it.

    Raises
    ------
    ValueError
        An argument is out of its range, or the start lies beyond the stop.

    Notes
    -----
    Flights are exact power series, contacts are certified and found to rounding; errors grow along the orbit as the
    motion itself lets them. About 0.7 microseconds an impact, plus a third of one a sample.

    References
    ----------
    .. [1] J.-Y. Lee, "Numerical Analysis of Impact Vibration Based on a Bifurcation Diagram With Two Varying
       Control Parameters", eq. (1); its `k y'` is a misprint for `k y`.

    Examples
    --------
    >>> orbit = simulate(ImpactOscillator(omega=2.0), periods=3)
    >>> orbit.sizes["time"]
    601
    >>> bool((orbit.displacement <= 0).all())
    True
    """
    check_start(start)
    length = real_number("periods", periods, "a number > 0")
    if not length > 0.0:
        raise ValueError(f"`periods` is {periods!r}; allowed is a number > 0; say how many driving periods to follow")
    density = whole_number("samples_per_period", samples_per_period, 1)
    window = StroboscopicWindow(0, int(np.floor(length * density + 1e-9)) + 1, None, density)
    engine = get_backend(backend, time_step=time_step)
    (seen,) = engine.samples(make_cells(osc, start), window, tolerances or Tolerances())
    return xr.Dataset(
        {
            "displacement": variable("displacement", "time", seen.look_displacement),
            "velocity": variable("velocity", "time", seen.look_velocity),
            "impact_time": variable("impact_time", "impact", seconds(osc, seen.impact_periods, seen.impact_phase)),
            "impact_velocity": variable("impact_velocity", "impact", seen.impact_velocity),
            **stick_times(osc, seen),
            "status": status_variable((), seen.status),
        },
        coords={"time": variable("time", "time", seconds(osc, seen.look_periods, seen.look_phase))},
        attrs=provenance(
            "simulate",
            osc,
            {
                "start": start,
                "periods": length,
                "samples_per_period": density,
                "backend": backend,
                "time_step": time_step,
            },
        ),
    )
