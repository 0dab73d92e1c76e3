"""Structures with a mass that moves inside them: impact dampers, a tuned mass in its housing."""

from __future__ import annotations

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.model.force import Force
from vibroimpact.model.stops import Stop
from vibroimpact.model.system import ImpactSystem
from vibroimpact.models.arguments import checked, first_given, slot
from vibroimpact.parameters import radians


@checked
def impact_damper(
    *,
    mass: float = 10.0,
    natural_frequency: float = 30.0,
    damping_ratio: float = 0.01,
    force: float = 50.0,
    frequency: float = 30.0,
    particle_mass: float = 0.5,
    clearance: float = 5e-3,
    particles: int = 1,
    restitution: float = 0.7,
    left_restitution: float | None = None,
    right_restitution: float | None = None,
) -> ImpactSystem:
    r"""Return a structure with free particles in a slot: a damper for boring bars, antennas or turbine blades.

    Sketch: a mass on spring and damper, driven by a force; in a slot in it, one particle or several in a row travel
    between the ends and hit each other.

    .. math:: m \ddot x_0 + c \dot x_0 + k x_0 = F \sin \omega t, \qquad \frac{\mu}{p} \ddot x_i = 0 \quad (i = 1..p),
              \qquad x_0 - x_1 \le \frac{d}{p + 1}, \quad x_i - x_{i+1} \le \frac{d}{p + 1}, \quad
              x_p - x_0 \le \frac{d}{p + 1}

    Parameters
    ----------
    mass : float, > 0
        m in kg, modal mass of the structure.
    natural_frequency : float, > 0
        sqrt(k/m) over 2 pi, in Hz.
    damping_ratio : float, >= 0
        c / (2 sqrt(k m)).
    force : float, >= 0
        F in N on the structure.
    frequency : float, > 0
        Driving frequency in Hz.
    particle_mass : float, > 0
        mu in kg, the mass of all particles together.
    clearance : float, > 0
        d in m, the total free travel in the slot. At q = 0 it is shared equally between the gaps.
    particles : int, 1 to 4
        p, the number of particles in the slot.
    restitution : float, 0 to 1
        Restitution at the ends and between particles.
    left_restitution, right_restitution : float, 0 to 1, optional
        Restitution at one side, if it differs.

    Returns
    -------
    ImpactSystem
        The coordinates are x_0 of the structure and x_1, x_2, ... of the particles, from left to right; the stops are
        `left`, `between_1`, ..., `right`.

    Notes
    -----
    From rest, impacts begin when the structure's amplitude reaches d/(p + 1). Left out: weight and friction in the
    slot, and other modes of the structure.

    References
    ----------
    S. F. Masri and T. K. Caughey, On the stability of the impact damper, Journal of Applied Mechanics 33, 1966.
    S. F. Masri, General motion of impact dampers, Journal of the Acoustical Society of America 47, 1970.

    Examples
    --------
    >>> damper = impact_damper()
    >>> (damper.natural_frequencies / (2 * np.pi)).round(9).tolist(), damper.clearances([1e-3, 0.0]).tolist()
    ([0.0, 30.0], [0.0015, 0.0035])
    >>> impact_damper(particles=3).stop_names
    ('left', 'between_1', 'between_2', 'right')
    """
    names = ["left", *(f"between_{at}" for at in range(1, particles)), "right"]
    restitutions = {"left": left_restitution, "right": right_restitution}
    stops = []
    for at, name in enumerate(names):
        direction = np.zeros(particles + 1)
        direction[at] += 1.0
        direction[(at + 1) % (particles + 1)] -= 1.0
        r = first_given(restitutions.get(name), restitution)
        stops.append(Stop(direction=direction, gap=clearance / (particles + 1), restitution=r, name=name))
    masses = [mass, *[particle_mass / particles] * particles]
    return _structure(masses, natural_frequency, damping_ratio, force, frequency, stops)


@checked
def two_unit_impact_damper(
    *,
    mass: float = 10.0,
    natural_frequency: float = 30.0,
    damping_ratio: float = 0.01,
    force: float = 50.0,
    frequency: float = 30.0,
    particle_mass: float = 0.25,
    second_particle_mass: float = 0.25,
    clearance: float = 5e-3,
    second_clearance: float = 4e-3,
    restitution: float = 0.7,
    first_left_restitution: float | None = None,
    first_right_restitution: float | None = None,
    second_left_restitution: float | None = None,
    second_right_restitution: float | None = None,
) -> ImpactSystem:
    r"""Return a structure with two free particles, each in its own slot: two weak impacts instead of a hard one.

    Sketch: a mass on spring and damper, driven by a force; two slots in it, side by side, with a particle in each.

    .. math:: m \ddot x_0 + c \dot x_0 + k x_0 = F \sin \omega t, \qquad \mu_i \ddot x_i = 0, \qquad
              |x_i - x_0| \le d_i/2 \quad (i = 1, 2)

    Parameters
    ----------
    mass : float, > 0
        m in kg, modal mass of the structure.
    natural_frequency : float, > 0
        sqrt(k/m) over 2 pi, in Hz.
    damping_ratio : float, >= 0
        c / (2 sqrt(k m)).
    force : float, >= 0
        F in N on the structure.
    frequency : float, > 0
        Driving frequency in Hz.
    particle_mass, second_particle_mass : float, > 0
        mu_1 and mu_2 in kg.
    clearance, second_clearance : float, > 0
        d_1 and d_2 in m, free travel from one end of the slot to the other.
    restitution : float, 0 to 1
        Restitution at all ends.
    first_left_restitution, first_right_restitution : float, 0 to 1, optional
        Restitution at one side, if it differs.
    second_left_restitution, second_right_restitution : float, 0 to 1, optional
        Restitution at one side, if it differs.

    Returns
    -------
    ImpactSystem
        The coordinates are x_0, x_1, x_2; the stops are `first_left`, `first_right`, `second_left`, `second_right`.

    Notes
    -----
    With equal clearances, all impacts from rest occur in simultaneous pairs. Left out: as in `impact_damper`.

    References
    ----------
    S. F. Masri, Analytical and experimental studies of multiple-unit impact dampers, Journal of the Acoustical Society
    of America 45, 1969.

    Examples
    --------
    >>> two_unit_impact_damper().clearances([1e-3, 0.0, 0.0]).tolist()
    [0.0015, 0.0035, 0.001, 0.003]
    """
    ends = first_left_restitution, first_right_restitution, second_left_restitution, second_right_restitution
    one, two = np.array([-1.0, 1.0, 0.0]), np.array([-1.0, 0.0, 1.0])
    first = slot("first_left", "first_right", one, clearance, None, ends[:2], restitution=restitution)
    second = slot("second_left", "second_right", two, second_clearance, None, ends[2:], restitution=restitution)
    masses = [mass, particle_mass, second_particle_mass]
    return _structure(masses, natural_frequency, damping_ratio, force, frequency, [*first, *second])


@checked
def tuned_mass_damper(
    *,
    mass: float = 4e4,
    natural_frequency: float = 2.0,
    damping_ratio: float = 0.005,
    force: float = 2000.0,
    frequency: float = 2.0,
    mass_ratio: float = 0.02,
    tuning: float = 0.98,
    absorber_damping_ratio: float = 0.085,
    stroke: float = 0.01,
    restitution: float = 0.4,
    left_restitution: float | None = None,
    right_restitution: float | None = None,
) -> ImpactSystem:
    r"""Return a structure with a tuned mass that hits its housing: a footbridge under a larger load than planned.

    Sketch: a mass on spring and damper, driven by a force; on it a housing, in which a smaller mass on its own spring
    and damper can move by `stroke` to either side.

    .. math:: m \ddot x_0 + c \dot x_0 + k x_0 - c_a (\dot x_1 - \dot x_0) - k_a (x_1 - x_0) = F \sin \omega t, \\
              \mu m \ddot x_1 + c_a (\dot x_1 - \dot x_0) + k_a (x_1 - x_0) = 0, \qquad |x_1 - x_0| \le s

    Parameters
    ----------
    mass : float, > 0
        m in kg, modal mass of the structure.
    natural_frequency : float, > 0
        sqrt(k/m) over 2 pi, in Hz.
    damping_ratio : float, >= 0
        c / (2 sqrt(k m)).
    force : float, >= 0
        F in N on the structure.
    frequency : float, > 0
        Driving frequency in Hz.
    mass_ratio : float, > 0
        mu, mass of the absorber divided by m.
    tuning : float, > 0
        Natural frequency sqrt(k_a/(mu m)) of the absorber alone, divided by that of the structure.
    absorber_damping_ratio : float, >= 0
        c_a / (2 sqrt(k_a mu m)).
    stroke : float, > 0
        s in m to either side.
    restitution : float, 0 to 1
        Restitution at the housing's ends.
    left_restitution, right_restitution : float, 0 to 1, optional
        Restitution at one side, if it differs.

    Returns
    -------
    ImpactSystem
        The coordinates are x_0 of the structure and x_1 of the absorber; the stops are `left` and `right`.

    Notes
    -----
    Den Hartog's optimal absorber has the tuning 1/(1 + mu) and the damping ratio sqrt(3 mu/(8 (1 + mu)^3)), which are
    0.980 and 0.084 at mu = 0.02. Left out: compliant buffers, and friction in the guides.

    References
    ----------
    J. P. Den Hartog, Mechanical Vibrations, 4th edition, 1956, section 3.3.

    Examples
    --------
    >>> bridge = tuned_mass_damper()
    >>> (bridge.natural_frequencies / (2 * np.pi)).round(3).tolist(), bridge.clearances([0.004, 0.0]).tolist()
    ([1.845, 2.125], [0.006, 0.014])
    """
    absorber = mass_ratio * mass
    rate = radians(natural_frequency) * tuning
    link = np.array([[1.0, -1.0], [-1.0, 1.0]])
    restitutions = left_restitution, right_restitution
    stops = slot("left", "right", np.array([-1.0, 1.0]), 2.0 * stroke, None, restitutions, restitution=restitution)
    return _structure(
        [mass, absorber],
        natural_frequency,
        damping_ratio,
        force,
        frequency,
        stops,
        damping=2.0 * absorber_damping_ratio * rate * absorber * link,
        stiffness=rate**2 * absorber * link,
    )


def _structure(
    masses: list[float],
    natural_frequency: float,
    damping_ratio: float,
    force: float,
    frequency: float,
    stops: list[Stop],
    damping: Floats | float = 0.0,
    stiffness: Floats | float = 0.0,
) -> ImpactSystem:
    """Return a driven mass on spring and damper, with other masses and the links between them."""
    n, rate = len(masses), radians(natural_frequency)
    ground = np.zeros((n, n))
    ground[0, 0] = 1.0
    return ImpactSystem(
        mass=np.diag(masses),
        damping=2.0 * damping_ratio * rate * masses[0] * ground + damping,
        stiffness=rate**2 * masses[0] * ground + stiffness,
        force=Force(frequency=frequency, harmonics={1: [force] + [0.0] * (n - 1)}),
        stops=stops,
    )
