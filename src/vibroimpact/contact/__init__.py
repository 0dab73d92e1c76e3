"""Laws of restitution: the ratio of the speeds after and before an impact, as a function of the impact speed.

>>> import vibroimpact as vi
>>> stop = vi.Stop(direction=1.0, gap=1e-3, restitution=vi.contact.hunt_crossley(damping=0.2))
>>> round(stop.law(1.5), 6)
0.83287
"""

from vibroimpact.contact.dampers import damping_for, restitution_of
from vibroimpact.contact.laws import LAWS, Law, hunt_crossley, kelvin_voigt, law_of, piecewise

__all__ = ["LAWS", "Law", "damping_for", "hunt_crossley", "kelvin_voigt", "law_of", "piecewise", "restitution_of"]
