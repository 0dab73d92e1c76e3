"""Sweeps that come out alike wherever they are computed and kept."""

import numpy as np
import pandas as pd

import vibroimpact as vi
from designs import shaker


def growing(v):
    return 0.5 + 0.3 * v / (1.0 + v)


def ball(law=growing):
    """Return a ball that falls at 3 m/s^2 onto a stop which obeys a law of restitution."""
    stop = vi.Stop(direction=1.0, gap=0.0, restitution=law)
    return vi.ImpactSystem(mass=2.0, stiffness=0.0, force=vi.Force(omega=0.7, constant=6.0), stops=[stop])


SMALL = {"omega": [1.0, 2.0, 2.8], "mass": [1.0, 1.1], "transient_impacts": 2, "sample_impacts": 3}
LAW = {"stop_1_gap": np.linspace(0.0, 0.3, 8), "start": vi.State(-1.0), "transient_impacts": 0, "sample_impacts": 5}
DAMPER = {"clearance": np.linspace(4e-3, 6e-3, 9), "frequency": [29.0, 29.5, 30.0], "sample_impacts": 60}
TABLE = pd.DataFrame({"rpm": np.linspace(700, 1500, 30), "clearance_mm": np.linspace(0.6, 0.1, 30)})
STUDIES = {
    "several initial conditions": (vi.ImpactOscillator, {**SMALL, "gap": [-0.2, 0.5], "start": 4}),
    "a law of restitution": (ball, LAW),
    "reference": (vi.ImpactOscillator, {**SMALL, "backend": "reference"}),
    "fixed-step": (vi.ImpactOscillator, {**SMALL, "backend": "fixed-step", "time_step": 0.01}),
    "displacements": (vi.ImpactOscillator, {**SMALL, "sample_impacts": 200, "indices": ["rms", "std"]}),
    "by stop": (vi.models.tube_in_supports, {"frequency": [18.0, 20.0, 22.0], "by_stop": True, "sample_impacts": 50}),
    "a table of designs": (lambda: shaker, {"points": TABLE, "sample_impacts": 50}),
    "a family": (lambda: vi.family(vi.models.impact_damper), DAMPER),
    "a family, refined": (lambda: vi.family(vi.models.impact_damper), DAMPER | {"refine": 1}),
}
