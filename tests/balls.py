"""A ball on a shaken table, and where its orbits of one impact bifurcate in closed form."""

import math

import vibroimpact as vi

GRAVITY = 9.81


@vi.family
def ball(amplitude=0.02, omega=20.0, restitution=0.5):
    """Return a ball that bounces on a table shaken with an amplitude."""
    table = vi.Stop(direction=-1, gap=0.0, restitution=restitution, name="table", motion={1: -amplitude})
    return vi.ImpactSystem(mass=0.3, stiffness=0.0, force=vi.Force(omega=omega, constant=-0.3 * GRAVITY), stops=[table])


def of_the_ball(restitution, n_periods):
    """Return at which accelerations of its table, in g, the ball's orbit of one impact folds and doubles.

    J. Guckenheimer and P. Holmes, Nonlinear Oscillations (1983), section 2.4.
    """
    fold = n_periods * math.pi * (1 - restitution) / (1 + restitution)
    return fold, math.hypot(fold, 2 * (1 + restitution**2) / (1 + restitution) ** 2)
