"""Orbits that branches begin with, and what of branches is compared."""

import numpy as np

import vibroimpact as vi
from contents import special_points
from systems import FORMS


def first(omega=2.0, n_impacts=1, as_model=FORMS["one mass"], **changes):
    """Return the first orbit of an oscillator, or of it in another form."""
    return vi.find_orbit(as_model(vi.ImpactOscillator(omega=omega, **changes)), n_impacts=n_impacts)[0]


def values_of(branch, kind):
    """Return the values of the special points of a kind."""
    return [point.value for point in special_points(branch, kind)]


def specials(branch):
    """Return the kinds and values of all special points."""
    return sorted((point.kind, point.value) for point in branch.special)


def name_of(orbit, model=None, nudge=1e-4):
    """Return what the engine calls the motion that begins beside an orbit, maybe of another model."""
    model, begun = model or orbit.model, orbit.start
    start = vi.State(begun.displacement, np.multiply(begun.velocity, 1 + nudge), orbit.phases[0] * model.period)
    return vi.recognise(vi.impact_section(model, start=start, transient_impacts=4000, sample_impacts=400)).name


@vi.family(units={"rpm": "1/min", "clearance_mm": "mm"})
def shaker(unbalance=0.002, rpm=1500.0, clearance_mm=0.5):
    """Tied parameters: the force of an unbalance grows with the square of the speed."""
    omega = rpm * 2 * np.pi / 60
    return vi.ImpactOscillator(
        mass=2.0,
        stiffness=45000.0,
        damping_ratio=0.05,
        amplitude=unbalance * omega**2,
        omega=omega,
        gap=clearance_mm / 1e3,
        restitution=0.7,
    )
