"""One mass on a spring: between two stops, with a compliant stop, on a moving base, with an unbalance."""

from __future__ import annotations

import math

from vibroimpact.model.force import Force
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.model.stops import Stop
from vibroimpact.model.system import ImpactSystem
from vibroimpact.models.arguments import checked, first_given
from vibroimpact.parameters import critical_damping


@checked
def two_sided_oscillator(
    *,
    mass: float = 2.0,
    stiffness: float = 2e4,
    damping_ratio: float = 0.02,
    force: float = 40.0,
    frequency: float = 25.0,
    left_gap: float = 1e-3,
    right_gap: float = 1e-3,
    restitution: float = 0.6,
    left_restitution: float | None = None,
    right_restitution: float | None = None,
) -> ImpactSystem:
    r"""Return a mass on a spring between two stops: a pipe in its snubber, a part with play on both sides.

    Sketch: a wall, spring and damper, the mass; a stop `left_gap` to its left and one `right_gap` to its right.

    .. math:: m \ddot x + c \dot x + k x = F \sin \omega t, \qquad -g_{left} \le x \le g_{right}

    Parameters
    ----------
    mass : float, > 0
        m in kg.
    stiffness : float, > 0
        k in N/m.
    damping_ratio : float, >= 0
        c / (2 sqrt(k m)).
    force : float, >= 0
        F in N.
    frequency : float, > 0
        Driving frequency in Hz.
    left_gap, right_gap : float
        Clearances in m from the position where the spring is relaxed; negative means preloaded against that stop.
    restitution : float, 0 to 1
        Restitution of both stops.
    left_restitution, right_restitution : float, 0 to 1, optional
        Restitution at one side, if it differs.

    Returns
    -------
    ImpactSystem
        The coordinate is x; the stops are `left` and `right`.

    Raises
    ------
    ValueError
        A number is out of range, or the stops overlap.

    Notes
    -----
    Left out: compliance of the stops, and vibration modes of mass or frame that impacts excite. With equal gaps, each
    motion is its own mirror image half a period later, or its mirror image is a second motion.

    References
    ----------
    S. W. Shaw, The dynamics of a harmonically excited system having rigid amplitude constraints, Journal of Applied
    Mechanics 52, 1985, parts 1 and 2.

    Examples
    --------
    >>> system = two_sided_oscillator(left_gap=0.5e-3)
    >>> (system.natural_frequencies / (2 * math.pi)).round(2).tolist(), system.clearances([0.0]).tolist()
    ([15.92], [0.0005, 0.001])
    """
    return ImpactSystem(
        mass=mass,
        damping=damping_ratio * critical_damping(stiffness, mass),
        stiffness=stiffness,
        force=Force(frequency=frequency, harmonics={1: force}),
        stops=[
            Stop(direction=-1.0, gap=left_gap, restitution=first_given(left_restitution, restitution), name="left"),
            Stop(direction=1.0, gap=right_gap, restitution=first_given(right_restitution, restitution), name="right"),
        ],
    )


@checked
def bilinear_oscillator(
    *,
    mass: float = 1.0,
    stiffness: float = 4e3,
    damping_ratio: float = 0.02,
    force: float = 4.0,
    frequency: float = 7.0,
    gap: float = 1e-3,
    stop_stiffness: float = 1.2e5,
    stop_damping: float = 20.0,
) -> ImpactSystem:
    r"""Return a mass on a spring with a compliant stop: a rig with a beam as its stop, a fender, a snubber.

    Sketch: a wall, spring and damper, the mass; in front of it, at a gap, a second spring and damper on a wall.

    .. math:: m \ddot x + c \dot x + k x + \max(0,\ k_s d + c_s \dot d) = F \sin \omega t, \qquad d = x - g > 0

    Parameters
    ----------
    mass : float, > 0
        m in kg.
    stiffness : float, > 0
        k in N/m.
    damping_ratio : float, >= 0
        c / (2 sqrt(k m)).
    force : float, >= 0
        F in N.
    frequency : float, > 0
        Driving frequency in Hz.
    gap : float
        g in m; negative means preloaded.
    stop_stiffness : float, > 0
        k_s in N/m; for a clamped beam hit at its tip, 3 E I/L^3.
    stop_damping : float, >= 0
        c_s in N s/m.

    Returns
    -------
    ImpactSystem
        The coordinate is x; the stop is `spring`.

    Notes
    -----
    Left out: the mass of the stop, which makes the first instant of contact an impact, and its vibration after contact.

    References
    ----------
    S. W. Shaw and P. J. Holmes, A periodically forced piecewise linear oscillator, Journal of Sound and Vibration 90,
    1983.
    J. Ing, E. Pavlovskaia, M. Wiercigroch and S. Banerjee, Experimental study of impact oscillator with one-sided
    elastic constraint, Philosophical Transactions of the Royal Society A 366, 2008.

    Examples
    --------
    >>> rig = bilinear_oscillator(stop_stiffness=6e4)
    >>> (rig.natural_frequencies / (2 * math.pi)).round(2).tolist(), rig.stops[0].stiffness
    ([10.07], 60000.0)
    """
    return ImpactSystem(
        mass=mass,
        damping=damping_ratio * critical_damping(stiffness, mass),
        stiffness=stiffness,
        force=Force(frequency=frequency, harmonics={1: force}),
        stops=[Stop(direction=1.0, gap=gap, stiffness=stop_stiffness, damping=stop_damping, name="spring")],
    )


@checked
def base_excited_oscillator(
    *,
    mass: float = 0.5,
    stiffness: float = 2e4,
    damping_ratio: float = 0.02,
    base_acceleration: float = 20.0,
    frequency: float = 40.0,
    gap: float = 0.5e-3,
    restitution: float = 0.7,
) -> ImpactOscillator:
    r"""Return a mass on a spring on a moving base, with a stop on that base: a relay, a part on a shaker.

    Sketch: a table that moves as Y sin wt; on it a spring and damper with the mass, and a stop that moves with the
    table.

    .. math:: m \ddot y + c \dot y + k y = m a_0 \sin \omega t, \qquad y \le g, \qquad a_0 = \omega^2 Y

    Parameters
    ----------
    mass : float, > 0
        m in kg.
    stiffness : float, > 0
        k in N/m.
    damping_ratio : float, >= 0
        c / (2 sqrt(k m)).
    base_acceleration : float, >= 0
        a_0 in m/s^2, the amplitude to which a shaker is set.
    frequency : float, > 0
        Driving frequency of the base in Hz.
    gap : float
        g in m; negative means preloaded.
    restitution : float, 0 to 1
        Restitution of the stop.

    Returns
    -------
    ImpactOscillator
        The displacement y and all velocities are relative to the base.

    Notes
    -----
    Left out: the reaction of the mass on the shaker. A stop fixed to the ground is a different machine.

    References
    ----------
    S. W. Shaw and P. J. Holmes, A periodically forced piecewise linear oscillator, Journal of Sound and Vibration 90,
    1983.

    Examples
    --------
    >>> osc = base_excited_oscillator(base_acceleration=30.0)
    >>> osc.amplitude, round(osc.natural_frequency / (2 * math.pi), 2)
    (15.0, 31.83)
    """
    return ImpactOscillator(
        mass=mass,
        stiffness=stiffness,
        damping_ratio=damping_ratio,
        amplitude=mass * base_acceleration,
        frequency=frequency,
        gap=gap,
        restitution=restitution,
    )


@checked
def unbalanced_machine(
    *,
    mass: float = 80.0,
    stiffness: float = 5e5,
    damping_ratio: float = 0.03,
    unbalance: float = 0.05,
    rpm: float = 900.0,
    gap: float = 1e-3,
    restitution: float = 0.5,
) -> ImpactOscillator:
    r"""Return a machine on springs that its unbalance drives against a stop: a compressor, a screen, a washing machine.

    Sketch: a housing on springs and dampers, in it a rotor with an unbalance; above the housing a stop.

    .. math:: m \ddot y + c \dot y + k y = U \omega^2 \sin \omega t, \qquad y \le g, \qquad
              \omega = 2 \pi\,\mathrm{rpm}/60

    Parameters
    ----------
    mass : float, > 0
        m in kg, rotor and housing together.
    stiffness : float, > 0
        k in N/m.
    damping_ratio : float, >= 0
        c / (2 sqrt(k m)).
    unbalance : float, >= 0
        U in kg m, rotating mass times eccentricity.
    rpm : float, > 0
        Speed in revolutions per minute; the force increases with its square.
    gap : float
        g in m, from static equilibrium; negative means preloaded.
    restitution : float, 0 to 1
        Restitution of the stop.

    Returns
    -------
    ImpactOscillator
        The oscillator at that speed; `vibroimpact.family` makes the speed an axis.

    Notes
    -----
    Left out: lateral and rocking motion, and the drop in speed if the motor is too weak to pass a resonance.

    References
    ----------
    J. P. Den Hartog, Mechanical Vibrations, 4th edition, 1956, chapter 2.

    Examples
    --------
    >>> machine = unbalanced_machine(rpm=1800.0)
    >>> round(machine.frequency, 9), round(machine.amplitude / unbalanced_machine().amplitude, 9)
    (30.0, 4.0)
    """
    omega = 2.0 * math.pi * rpm / 60.0
    return ImpactOscillator(
        mass=mass,
        stiffness=stiffness,
        damping_ratio=damping_ratio,
        amplitude=unbalance * omega**2,
        omega=omega,
        gap=gap,
        restitution=restitution,
    )
