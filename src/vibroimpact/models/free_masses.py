"""One mass without a spring among moving stops: a bouncing ball, an impact pair, an idle gear, a gear pair."""

from __future__ import annotations

import math

from vibroimpact.model.force import Force
from vibroimpact.model.stops import Stop
from vibroimpact.model.system import ImpactSystem
from vibroimpact.models.arguments import checked, slot
from vibroimpact.parameters import critical_damping


@checked
def bouncing_ball(
    *,
    mass: float = 4e-3,
    amplitude: float = 0.12e-3,
    frequency: float = 50.0,
    gravity: float = 9.81,
    restitution: float = 0.5,
) -> ImpactSystem:
    r"""Return a ball on a vibrating table: a part on a vibratory conveyor, a screw in a feeder.

    Sketch: a table that moves up and down, and a ball that falls on it by its weight.

    .. math:: m \ddot z = -m g, \qquad z \ge A \sin \omega t

    Parameters
    ----------
    mass : float, > 0
        m in kg; only impulses depend on it.
    amplitude : float, >= 0
        A, amplitude of the table's motion in m.
    frequency : float, > 0
        Driving frequency of the table in Hz.
    gravity : float, > 0
        g in m/s^2.
    restitution : float, 0 to 1
        r, restitution of the table.

    Returns
    -------
    ImpactSystem
        The coordinate is the height z; the stop is `table`.

    Notes
    -----
    Motions depend on r and Gamma = A w^2/g only. The ball lifts off from rest if Gamma > 1. Motions with one bounce in
    N periods exist from Gamma = N pi (1 - r)/(1 + r), and are stable up to
    Gamma^2 = (N pi (1 - r)/(1 + r))^2 + (2 (1 + r^2)/(1 + r)^2)^2. Left out: air drag, spin, deflection of the table.

    References
    ----------
    P. J. Holmes, The dynamics of repeated impacts with a sinusoidally vibrating table, Journal of Sound and Vibration
    84, 1982.
    J. M. Luck and A. Mehta, Bouncing ball with a finite restitution: chattering, locking, and chaos, Physical Review E
    48, 1993.

    Examples
    --------
    >>> ball = bouncing_ball()
    >>> round(abs(ball.stops[0].motion[1]) * ball.omega**2 / 9.81, 3)  # Gamma: above 1.047 and below 1.527
    1.207
    """
    return ImpactSystem(
        mass=mass,
        stiffness=0.0,
        force=Force(frequency=frequency, constant=-mass * gravity),
        stops=[Stop(direction=-1.0, gap=0.0, restitution=restitution, name="table", motion={1: -amplitude})],
    )


@checked
def impact_pair(
    *,
    mass: float = 0.1,
    clearance: float = 1.5e-3,
    amplitude: float = 1e-3,
    frequency: float = 30.0,
    inclination: float = 0.0,
    gravity: float = 9.81,
    restitution: float = 0.6,
    left_restitution: float | None = None,
    right_restitution: float | None = None,
) -> ImpactSystem:
    r"""Return a free mass in the slot of a moving frame: a joint with play, a part shaken in its box, a harvester.

    Sketch: a frame that moves to and fro along a slot, and in the slot a mass with free travel `clearance`.

    .. math:: m \ddot x = -m g \sin \theta, \qquad |x - A \sin \omega t| \le d/2

    Parameters
    ----------
    mass : float, > 0
        m in kg; only impulses depend on it.
    clearance : float, > 0
        d in m, free travel from one end of the slot to the other.
    amplitude : float, >= 0
        A, amplitude of the frame's motion in m.
    frequency : float, > 0
        Driving frequency of the frame in Hz.
    inclination : float, -90 to 90
        theta in degrees, from the horizontal; if it is positive, the right end of the slot is higher.
    gravity : float, > 0
        g in m/s^2; it has no effect in a horizontal slot.
    restitution : float, 0 to 1
        Restitution of both ends.
    left_restitution, right_restitution : float, 0 to 1, optional
        Restitution at one side, if it differs.

    Returns
    -------
    ImpactSystem
        The coordinate is the absolute x; the stops `left` and `right` move with the frame.

    Notes
    -----
    A horizontal slot has no rest position: from rest, the mass stays where it is until an end reaches it, which never
    happens in the middle of a slot with d > 2 A. Left out: friction in the slot, and the reaction of the mass on the
    frame, which `impact_damper` includes.

    References
    ----------
    A. E. Kobrinskii, Dynamics of Mechanisms with Elastic Connections and Impact Systems, 1969.
    C. N. Bapat, N. Popplewell and K. McLachlan, Stable periodic motions of an impact-pair, Journal of Sound and
    Vibration 87, 1983.
    M. A. Heiman, P. J. Sherman and A. K. Bajaj, On the dynamics and stability of an inclined impact pair, Journal of
    Sound and Vibration 114, 1987.

    Examples
    --------
    >>> pair = impact_pair(inclination=90.0)
    >>> pair.force.constant.round(3).tolist(), pair.natural_frequencies.tolist()
    ([-0.981], [0.0])
    >>> pair.clearances([0.5e-3], time=0.25 * pair.period).round(6).tolist()
    [0.00025, 0.00125]
    """
    return ImpactSystem(
        mass=mass,
        stiffness=0.0,
        force=Force(frequency=frequency, constant=-mass * gravity * math.sin(math.radians(inclination))),
        stops=slot(
            "left", "right", 1.0, clearance, amplitude, (left_restitution, right_restitution), restitution=restitution
        ),
    )


@checked
def idle_gear(
    *,
    inertia: float = 1e-3,
    base_radius: float = 0.04,
    backlash: float = 0.1e-3,
    rpm: float = 850.0,
    order: float = 2.0,
    angular_acceleration: float = 600.0,
    drag_torque: float = 0.2,
    rotational_damping: float = 1e-3,
    restitution: float = 0.7,
    drive_restitution: float | None = None,
    coast_restitution: float | None = None,
) -> ImpactSystem:
    r"""Return an idle gear that rattles in its backlash: the unloaded gears of a car's gearbox in neutral.

    Sketch: a driving gear whose speed fluctuates with the engine; in mesh with it an idle gear, braked by drag. Angles
    are relative to the mean rotation.

    .. math:: J \ddot\theta + c \dot\theta = -T, \qquad
              |r_b (\theta - \Theta \sin \omega t)| \le j/2, \qquad
              \Theta = \alpha/\omega^2, \quad \omega = 2 \pi h\,\mathrm{rpm}/60

    Parameters
    ----------
    inertia : float, > 0
        J of the idle gear in kg m^2.
    base_radius : float, > 0
        r_b of the idle gear in m.
    backlash : float, > 0
        j in m, measured along the line of action.
    rpm : float, > 0
        Speed of the engine in revolutions per minute.
    order : float, > 0
        h, excitations per revolution: 2 for a four-stroke engine with four cylinders, 1.5 with three.
    angular_acceleration : float, >= 0
        alpha in rad/s^2, the amplitude of that order at the driving gear, multiplied by its number of teeth and divided
        by that of the idle gear.
    drag_torque : float, >= 0
        T in N m, mean drag of oil and bearings.
    rotational_damping : float, >= 0
        c in N m s/rad, the increase of drag with speed.
    restitution : float, 0 to 1
        Restitution of both flanks.
    drive_restitution, coast_restitution : float, 0 to 1, optional
        Restitution at one side, if it differs.

    Returns
    -------
    ImpactSystem
        The coordinate is theta in rad. The stops `drive` and `coast` are the flanks, which the driving gear moves;
        their clearances are in m and their impulses in N s, along the line of action.

    Notes
    -----
    The flanks separate if J alpha > T. Left out: the stiffness of teeth and shafts, changes of backlash by
    eccentricity, other orders of the engine.

    References
    ----------
    R. Singh, H. Xie and R. J. Comparin, Analysis of automotive neutral gear rattle, Journal of Sound and Vibration 131,
    1989.
    F. Pfeiffer and A. Kunert, Rattling models from deterministic to stochastic processes, Nonlinear Dynamics 1, 1990.

    Examples
    --------
    >>> gear = idle_gear()
    >>> round(gear.frequency, 3), gear.clearances([0.0]).tolist()
    (28.333, [5e-05, 5e-05])
    >>> struck = 1.0 / gear.modal().mobility[0, 0]  # the mass at the flank, J/r_b^2
    >>> float(round(struck, 3))
    0.625
    """
    omega = 2.0 * math.pi * order * rpm / 60.0
    restitutions = drive_restitution, coast_restitution
    moves = base_radius * angular_acceleration / omega**2
    return ImpactSystem(
        mass=inertia,
        damping=rotational_damping,
        stiffness=0.0,
        force=Force(omega=omega, constant=-drag_torque),
        stops=slot("drive", "coast", base_radius, backlash, moves, restitutions, restitution=restitution),
    )


@checked
def gear_pair(
    *,
    inertia: float = 2e-3,
    second_inertia: float = 2e-3,
    base_radius: float = 0.05,
    second_base_radius: float = 0.05,
    backlash: float = 0.1e-3,
    torque: float = 20.0,
    mesh_stiffness: float = 2e8,
    mesh_damping_ratio: float = 0.05,
    transmission_error: float = 2e-6,
    frequency: float = 3000.0,
) -> ImpactSystem:
    r"""Return a loaded pair of spur gears with compliant teeth, which lose contact when the mesh resonates.

    Sketch: two gears, with a mean torque on each; between their teeth, backlash, and a spring and damper on each flank.

    .. math:: m \ddot x = T/r_1 - F_{drive} + F_{coast}, \qquad x = r_1 \theta_1 - r_2 \theta_2, \qquad
              \frac{1}{m} = \frac{r_1^2}{J_1} + \frac{r_2^2}{J_2}

    Each flank pushes with max(0, k d + c d') at a penetration d = ±(x - e sin wt) - j/2 > 0.

    Parameters
    ----------
    inertia, second_inertia : float, > 0
        J_1 of the driving gear and J_2 of the driven one in kg m^2.
    base_radius, second_base_radius : float, > 0
        r_1 and r_2 in m.
    backlash : float, > 0
        j in m, measured along the line of action.
    torque : float, >= 0
        T in N m, mean torque on the driving gear.
    mesh_stiffness : float, > 0
        k in N/m of the teeth in mesh, its mean over the mesh cycle.
    mesh_damping_ratio : float, >= 0
        c / (2 sqrt(k m)).
    transmission_error : float, >= 0
        e in m, amplitude of the static transmission error at the mesh frequency.
    frequency : float, > 0
        Mesh frequency in Hz: teeth times revolutions per second.

    Returns
    -------
    ImpactSystem
        The coordinate is x in m, the dynamic transmission error; the stops `drive` and `coast` are the flanks.

    Notes
    -----
    Left out: changes of stiffness as teeth enter and leave the mesh, and compliance of shafts and bearings.

    References
    ----------
    A. Kahraman and R. Singh, Non-linear dynamics of a spur gear pair, Journal of Sound and Vibration 142, 1990.

    Examples
    --------
    >>> pair = gear_pair(torque=30.0)
    >>> float(pair.mass[0, 0].round(6)), pair.force.constant.round(6).tolist()  # kg and N along the line of action
    (0.4, [600.0])
    """
    mass = 1.0 / (base_radius**2 / inertia + second_base_radius**2 / second_inertia)
    damping = mesh_damping_ratio * critical_damping(mesh_stiffness, mass)
    return ImpactSystem(
        mass=mass,
        stiffness=0.0,
        force=Force(frequency=frequency, constant=torque / base_radius),
        stops=slot("drive", "coast", -1.0, backlash, -transmission_error, stiffness=mesh_stiffness, damping=damping),
    )
