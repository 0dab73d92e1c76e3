"""Euler-Bernoulli beams with a stop, in their first modes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vibroimpact.model.force import Force
from vibroimpact.model.stops import Stop
from vibroimpact.model.system import ImpactSystem
from vibroimpact.models.arguments import checked, sharing
from vibroimpact.models.beam_modes import beam_modes, moving_row

_OF_BEAMS = r"""
.. math:: E I w'''' + m' \ddot w + \mathrm{damping} = F \delta(x - x_F) \sin \omega t + m' a_0 \sin \omega t, \qquad
          w(x_s) \le g, \qquad w = \sum_i \phi_i(x) \eta_i

Parameters
----------
length, width, thickness : float, > 0
    Dimensions of the strip in m; it bends in the direction of its thickness.
youngs_modulus : float, > 0
    E in Pa.
density : float, > 0
    Density in kg/m^3.
damping_ratio : float, >= 0
    Damping ratio of every mode.
force : float, >= 0
    F in N, in phase with the base.
force_at, stop_at : float, 0 to 1
    x_F and x_s divided by the length, from the left end; the stop must be at a place that moves.
base_acceleration : float, >= 0
    a_0 in m/s^2: the base moves as a_0/w^2 sin wt, and w is relative to it.
frequency : float, > 0
    Driving frequency in Hz.
gap : float
    g in m; negative means preloaded.
restitution : float, 0 to 1
    Restitution of the stop.
modes : int, 1 to 12
    The number of modes.

Returns
-------
ImpactSystem
    Its coordinates are modal, in m sqrt(kg) with M = I; the stop is `stop`.

Raises
------
ValueError
    A number is out of range, or the stop is at a fixed end.
"""


@checked
@sharing(_OF_BEAMS)
def cantilever_with_stop(
    *,
    length: float = 0.3,
    width: float = 0.02,
    thickness: float = 1e-3,
    youngs_modulus: float = 2.1e11,
    density: float = 7800.0,
    damping_ratio: float = 0.01,
    force: float = 0.0,
    force_at: float = 1.0,
    base_acceleration: float = 5.0,
    frequency: float = 12.0,
    stop_at: float = 1.0,
    gap: float = 2e-3,
    restitution: float = 0.6,
    modes: int = 3,
) -> ImpactSystem:
    r"""Return a cantilever with a stop: a reed, a valve leaf, a cable tray, a strip on a shaker.

    Sketch: a strip clamped at its left end and free at its right end; next to it a stop, which is fixed to the clamp. A
    force acts on the strip, or the base moves, or both.

    Notes
    -----
    With restitution, results depend on `modes` and do not converge: the struck mass 1/(a . M^-1 a) decreases with every
    mode that moves at the stop, and at the tip it is the beam's mass over 4 n with n modes. Left out: shear and rotary
    inertia (negligible if the thickness is far below the length of a half wave), large deflections, weight.

    References
    ----------
    S. W. Shaw, Forced vibrations of a beam with one-sided amplitude constraint: theory and experiment, Journal of Sound
    and Vibration 99, 1985.
    F. C. Moon and S. W. Shaw, Chaotic vibrations of a beam with non-linear boundary conditions, International Journal
    of Non-Linear Mechanics 18, 1983.
    R. D. Blevins, Formulas for Natural Frequency and Mode Shape, 1979, table 8-1.

    Examples
    --------
    >>> beam = cantilever_with_stop()
    >>> (beam.natural_frequencies / (2 * np.pi)).round(3).tolist()
    [9.313, 58.365, 163.424]
    >>> mass = 7800.0 * 0.3 * 0.02 * 1e-3
    >>> float(round(mass * beam.modal().mobility[0, 0], 9))  # over the struck mass
    12.0
    """
    return _beam("clamped-free", locals())


@checked
@sharing(_OF_BEAMS)
def clamped_beam_with_stop(
    *,
    length: float = 0.5,
    width: float = 0.025,
    thickness: float = 3e-3,
    youngs_modulus: float = 2.1e11,
    density: float = 7800.0,
    damping_ratio: float = 0.01,
    force: float = 0.0,
    force_at: float = 0.5,
    base_acceleration: float = 20.0,
    frequency: float = 70.0,
    stop_at: float = 0.5,
    gap: float = 0.5e-3,
    restitution: float = 0.6,
    modes: int = 3,
) -> ImpactSystem:
    r"""Return a beam clamped at both ends with a stop: a panel's stiffener, a welded pipe span near a wall.

    Sketch: a strip between two clamps, and next to it a stop; clamps and stop are fixed to one base.

    Notes
    -----
    With restitution, results depend on `modes` and do not converge: see `cantilever_with_stop`. With a stop in the
    middle and a symmetric load, the even modes stay at rest. Left out: stiffening by stretching, which matters for
    deflections as large as the thickness; shear and rotary inertia.

    References
    ----------
    R. D. Blevins, Formulas for Natural Frequency and Mode Shape, 1979, table 8-1.

    Examples
    --------
    >>> beam = clamped_beam_with_stop()
    >>> (beam.natural_frequencies / (2 * np.pi)).round(2).tolist()
    [64.0, 176.43, 345.87]
    >>> beam.stops[0].direction.round(6).tolist()
    [2.936483, 0.0, -2.599692]
    """
    return _beam("clamped-clamped", locals())


@checked
@sharing(_OF_BEAMS)
def clamped_pinned_beam_with_stop(
    *,
    length: float = 0.5,
    width: float = 0.025,
    thickness: float = 3e-3,
    youngs_modulus: float = 2.1e11,
    density: float = 7800.0,
    damping_ratio: float = 0.01,
    force: float = 0.0,
    force_at: float = 0.6,
    base_acceleration: float = 20.0,
    frequency: float = 50.0,
    stop_at: float = 0.6,
    gap: float = 0.5e-3,
    restitution: float = 0.6,
    modes: int = 3,
) -> ImpactSystem:
    r"""Return a beam clamped at its left end and pinned at its right end, with a stop: a propped pipe or shaft.

    Sketch: a strip from a clamp to a hinge, and next to it a stop; clamp, hinge and stop are fixed to one base.

    Notes
    -----
    With restitution, results depend on `modes` and do not converge: see `cantilever_with_stop`. Left out: stiffening by
    stretching, shear and rotary inertia, play in the hinge.

    References
    ----------
    R. D. Blevins, Formulas for Natural Frequency and Mode Shape, 1979, table 8-1.

    Examples
    --------
    >>> (clamped_pinned_beam_with_stop().natural_frequencies / (2 * np.pi)).round(2).tolist()
    [44.11, 142.93, 298.22]
    """
    return _beam("clamped-pinned", locals())


@checked
@sharing(_OF_BEAMS)
def pinned_beam_with_stop(
    *,
    length: float = 1.0,
    width: float = 0.025,
    thickness: float = 5e-3,
    youngs_modulus: float = 2.1e11,
    density: float = 7800.0,
    damping_ratio: float = 0.01,
    force: float = 4.0,
    force_at: float = 0.4,
    base_acceleration: float = 0.0,
    frequency: float = 13.0,
    stop_at: float = 0.5,
    gap: float = 1e-3,
    restitution: float = 0.6,
    modes: int = 3,
) -> ImpactSystem:
    r"""Return a beam pinned at both ends with a stop: a simply supported girder, shaft or pipe that hits something.

    Sketch: a strip between two hinges, and next to it a stop; hinges and stop are fixed to one base.

    Notes
    -----
    With restitution, results depend on `modes` and do not converge: see `cantilever_with_stop`. The frequencies have
    the ratios 1 : 4 : 9, so that internal resonances are exact. Left out: stiffening by stretching, shear and rotary
    inertia.

    References
    ----------
    R. D. Blevins, Formulas for Natural Frequency and Mode Shape, 1979, table 8-1.

    Examples
    --------
    >>> (pinned_beam_with_stop().natural_frequencies / (2 * np.pi)).round(2).tolist()
    [11.76, 47.06, 105.88]
    """
    return _beam("pinned-pinned", locals())


def _beam(ends: str, numbers: Mapping[str, float]) -> ImpactSystem:
    """Return a beam with given end conditions, from the arguments that all four beams share."""
    length, width, thickness = numbers["length"], numbers["width"], numbers["thickness"]
    shapes = beam_modes(ends, int(numbers["modes"]))
    per_length = numbers["density"] * width * thickness
    mass = per_length * length
    rows = moving_row("stop_at", numbers["stop_at"], shapes), shapes.at(numbers["force_at"]), mass * shapes.means
    return ImpactSystem.from_modes(
        frequencies=shapes.hertz(numbers["youngs_modulus"] * width * thickness**3 / 12.0, per_length, length),
        damping_ratios=numbers["damping_ratio"],
        shapes=np.array(rows) / np.sqrt(mass),
        points=["stop", "force", "base"],
        force=Force(
            frequency=numbers["frequency"],
            harmonics={1: {"force": numbers["force"], "base": numbers["base_acceleration"]}},
        ),
        stops=[Stop(direction={"stop": 1.0}, gap=numbers["gap"], restitution=numbers["restitution"], name="stop")],
    )
