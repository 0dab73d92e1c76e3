"""How a model loses energy, and so what its motions settle to: impacts may die out, or last without any loss."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vibroimpact.cells import Floats
from vibroimpact.matrices import ROUNDING, block_matrix, closed
from vibroimpact.model.modal import ModalForm
from vibroimpact.model.oscillator import ImpactOscillator
from vibroimpact.model.system import ImpactSystem
from vibroimpact.motion import MotionClass

APART = ROUNDING**0.5  # half of the digits: of unit vectors, a smaller product is 0

Design = ImpactOscillator | ImpactSystem  # a model at some values of its parameters
LASTING = (MotionClass.PERIODIC, MotionClass.STICKING, MotionClass.CHAOTIC, MotionClass.QUASI_PERIODIC)
CONTINUUM = "motions of constant energy, periodic or not, each one of a continuum; none is an attractor"


def driven(form: ModalForm) -> bool:
    """Return whether a force or a moving stop does work on a system, apart from its free centre."""
    return bool(form.forces[:, ~form.neutral[1]].any() or form.motions.any())


def attracts(osc: Design) -> bool:
    """Return whether impacts or damping shrink areas; otherwise nothing is attracted."""
    return not (osc.stops and lasting_stops(osc).all())


def why_undecided(osc: Design) -> str:
    """Return the reason why some initial conditions lead to no attractor that was found."""
    if not osc.energy_changes:
        return CONTINUUM
    if not attracts(osc):
        return "impacts lose no energy, so that no motion with them attracts others"
    return "neither a cycle nor certain chaos; raise `sample_impacts`"


def lasting_stops(osc: Design) -> NDArray[np.bool_]:
    r"""Return which stops can be struck permanently without any loss.

    They take no energy, and the damping, S = (D + D^T)/2 in mass-normalised modes, takes none from the motion that
    impulses on them excite. Let W be a basis of the smallest space that contains the columns of S and is closed under
    Omega^2 and D^T. Impulses of sizes c, one or several at once, change velocities by B c and excite a motion without
    loss if W^T B c = 0 with B c not 0. In a driven system, impacts on several stops do not stay simultaneous, so only
    impacts on one stop count.
    """
    lossless = np.array([stop.element.lossless for stop in osc.stops], bool)
    if not lossless.any():
        return lossless
    form = osc.modal()
    roots = np.sqrt(form.masses)
    damping = roots[:, None] * form.damping / roots
    kicks = (form.directions / roots)[lossless].T
    kicks = kicks / np.linalg.norm(kicks, axis=0)
    taking = damping + damping.T
    heard = closed(taking / (np.abs(taking).max() or 1.0), np.diag(form.squares), damping.T).T @ kicks
    if driven(form):
        lossless[lossless] = np.linalg.norm(heard, axis=0) <= APART
        return lossless
    silent = _rows(heard, False).T
    together = silent @ _rows(kicks @ silent, True).T
    lossless[lossless] = (np.abs(together) > APART).any(axis=1)
    return lossless


def _rows(matrix: Floats, kept: bool) -> Floats:
    """Return orthonormal rows that span the rows of a matrix, or the space normal to them."""
    _, sizes, rows = np.linalg.svd(matrix)
    rank = int((sizes > APART).sum())
    span: Floats = rows[:rank] if kept else rows[rank:]
    return span


def rest_is_contact(form: ModalForm) -> bool:
    """Return whether stops are in the way of the static equilibrium, or constant loads push a system on permanently."""
    elastic = form.squares > 0.0
    still = np.divide(form.constant, form.squares, where=elastic, out=np.zeros(len(elastic)))
    pushed = form.constant[~elastic & ~form.neutral[1]]
    return bool((pushed != 0.0).any() or (form.directions @ still >= form.gaps).any())


def attracting_kinds(osc: Design) -> NDArray[np.int8]:
    """Return what a motion of each kind settles to.

    The model adds to the rule of `classify`: without a force a mass comes to rest, unless it continues to swing,
    undamped, just clear of the stop; all other motions that still hit are dying out, even if impacts return to within
    1e-7 V.
    """
    forced, damped, touching = _loads(osc)
    settles_to = np.arange(len(MotionClass), dtype=np.int8)
    settles_to[[MotionClass.BUDGET, MotionClass.INTERRUPTED]] = MotionClass.UNDECIDED
    settles_to[MotionClass.DECAYING] = MotionClass.AT_REST if damped or touching else MotionClass.NO_IMPACT
    if not forced:
        settles_to[MotionClass.STUCK_FOREVER] = MotionClass.AT_REST
        settles_to[MotionClass.NO_IMPACT] = MotionClass.AT_REST if damped else MotionClass.NO_IMPACT
        settles_to[[MotionClass.UNDECIDED, *LASTING]] = settles_to[MotionClass.DECAYING]
    return settles_to


def _loads(osc: Design) -> tuple[bool, bool, bool]:
    """Return whether a model is driven, whether all its free motion decays, and whether its rest is a contact;
    a free centre is not counted.
    """
    form = osc.modal()
    n, zero, felt = len(form.squares), np.zeros_like(form.damping), ~form.neutral.ravel()
    flow = block_matrix(zero, np.eye(n), -np.diag(form.squares), -form.damping)[np.ix_(felt, felt)]
    size = np.abs(flow).sum(axis=1).max()
    decays = float(np.linalg.eigvals(flow).real.max()) < -n * ROUNDING * size
    return driven(form), decays, rest_is_contact(form)
