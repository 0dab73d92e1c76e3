"""Attractors as labelled datasets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from vibroimpact.coexistence.attractor import Attractor
from vibroimpact.dataset import dataset_of, flags, impact_speed, plain_variable, provenance, status_variable, variable
from vibroimpact.motion import MotionClass
from vibroimpact.orbits.results import rows_of

if TYPE_CHECKING:
    import xarray as xr

DIM = "attractor_id"
STATISTICS = ("std", "mean_velocity", "max_velocity", "lyapunov", "n_periods", "n_impacts", "dissipation")


def attractor_variables(attractors: Sequence[Attractor]) -> dict[str, xr.Variable]:
    """Return the properties of each attractor."""
    share = {"long_name": "share of the initial conditions", "units": "1", "symbol": "share"}
    return {
        DIM: plain_variable(DIM, np.arange(len(attractors), dtype=np.int16), {"long_name": "attractor"}),
        "share": plain_variable(DIM, np.array([each.share for each in attractors], float), share),
        **{
            name: variable(
                name,
                DIM,
                np.array([getattr(each, name) for each in attractors], np.int32 if name[:2] == "n_" else np.float64),
            )
            for name in STATISTICS
        },
    }


def attractors_dataset(attractors: Sequence[Attractor]) -> xr.Dataset:
    """Return the result of `attractors` as a dataset over `attractor_id` and `impact`, rows padded with NaN."""
    model, dims = attractors[0].model, (DIM, "impact")
    if model is None:
        raise ValueError("an attractor without a `model` cannot be saved; give one that `attractors` returned")
    longest = max(len(each.velocities) for each in attractors)
    kinds = [MotionClass[each.kind.upper()] for each in attractors]
    content = attractor_variables(attractors) | {
        "kind": flags(DIM, kinds, "kind of motion", [kind.word for kind in MotionClass]),
        "velocity": impact_speed(dims, rows_of([each.velocities for each in attractors], longest)),
        "phase": variable("phase", dims, rows_of([each.phases for each in attractors], longest)),
        "status": status_variable(DIM, [each.status for each in attractors]),
    }
    return dataset_of(content, attrs=provenance("attractors", model, {}))
