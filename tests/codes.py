"""The engine and the independent witness, asked the same: what holds of a motion must hold by either code."""

from typing import NamedTuple

import numpy as np
import pytest

import vibroimpact as vi
from differences import derivative
from systems import CONTACT, linear, one_mass
from vibroimpact.indices import INDICES
from witness import follow

OF_IMPACTS = ("time", "velocity", *CONTACT)


class Motion(NamedTuple):
    """The impacts as arrays, what happens to stops as (time, kind, stop) in order of time, and (q, v) at the end."""

    impacts: dict[str, np.ndarray]
    events: list[tuple[float, str, int]]
    state: np.ndarray


class Engine:
    """The engine, by the package's public functions."""

    many = 200  # impacts that it makes in no time

    def impacts(self, model, q, v, time=0.0, number=20, cut=1e-9):
        """Return the first impacts as arrays, stops by their numbers; those slower than `cut` of V are not recorded."""
        start, how = vi.State([*q], [*v], time), {"tolerances": vi.Tolerances(chatter=cut)}
        hits = vi.impact_section(model, start=start, transient_impacts=0, sample_impacts=number, **how)
        found = {name: hits[name].values for name in (*OF_IMPACTS, "simultaneous") if name in hits}
        return found | {"stop": self._numbers(model, hits["stop"])}

    def motion(self, model, q, v, time=0.0, periods=1.0, cut=1e-9):
        """Return the motion over some driving periods, a multiple of 1/64 of them."""
        how = {"samples_per_period": 64, "tolerances": vi.Tolerances(chatter=cut)}
        motion = vi.simulate(model, start=vi.State([*q], [*v], time), periods=periods, **how)
        kinds, found = (("impact", "impact"), ("stick", "stick"), ("release", "stick")), []
        for kind, dim in kinds:
            stops = self._numbers(model, motion[f"{dim}_stop"]).tolist()
            found += zip(motion[f"{kind}_time"].values.tolist(), [kind] * len(stops), stops, strict=True)
        names = {name: f"impact_{name}" if name in ("time", "velocity") else name for name in OF_IMPACTS}
        hits = {name: motion[known].values for name, known in names.items() if known in motion}
        state = np.concatenate([motion["displacement"].values[-1], motion["velocity"].values[-1]])
        return Motion(hits, sorted((e for e in found if np.isfinite(e[0])), key=lambda e: e[0]), state)

    @staticmethod
    def _numbers(model, names):
        return np.array([model.stop_names.index(name) for name in names.values], int)


class Witness:
    """The NumPy witness for systems, which shares no line with the engine."""

    many = 12

    def impacts(self, model, q, v, time=0.0, number=20, cut=1e-9):
        """Return the first impacts, as `Engine.impacts` does."""
        how = {"impacts": number, "cut": cut * model.velocity_scale}
        return self._arrays(follow(linear(model), q, v, time, **how))

    def motion(self, model, q, v, time=0.0, periods=1.0, cut=1e-9):
        """Return the motion over some driving periods, as `Engine.motion` does."""
        how = {"impacts": 10**6, "most_periods": periods, "cut": cut * model.velocity_scale}
        trajectory = follow(linear(model), q, v, time, **how)
        events = [(event.time, event.kind, event.stop) for event in trajectory.events]
        return Motion(
            self._arrays(trajectory), events, np.concatenate([trajectory.end.displacement, trajectory.end.velocity])
        )

    @staticmethod
    def _arrays(samples):
        names = *OF_IMPACTS, "simultaneous", "stop"
        return {name: np.array([getattr(event, name) for event in samples.impacts]) for name in names}


def later(code, model, state, begin, turns):
    """Return (q, v) some driving periods later."""
    return code.motion(model, *np.split(np.asarray(state, float), 2), begin, turns).state


def differences(code, model, x, begin, turns, step=2e-5):
    """Return the derivative of the state some driving periods later by the state before, by central differences."""
    return derivative(lambda state: later(code, model, state, begin, turns), x, step)


class Way:
    """A model by the engine as it comes, one mass as a system by that of systems, or by the back end `reference`."""

    def __init__(self, name):
        self.name, self.backend = name, "reference" if name == "witness" else "cpu"
        self.slow, self.as_system = name == "witness", name == "engine of systems"

    def _asked(self, function, osc, how):
        return function(one_mass(osc) if self.as_system and osc.forgets else osc, backend=self.backend, **how)

    def section(self, osc, transient=0, sample=20, **how):
        """Return impacts and rests; `transient` impacts are left out."""
        return self._asked(vi.impact_section, osc, {"transient_impacts": transient, "sample_impacts": sample} | how)

    def simulate(self, osc, **how):
        """Return the motion over time."""
        samples = self._asked(vi.simulate, osc, how)
        return samples.isel(coordinate=0) if self.as_system and osc.forgets else samples

    def indices(self, osc, names=tuple(INDICES), transient=100, sample=5000, **how):
        """Return indices of the window of impacts, as plain numbers by their names, with the status."""
        how |= {"transient_impacts": transient, "sample_impacts": sample, "indices": names}
        found = self._asked(vi.parameter_map, osc, {"omega": [osc.omega]} | how).isel(omega=0)
        return {name: found[name].item() for name in (*names, "status")}


def index_of(model, *names, **how):
    """Return indices of a model over the impacts of a window, as plain numbers in order of their names."""
    arguments = {"omega": [model.omega], "indices": names, "sample_impacts": 3000} | how
    sweep = vi.parameter_map(model, **arguments)
    return [float(sweep[name].item()) for name in names]


def name_of(indices):
    """Return in how many periods a motion repeats, and after how many impacts."""
    return indices["n_periods"], indices["n_impacts"]


# Of systems a rest's indices are averages over the window, and names need repetition alone.
ONE_MASS = pytest.mark.parametrize("way", ["engine", "witness"], indirect=True)
