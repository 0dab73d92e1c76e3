"""What results hold."""

import numpy as np


def special_points(branch, kind):
    """Return the special points of one kind of a branch."""
    return [point for point in branch.special if point.kind == kind]


def names_of_starts(portrait):
    """Return the name of the attractor of every start."""
    meanings = np.array(portrait["attractor"].attrs["flag_meanings"].split())
    return meanings[portrait["attractor"].values + 1]
