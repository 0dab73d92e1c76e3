"""A small plane of the explorer, and what its listener heard."""

from vibroimpact.explorer.plane import Plane, bands
from vibroimpact.explorer.state import View

SMALL = View(x_range=(1.8, 2.2), y_range=(0.9, 1.1), samples=200)


def received(heard, kind):
    """Return what was heard of one kind."""
    return [content for what, content in heard if what == kind]


def filled(view, side=64):
    """Return a plane of which all cells of one resolution are computed."""
    plane = Plane.unknown(view)
    for part in bands(side):
        plane.fill(*part, lambda: True)
    plane.side = side
    return plane
