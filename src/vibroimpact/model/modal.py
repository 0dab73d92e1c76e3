"""The modes of a linear system, in which engines compute its flight, and the scale of its velocities."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from vibroimpact.cells import Floats
from vibroimpact.matrices import KEPT, ROUNDING, block_matrix, blocks, closed, modes, scaled, symmetric

TURNED = 1e-6  # rad: the largest rotation of eigenvectors that counts as rounding
FREE = 0.01  # of the driving frequency: slower modes count as masses without a spring when speeds are estimated


@dataclass(frozen=True, eq=False)
class ModalForm:
    r"""A system in the coordinates of its undamped modes, q = `shapes` eta.

    .. math:: \ddot\eta + D \dot\eta + \Omega^2 \eta = f_0 + \sum_h \mathrm{Im}\left(f_h e^{i h \omega t}\right), \qquad
              u = g + \sum_h \mathrm{Im}\left(d_h e^{i h \omega t}\right) - \alpha \eta

    An impulse P on stop j changes eta' by -P `jumps[j]`, and the clearances' rates by P `directions` @ `jumps[j]`.

    Parameters
    ----------
    shapes : (n, n) array
        Eigenvectors of (K, M) as columns, the largest entry of each being 1; for diagonal M and K, columns of the
        identity. If possible, modes of equal frequency are combined so that damping does not couple them.
    inverse : (n, n) array
        Its inverse: eta = `inverse` q.
    masses : (n,) array
        Modal masses.
    squares : (n,) array
        Omega^2, squares of the natural angular frequencies, ascending; exactly 0 for rigid-body modes.
    damping : (n, n) array
        D, the modal damping over the modal masses (of its row).
    decoupled : bool
        Whether D is diagonal; its other entries are exactly 0 if rounding explains them.
    neutral : (2, n) boolean array
        Which eta and which eta' belong to a free centre. A rigid-body mode that moves no stop's clearance comes first,
        and nothing depends on its eta; nothing depends on its eta' either, if damping couples it to no other mode.
    directions, jumps : (s, n) array
        alpha = a `shapes`, and alpha over the modal masses.
    constant : (n,) array
        f_0, divided by the modal masses like all forces here.
    orders : (H,) integer array
        The orders h of all harmonics of force and stops, ascending.
    forces : (H, n) complex array
        f_h.
    gaps, restitution, stiffness, viscosity : (s,) array
        g; r, NaN for a compliant stop or if r is a law; k and c, zero for a rigid stop.
    motions : (s, H) complex array
        d_h.
    omega : float
        Angular driving frequency.

    Notes
    -----
    Arrays are read-only. With one coordinate, and for each one that neither M nor K couples to another, the numbers are
    those of plain division: k/m, c/m, p/m, a/m. Scaling of mass, force, length or time by powers of two scales all
    numbers exactly.
    """

    shapes: Floats
    inverse: Floats
    masses: Floats
    squares: Floats
    damping: Floats
    decoupled: bool
    neutral: Any
    directions: Floats
    jumps: Floats
    constant: Floats
    orders: Any
    forces: Any
    gaps: Floats
    restitution: Floats
    stiffness: Floats
    viscosity: Floats
    motions: Any
    omega: float

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    def replace(self, force: Any, stops: Any) -> ModalForm:
        """Return the form with the frequency of another force and the numbers of other stops."""
        return replace(self, omega=force.rate, **numbers_of(stops))

    @property
    def mobility(self) -> Floats:
        """G = a M^-1 a^T, (s, s): the changes of the clearances' rates by unit impulses on the stops."""
        mobility: Floats = self.directions @ self.jumps.T
        return mobility

    @property
    def deflections(self) -> Floats:
        r"""The displacements :math:`\sum_{i,h} |\alpha_{ji} f_{hi}|/\Omega_i^2` by static forces, plus the stops' own.

        For modes without a spring, w replaces :math:`\Omega`.
        """
        pushes = np.abs(self.constant) + np.abs(self.forces).sum(axis=0)
        squares = np.where(self.squares > 0.0, self.squares, self.omega**2)
        deflections: Floats = np.abs(self.directions) @ (pushes / squares) + np.abs(self.motions).sum(axis=1)
        return deflections


def numbers_of(stops: Any) -> dict[str, Any]:
    """Return gaps, restitutions, stiffnesses and viscosities of stops; NaN or 0 if a stop has none."""
    laws = np.array([stop.element.coefficients for stop in stops], np.float64).reshape(-1, 2)
    ratios = [math.nan if stop.ratio is None else stop.ratio for stop in stops]
    return {
        "gaps": np.array([stop.gap for stop in stops], np.float64),
        "restitution": np.array(ratios, np.float64),
        "stiffness": laws[:, 0].copy(),
        "viscosity": laws[:, 1].copy(),
    }


def modal_form(mass: Floats, damping: Floats, stiffness: Floats, force: Any, stops: Any) -> ModalForm:
    """Return the modal form of checked matrices with their force and stops."""
    n = len(mass)
    normals = np.array([stop.direction for stop in stops]).reshape(-1, n)
    shapes, masses, squares, coupling, decoupled, neutral = _linear(
        n, *(part.tobytes() for part in (mass, damping, stiffness, normals))
    )
    directions = normals @ shapes
    directions[:, neutral[0]] = 0.0
    orders = sorted({*force.harmonics, *(order for stop in stops for order in stop.motion)})
    zeros = np.zeros(n)
    constant = zeros if force.constant is None else force.constant
    forces = np.array([force.harmonics.get(order, zeros) for order in orders], np.complex128).reshape(-1, n)
    motions = np.array([[stop.motion.get(order, 0.0) for order in orders] for stop in stops], np.complex128)
    return ModalForm(
        shapes=shapes,
        inverse=shapes.T @ mass / masses[:, None],
        masses=masses,
        squares=squares,
        damping=coupling,
        decoupled=decoupled,
        neutral=neutral,
        directions=directions,
        jumps=directions / masses,
        constant=_along(constant, shapes, neutral) / masses,
        orders=np.array(orders, np.int64),
        forces=_along(forces, shapes, neutral) / masses,
        **numbers_of(stops),
        motions=motions.reshape(len(stops), len(orders)),
        omega=force.rate,
    )


def _along(forces: Any, shapes: Floats, neutral: Any) -> Any:
    """Return the modal forces; those that are rounding of forces on a free centre alone are set to 0."""
    modal = forces @ shapes
    if neutral.any():
        modal[np.abs(modal) <= len(shapes) * ROUNDING * (np.abs(forces) @ np.abs(shapes))] = 0.0
    return modal


@lru_cache(KEPT)
def _linear(n: int, *entries: bytes) -> tuple[Floats, Floats, Floats, Floats, bool, Any]:
    """Return the shapes, masses, squares, damping, `decoupled` and `neutral` of a form; families share them."""
    mass, damping, stiffness, directions = (np.frombuffer(part).reshape(-1, n) for part in entries)
    shapes, squares = modes(mass, stiffness)
    shapes, free = _centred(shapes, squares, mass, directions)
    shapes = _parted(shapes, squares, mass, damping, free)
    masses = np.einsum("ji,jk,ki->i", shapes, mass, shapes)
    coupling = shapes.T @ damping @ shapes / masses[:, None]
    coupling[_by_rounding(coupling, damping, shapes, masses, squares, free)] = 0.0
    decoupled = np.count_nonzero(coupling) == np.count_nonzero(np.diag(coupling))
    neutral = np.tile(np.arange(n) < free, (2, 1))
    for _ in range(free):  # a mode that acts on a mode that is not neutral is not neutral either
        neutral[1] &= ~coupling[~neutral[1]].any(axis=0)
    for part in (shapes, masses, squares, coupling, neutral):
        part.setflags(write=False)
    return shapes, masses, squares, coupling, decoupled, neutral


def _centred(shapes: Floats, squares: Floats, mass: Floats, directions: Floats) -> tuple[Floats, int]:
    """Return the modes, combined so that rigid-body modes that move no clearance come first, and their number."""
    rigid = int(np.count_nonzero(squares == 0.0))
    alike = shapes[:, :rigid]
    alike = alike / np.sqrt(np.einsum("ji,jk,ki->i", alike, mass, alike) / mass[0, 0])
    rounding = _admixed(shapes, squares)[:rigid] * (np.abs(directions) @ np.abs(alike))
    approach = directions @ alike
    approach[np.abs(approach) <= rounding] = 0.0
    approach /= np.linalg.norm(directions, axis=1)[:, None]
    free, felt = [], []
    for group in blocks(approach.T @ approach) if rigid else []:
        turned, part = shapes[:, group], approach[:, group]
        _, sizes, turn = np.linalg.svd(part)
        rank = int(np.count_nonzero(sizes > len(squares) * ROUNDING * np.abs(part).max(initial=0.0)))
        if 0 < rank < len(group):
            turned = scaled(alike[:, group] @ turn.T)
        felt.append(turned[:, :rank])
        free.append(turned[:, rank:])
    number = sum(part.shape[1] for part in free)
    return (np.hstack([*free, *felt, shapes[:, rigid:]]) if number else shapes), number


def _admixed(shapes: Floats, squares: Floats) -> Floats:
    """Return the largest angle in rad by which rounding of stiffnesses turns each mode towards elastic ones."""
    n, grouped = len(squares), np.abs(shapes).T @ np.abs(shapes) > 0.0
    largest = np.where(grouped, squares, 0.0).max(axis=1)
    softest = np.where(grouped & (squares > 0.0), squares, np.inf).min(axis=1)
    angles: Floats = np.minimum(n * ROUNDING * (1.0 + largest / softest), TURNED)
    return angles


def _parted(shapes: Floats, squares: Floats, mass: Floats, damping: Floats, free: int) -> Floats:
    """Return the modes, those of equal frequency combined so that symmetric damping does not couple them.

    The first `free` ones, which move no stop's clearance, are not combined with the others.
    """
    shapes, n = shapes.copy(), len(squares)
    starts = sorted({0, free, *(np.flatnonzero(np.diff(squares) > n * ROUNDING * squares[1:]) + 1).tolist(), n})
    for low, high in pairwise(starts):
        alike = shapes[:, low:high]
        coupling, masses = alike.T @ damping @ alike, alike.T @ mass @ alike
        rounding = n * ROUNDING * (np.abs(alike).T @ np.abs(damping) @ np.abs(alike))
        coupled = (np.abs(coupling - np.diag(np.diag(coupling))) > rounding).any()
        if coupled and (np.abs(coupling - coupling.T) <= rounding).all():
            turned, _ = modes(np.diag(np.diag(masses)), symmetric(coupling))
            shapes[:, low:high] = scaled(alike @ turned)
    return shapes


def _by_rounding(coupling: Floats, damping: Floats, shapes: Floats, masses: Floats, squares: Floats, free: int) -> Any:
    """Return the mask of modal damping that rounding explains, off the diagonal and for the `free` modes on it.

    There is rounding of the products and of the eigenvectors. If the squares of two modes of one group of coordinates
    differ by some fraction of the group's largest square, rounding turns one into the other by rounding / fraction.
    """
    n, size = len(masses), np.abs(shapes)
    products = size.T @ np.abs(damping) @ size / masses[:, None]
    grouped = size.T @ size > 0.0
    largest = np.where(grouped, squares, 0.0).max(axis=1)[:, None]
    distances = np.abs(squares[:, None] - squares)
    resolved = grouped & (distances > n * ROUNDING * largest)
    turned = np.divide(n * ROUNDING * largest, distances, where=resolved, out=np.zeros((n, n)))
    rates = np.diag(coupling)
    balance = np.sqrt(masses / masses[:, None])  # of each row to its own mass
    by_turning = np.minimum(turned, TURNED) * np.abs(rates[:, None] - rates) * balance
    apart_or_free = ~np.eye(n, dtype=bool) | (np.arange(n) < free)
    return (np.abs(coupling) <= n * ROUNDING * products + by_turning) & apart_or_free


def velocity_scale(form: ModalForm) -> float:
    """Return the scale V > 0 of the rates of the clearances; `ImpactSystem.velocity_scale` gives the formula."""
    omega = np.array([form.omega])
    return float(velocity_scales(*speed_parts(form, omega), omega, form.gaps[None])[0])


def velocity_scales(driven: Floats, rate: Floats, offset: Floats, omega: Floats, gaps: Floats) -> Floats:
    """Return the velocity scales of several systems from their `speed_parts` and gaps, one row each."""
    speeds = np.maximum(driven, rate * np.abs(gaps - offset)).max(axis=1, initial=0.0)
    still = omega * np.abs(gaps).max(axis=1, initial=0.0)
    scales: Floats = np.where(speeds > 0.0, speeds, np.where(still > 0.0, still, 1.0))
    return scales


def speed_parts(form: ModalForm, omegas: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the parts of V at each frequency, one number per stop.

    They are the speed that force and motion cause, the factor from a clearance to a speed, and the displacement towards
    the stop in equilibrium, by which the clearance is smaller than the gap.
    """
    elastic = form.squares >= (FREE * omegas[:, None]) ** 2
    entries = form.directions, form.masses, form.squares, form.damping
    linked, struck = _linked(len(form.masses), *(part.tobytes() for part in entries)), np.diag(form.mobility)
    pushes = [np.where(elastic, 0.0, form.constant) / omegas[:, None]]
    for order, force in zip(form.orders, form.forces, strict=True):
        pushes.append(force / np.sqrt(np.where(elastic, form.squares, (order * omegas[:, None]) ** 2)))
    unit = _power_of_two(form.masses.max())
    roots = np.sqrt(form.masses / unit)
    pushed = sum(_sizes(linked.T, roots * push) for push in pushes) * np.sqrt(unit * struck)
    moved = _each(np.abs(form.motions), form.orders * omegas[:, None])
    shares = form.directions * form.jumps
    sprung = np.where(elastic[:, None], 0.0, shares).sum(axis=2) <= len(form.squares) * ROUNDING * struck
    squares = np.where(elastic, form.squares, np.inf)[:, None]
    offset = (form.directions * form.constant / squares).sum(axis=2)
    soft = (shares / squares).sum(axis=2)
    rate = np.sqrt(np.divide(struck, soft, where=sprung, out=np.zeros_like(soft)))
    return np.maximum(pushed, moved), rate, offset


def _each(matrix: Any, columns: Any) -> Any:
    """Return the product of a matrix with each of the columns, which are stored as rows here."""
    return (matrix @ columns[..., None])[..., 0]


def _sizes(matrix: Floats, columns: Any) -> Floats:
    """Return the lengths of the products of a matrix with each of the columns, as a column."""
    products = _each(matrix, columns)
    squares = [part[:, None] @ part[..., None] for part in (products.real, products.imag)]
    lengths: Floats = np.sqrt(squares[0] + squares[1])[..., 0]
    return lengths


@lru_cache(KEPT)
def _linked(n: int, *entries: bytes) -> Floats:
    """Return orthonormal directions, in mass-normalised modes, that interact with a stop's clearance.

    They span the smallest space that contains the stops' directions and is closed under Omega^2 and D^T.
    """
    directions, masses, squares, coupling = map(np.frombuffer, entries)
    roots = np.sqrt(masses / _power_of_two(masses.max()))
    if not len(directions):
        return np.zeros((n, 0))
    damping = (roots[:, None] * coupling.reshape(n, n) / roots).T
    new = (directions.reshape(-1, n) / roots).T
    basis = closed(new / np.linalg.norm(new, axis=0), np.diag(squares), damping)
    return np.eye(len(roots)) if basis.shape[1] >= len(roots) else basis


def _power_of_two(size: float) -> float:
    """Return the power of two near a size; numbers divided by it have the same digits in any unit."""
    return math.ldexp(1.0, math.frexp(size)[1])


def fastest_rates(form: ModalForm, omegas: Floats) -> Floats:
    """Return the largest rate in 1/s of free motion or of a harmonic, at each frequency."""
    acting = form.orders[(form.forces != 0.0).any(axis=1) | (form.motions != 0.0).any(axis=0)]
    free = _free_rate(form.squares.tobytes(), form.damping.tobytes())
    return np.maximum(free, omegas * max(int(acting.max(initial=1)), 1))


@lru_cache(KEPT)
def _free_rate(*parts: bytes) -> float:
    """Return the largest rate in 1/s of free motion, damped or not."""
    squares, entries = map(np.frombuffer, parts)
    n, unit = len(squares), _power_of_two(math.sqrt(squares.max()) or np.abs(entries).max())
    squared, damping = np.diag(squares / unit / unit), entries.reshape(n, n) / unit
    companion = block_matrix(np.zeros((n, n)), np.eye(n), -squared, -damping)
    return unit * max(float(np.abs(np.linalg.eigvals(companion)).max()), float(np.sqrt(squared.max())))


def steady_motions(
    form: ModalForm, omegas: Floats, forces: Any, motions: Any
) -> tuple[dict[str, Floats], Floats, Floats]:
    r"""Return the steady motion without stops at each frequency, and by how much it decreases the clearances.

    The columns hold the steady motion, and the largest decrease of each clearance by free motion of a given energy. The
    decreases by the steady displacement and by the steady oscillation follow, NaN if there is no steady motion.

    Modes without stiffness that damping does not couple to others may drift in addition. Let B be the set of those that
    damping couples, or that it brakes under a constant load. They keep :math:`c = \dot\eta_B + D_B \eta` constant: with
    :math:`\beta = D_{BB}^{-T} \alpha_B` they reduce a clearance by :math:`\beta (c - \dot\eta_B - D_{Be} \eta_e)`, and
    slide at :math:`D_{BB}^{-1} f_B`.
    """
    n, highest = forces.shape
    sprung = form.squares > 0.0
    coupled = (form.damping != 0.0) & ~np.eye(n, dtype=bool)
    loaded = (np.diag(form.damping) > 0.0) & (form.constant != 0.0)
    slides = ~sprung & (coupled.any(axis=0) | coupled.any(axis=1) | loaded)
    brakes = form.damping[np.ix_(slides, slides)]
    amplitudes = np.zeros((len(omegas), n, highest), complex)
    slide, sliding = np.zeros(n), np.zeros_like(form.directions)
    try:
        slide[slides] = np.linalg.solve(brakes, form.constant[slides])
        sliding[:, slides] = np.linalg.solve(brakes.T, form.directions[:, slides].T).T
    except np.linalg.LinAlgError:
        slide[:] = np.nan
    for order in form.orders.tolist():
        rate = order * omegas[:, None, None]
        stiffness = np.eye(n) * (form.squares - rate**2) + 1j * rate * form.damping
        amplitudes[..., order - 1] = _solved(stiffness, forces[:, order - 1])
    static = np.divide(form.constant - form.damping @ slide, form.squares, where=sprung, out=np.zeros(n))
    still, swung = form.directions @ static, np.abs(motions - form.directions @ amplitudes).sum(axis=2)
    exists = np.isfinite(swung).all(axis=1) & np.isfinite(amplitudes).all(axis=(1, 2)) & np.isfinite(still).all()
    effective = (form.directions - sliding @ form.damping)[:, sprung]
    give = effective**2 @ (1.0 / (form.masses * form.squares)[sprung]) + sliding**2 @ (1.0 / form.masses)
    nearing = form.directions @ slide > n * ROUNDING * (np.abs(form.directions) @ np.abs(slide))
    still[nearing] = np.inf
    waves = np.stack([amplitudes.real, amplitudes.imag], -1).reshape(len(omegas), -1)
    steady = np.column_stack([np.tile(static, (len(omegas), 1)), waves])
    parts = {"steady": steady, "give": give, "slide": slide, "sliding": sliding.ravel()}
    columns = {name: np.where(exists[:, None], values, 0.0) for name, values in parts.items()}
    undefined = np.where(exists, 0.0, np.nan)[:, None]
    return columns, still + undefined, swung + undefined


def _solved(matrices: Any, column: Any) -> Any:
    """Return the solutions of equations with one right-hand side; NaN for a singular matrix."""
    try:
        return np.linalg.solve(matrices, np.tile(column, (len(matrices), 1))[..., None])[..., 0]
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.full((1, len(column)), np.nan)
        return np.concatenate([_solved(matrix[None], column) for matrix in matrices])
