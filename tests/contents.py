"""What results hold."""

import numpy as np

import vibroimpact as vi
from vibroimpact.motion import MotionClass, motion_name, refined


def differing(one, other, names=None):
    """Return the variables that have not the same bits and shape in two results."""

    def bits(result, name):
        values = np.asarray(result[name])
        return values.shape, values.tobytes()

    return [name for name in (one.variables if names is None else names) if bits(one, name) != bits(other, name)]


def special_points(branch, kind):
    """Return the special points of one kind of a branch."""
    return [point for point in branch.special if point.kind == kind]


def names_of_starts(portrait):
    """Return the name of the attractor of every start."""
    meanings = np.array(portrait["attractor"].attrs["flag_meanings"].split())
    return meanings[portrait["attractor"].values + 1]


def named(sweep):
    """Return the kind and the name of the motion in the only cell of a map."""
    cell = vi.classify(sweep).isel(omega=0)
    kind = MotionClass(int(refined(cell["motion"].values, cell["status"].values)))
    return kind, motion_name(kind, int(cell["n_periods"]), int(cell["n_impacts"]))
