"""The damper of a compliant stop and the restitution of its contacts, each from the other."""

from __future__ import annotations

import math

from vibroimpact.contact.rules import decrement
from vibroimpact.parameters import OF_ONE_MASS, Parameter, critical_damping

LEAST = 1e-12  # the smallest restitution that a damper is given for


def damping_for(restitution: float, stiffness: float, mass: float) -> float:
    r"""Return the damping of a compliant stop whose contacts with a free mass have a wanted restitution.

    .. math:: c = 2 \zeta \sqrt{k m}, \qquad \ln r = -\frac{2 \zeta \arccos \zeta}{\sqrt{1 - \zeta^2}}

    Parameters
    ----------
    restitution : float, 1e-12 to 1
        r, the speed after a contact over that before it; 1 needs no damper, and no damper gives 0.
    stiffness : float, > 0
        k of the stop in N/m.
    mass : float, > 0
        m in kg: the mass that hits the stop, 1/(a . M^-1 a) for a stop of direction a of a system.

    Returns
    -------
    float
        c in N s/m, to rounding.

    Raises
    ------
    ValueError
        A number is out of range.

    Notes
    -----
    A `Stop` releases the mass when its force has fallen to zero. Codes that release at zero penetration let the damper
    pull before; there r is :math:`\exp(-\pi \zeta/\sqrt{1 - \zeta^2})`, and the same r takes less damping: for r = 0.6,
    zeta is 0.160 with that rule and 0.181 here. Springs and loads that act during the contact change r; the stiffer the
    stop, the smaller the change.

    References
    ----------
    T. Schwager and T. Poschel, Coefficient of restitution and linear-dashpot model revisited, Granular Matter 9 (2007)
    465-469.

    Examples
    --------
    >>> c = damping_for(0.6, stiffness=1e6, mass=2.0)
    >>> round(c, 4), round(restitution_of(c, stiffness=1e6, mass=2.0), 12)
    (511.5445, 0.6)
    """
    from scipy.optimize import brentq

    wanted = -math.log(Parameter("restitution", "restitution", low=LEAST, high=1.0).check(restitution))
    # Above zeta = 1, -ln r is 2 n coth n > 2 n, zeta = cosh n.
    zeta = brentq(lambda ratio: decrement(ratio) - wanted, 0.0, math.cosh(0.5 * wanted), xtol=1e-300, rtol=1e-15)
    return float(zeta * _critical(stiffness, mass))


def restitution_of(damping: float, stiffness: float, mass: float) -> float:
    r"""Return the restitution of the contacts of a free mass with a compliant stop: the inverse of `damping_for`.

    .. math:: r = \exp\left(-\frac{2 \zeta \arccos \zeta}{\sqrt{1 - \zeta^2}}\right), \qquad
              \zeta = \frac{c}{2 \sqrt{k m}}

    Parameters
    ----------
    damping : float, >= 0
        c of the stop in N s/m.
    stiffness, mass : float, > 0
        As in `damping_for`.

    Returns
    -------
    float
        r, the same at all speeds, to rounding: that of `kelvin_voigt`.

    Raises
    ------
    ValueError
        A number is out of range.

    Examples
    --------
    >>> round(restitution_of(400.0, stiffness=1e6, mass=1.0), 12)
    0.571740027585
    """
    return math.exp(-decrement(OF_ONE_MASS["damping"].check(damping) / _critical(stiffness, mass)))


def _critical(stiffness: float, mass: float) -> float:
    return critical_damping(OF_ONE_MASS["stiffness"].check(stiffness), OF_ONE_MASS["mass"].check(mass))
