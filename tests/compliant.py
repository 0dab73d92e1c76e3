"""Masses in front of stops that give, and their stable orbits."""

import numpy as np

import vibroimpact as vi


@vi.family
def two_masses(omega=0.75, gap=1.0, push=0.1):
    """Return the one-sided spring of NLvib (M. Krack and J. Gross, Harmonic Balance for Nonlinear Vibration Problems,
    Springer 2019).
    """
    spring = vi.Stop(direction=[1, 0], gap=gap, stiffness=100.0, name="spring")
    springs = np.array([[1.0, -1.0], [-1.0, 2.0]])
    force = vi.Force(omega=omega, harmonics={1: [0.0, push * 1j]})
    return vi.ImpactSystem(mass=np.eye(2), damping=0.03 * springs, stiffness=springs, force=force, stops=[spring])


def bilinear(stiffness=100.0, damping=1.0, gap=0.2, omega=2.0, push=1.0, **changes):
    """Return one mass in front of a compliant stop."""
    stops = [vi.Stop(direction=1, gap=gap, stiffness=stiffness, damping=damping, name="above")]
    force = vi.Force(omega=omega, harmonics={1: push})
    return vi.ImpactSystem(**{"mass": 1.0, "damping": 0.05, "stiffness": 1.0, "force": force, "stops": stops} | changes)


@vi.family
def between(omega=3.0, below=0.1, damping=0.0, gap=0.1, stiffness=30.0):
    """Return one mass between two compliant stops."""
    stops = [
        vi.Stop(direction=1, gap=gap, stiffness=stiffness, damping=damping, name="above"),
        vi.Stop(direction=-1, gap=below, stiffness=stiffness, damping=damping, name="below"),
    ]
    return bilinear(stops=stops, omega=omega)


@vi.family
def mixed(omega=2.0, damping=1.0):
    """Return one mass between a compliant stop and a rigid one."""
    stops = [
        vi.Stop(direction=1, gap=0.2, stiffness=100.0, damping=damping, name="above"),
        vi.Stop(direction=-1, gap=0.4, restitution=0.7, name="below"),
    ]
    return bilinear(stops=stops, omega=omega)


def chain_on_two_stops():
    """Return two masses whose stops push at once for a part of the cycle."""
    springs = np.array([[2.0, -1.0], [-1.0, 1.5]])
    stops = [
        vi.Stop(direction=[1, 0], gap=0.1, stiffness=40.0, damping=0.5, name="first"),
        vi.Stop(direction=[0, 1], gap=0.2, stiffness=60.0, damping=0.8, name="second"),
    ]
    return vi.ImpactSystem(
        mass=np.eye(2),
        damping=0.1 * springs,
        stiffness=springs,
        force=vi.Force(omega=1.2, harmonics={1: [1.0, 0.5]}, constant=[0.1, 0.0]),
        stops=stops,
    )


def the_stable(found):
    """Return the first of the orbits found that is stable."""
    return next(orbit for orbit in found if orbit.stable)
