"""The matrices of a linear system: their checks, modes, exponentials, and the nearest point in front of its stops."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from functools import lru_cache
from itertools import chain, combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.cells import Floats
from vibroimpact.parameters import SMALLEST, invalid, radians

FEW = 6  # bounds, all of whose sets are tried
KEPT = 256  # sets of matrices whose checks and modes are remembered
COORDINATES = 128  # at most: enough for a bar of finite elements that resolve its waves
TERMS = 18  # of a series: 1/19! is below rounding
ROUNDING = 16.0 * np.finfo(np.float64).eps  # per coordinate: the rounding error of eigenvalues and products of matrices


def numbers(name: str, value: Any, dims: int, kind: type = np.float64) -> NDArray[Any]:
    """Return finite numbers, or a single one, as a read-only array of `dims` dimensions.

    Raises
    ------
    ValueError
        It holds text or truth values, has other dimensions, or has an entry (the message names it) not finite or above
        1e60.
    """
    array: NDArray[Any]
    if type(value) is float and abs(value) <= 1.0 / SMALLEST:
        array = np.array(value, dtype=kind, ndmin=dims)  # a short way, since families have thousands of these
        array.setflags(write=False)
        return array
    what = ("a number", "a list of numbers", "an array of rows of numbers")[dims]
    try:
        entries = np.asarray(value)
        mixed = entries.dtype.kind == "O" and not any(isinstance(entry, (str, bytes, bool)) for entry in entries.flat)
        if not (entries.dtype.kind in "iuf" or mixed or (entries.dtype.kind == "c" and kind is np.complex128)):
            raise TypeError
        array = np.array(entries, dtype=kind, ndmin=dims)
    except (TypeError, ValueError, OverflowError):
        raise invalid(name, value, what, "give rows of equal length, without text") from None
    if not array.size:
        raise ValueError(f"`{name}` must be {what}, got an empty one")
    if entries.ndim not in (0, dims):
        raise ValueError(f"`{name}` must be {what}, got an array of shape {entries.shape}")
    size = np.maximum(np.abs(array.real), np.abs(array.imag))
    if not (size <= 1.0 / SMALLEST).all():
        at = tuple(np.argwhere(~(size <= 1.0 / SMALLEST))[0].tolist())
        entry = f"{name}[{', '.join(map(str, at))}]" if at else name
        raise invalid(entry, array[at].item(), f"a finite number of a size up to {1.0 / SMALLEST:g}")
    array.setflags(write=False)
    return array


def matrices(mass: Any, damping: Any, stiffness: Any) -> dict[str, Floats]:
    """Return the three matrices by name, checked and read-only, since many systems share them."""
    keys = tuple(map(_key, (mass, damping, stiffness)))
    return dict(_remembered(*keys)) if None not in keys else _matrices(mass, damping, stiffness)


def _key(matrix: Any) -> tuple[tuple[int, ...], bytes] | None:
    """Return the key of a float or of an array of floats; None for anything else."""
    if type(matrix) is float:
        return (), struct.pack("d", matrix)
    return (matrix.shape, matrix.tobytes()) if type(matrix) is np.ndarray and matrix.dtype == np.float64 else None


@lru_cache(KEPT)
def _remembered(*keys: Any) -> dict[str, Floats]:
    return _matrices(*(np.frombuffer(entries).reshape(shape) for shape, entries in keys))


def _matrices(mass: Any, damping: Any, stiffness: Any) -> dict[str, Floats]:
    linear = {"mass": _square("mass", mass)}
    n = len(linear["mass"])
    if n > COORDINATES:
        raise ValueError(f"`mass` must be at most {COORDINATES} x {COORDINATES}, got an array of shape {(n, n)}")
    for name, values in {"damping": damping, "stiffness": stiffness}.items():
        matrix = _square(name, values)
        if n > 1 and np.ndim(values) == 0 and not matrix.any():
            matrix = np.zeros((n, n))
        if len(matrix) != n:
            raise ValueError(f"`{name}` must be {n} x {n}, as `mass` is, got an array of shape {np.shape(values)}")
        linear[name] = matrix
    return dict(_checked(n, *(linear[name].tobytes() for name in ("mass", "damping", "stiffness"))))


@lru_cache(KEPT)
def _checked(n: int, *entries: bytes) -> dict[str, Floats]:
    """Return the three matrices, symmetric where they must be, or raise; designs of one family share them."""
    mass, damping, stiffness = (np.frombuffer(part).reshape(n, n) for part in entries)
    mass, stiffness = _checked_symmetric("mass", mass), _checked_symmetric("stiffness", stiffness)
    _check_mass(mass)
    for name, matrix in {"stiffness": stiffness, "damping": symmetric(damping)}.items():
        _check_semidefinite(name, matrix, mass)
    linear = {"mass": mass, "damping": damping, "stiffness": stiffness}
    return {name: np.frombuffer(matrix.tobytes()).reshape(n, n) for name, matrix in linear.items()}


def table_of_modes(frequencies: Any, damping_ratios: Any, shapes: Any) -> tuple[Floats, Floats, Floats]:
    """Return natural angular frequencies in rad/s, damping ratios and mode shapes, checked, from frequencies in Hz."""
    natural, ratios = numbers("frequencies", frequencies, 1), numbers("damping_ratios", damping_ratios, 1)
    ratios = ratios if np.ndim(damping_ratios) else np.full(len(natural), ratios[0])
    table = numbers("shapes", shapes, 2)
    if not len(natural) == len(ratios) == table.shape[1]:
        raise ValueError(
            "`frequencies`, `damping_ratios` and the columns of `shapes` must have equal lengths, one per mode, "
            f"got {len(natural)}, {len(ratios)} and {table.shape[1]}"
        )
    for name, values in {"frequencies": natural, "damping_ratios": ratios}.items():
        if values.min() < 0.0:
            raise invalid(name, values.tolist(), "numbers >= 0")
    return radians(natural), ratios, table


def _square(name: str, values: Any) -> Floats:
    matrix: Floats = numbers(name, values, 2)
    if matrix.shape[0] != matrix.shape[1]:
        raise ValueError(f"`{name}` must be a square array, got one of shape {matrix.shape}")
    return matrix


def _checked_symmetric(name: str, matrix: Floats) -> Floats:
    size = np.sqrt(np.abs(np.outer(np.diag(matrix), np.diag(matrix)))) + np.abs(matrix)
    wrong = np.abs(matrix - matrix.T) > 1e-12 * size
    if wrong.any():
        i, j = np.argwhere(wrong)[0].tolist()
        raise ValueError(
            f"`{name}` must be symmetric, but `{name}[{i}, {j}]` is {matrix[i, j]:.17g} and `{name}[{j}, {i}]` is "
            f"{matrix[j, i]:.17g}"
        )
    return symmetric(matrix)


def _check_mass(mass: Floats) -> None:
    for i, entry in enumerate(np.diag(mass).tolist()):
        if not entry >= SMALLEST:
            raise ValueError(f"`mass` must be positive definite, but `mass[{i}, {i}]` is {entry:g}")
    scale = np.sqrt(np.diag(mass))
    values, vectors = np.linalg.eigh(mass / np.outer(scale, scale))
    if values[0] <= len(mass) * ROUNDING:
        raise ValueError(f"`mass` must be positive definite, but {_worst('mass', mass, vectors[:, 0] / scale)}")


def _check_semidefinite(name: str, matrix: Floats, mass: Floats) -> None:
    for i, entry in enumerate(np.diag(matrix).tolist()):
        if entry < 0.0:
            raise ValueError(f"`{name}` must be positive semidefinite, but `{name}[{i}, {i}]` is {entry:g}")
    shapes, squares = modes(mass, matrix)
    if squares[0] < 0.0:
        part = "the symmetric part of " if name == "damping" else ""
        worst = _worst(name, matrix, shapes[:, 0])
        raise ValueError(f"{part}`{name}` must be positive semidefinite, but {worst}")


def _worst(name: str, matrix: Floats, along: Floats) -> str:
    v = along / along[np.argmax(np.abs(along))]
    return f"v . {name} v is {v @ matrix @ v:.6g} for v = ({', '.join(f'{entry:.4g}' for entry in v)})"


def blocks(*matrices: Floats) -> list[list[int]]:
    """Return the groups of coordinates that no entry of the matrices couples to each other."""
    linked = np.eye(len(matrices[0]), dtype=bool)
    for matrix in matrices:
        linked |= (matrix != 0.0) | (matrix.T != 0.0)
    for _ in linked:
        linked = linked @ linked
    return [np.flatnonzero(row).tolist() for at, row in enumerate(linked) if not row[:at].any()]


def modes(mass: Floats, stiffness: Floats) -> tuple[Floats, Floats]:
    """Return the eigenvectors of (K, M) and the squares of the natural angular frequencies, ascending.

    Groups of coordinates that nothing couples are solved separately, so that the rounding of one does not affect the
    frequencies of another. Squares of the size of rounding are 0; larger negative squares are returned.
    """
    n = len(mass)
    shapes, squares = np.zeros((n, n)), np.empty(n)
    for group in blocks(mass, stiffness):
        inside = np.ix_(group, group)
        shapes[inside], squares[group] = _modes_of_one(mass[inside], stiffness[inside])
    order = np.argsort(squares, kind="stable")
    return shapes[:, order], squares[order]


def _modes_of_one(mass: Floats, stiffness: Floats) -> tuple[Floats, Floats]:
    n = len(mass)
    if n == 1:
        return np.ones((1, 1)), stiffness[0] / mass[0]
    units = [int(np.frexp(np.abs(matrix).max())[1]) for matrix in (mass, stiffness)]  # powers of two do not round
    lower = np.linalg.cholesky(np.ldexp(mass, -units[0]))
    half = np.linalg.solve(lower, np.ldexp(stiffness, -units[1]))
    values, vectors = np.linalg.eigh(symmetric(np.linalg.solve(lower, half.T)))
    values[np.abs(values) <= n * ROUNDING * np.abs(values).max()] = 0.0
    return scaled(np.linalg.solve(lower.T, vectors)), np.ldexp(values, units[1] - units[0])


def scaled(shapes: Floats) -> Floats:
    """Return columns scaled so that their largest entry, the first of equal ones, is 1."""
    size = np.abs(shapes)
    largest = np.argmax(size >= (1.0 - 1e-9) * size.max(axis=0), axis=0)
    columns: Floats = shapes / shapes[largest, np.arange(shapes.shape[1])]
    return columns


def closed(columns: Floats, *maps: Floats) -> Floats:
    """Return an orthonormal basis of the smallest space that contains the unit columns and is closed under the maps."""
    sized = [matrix / (np.abs(matrix).max() or 1.0) for matrix in maps]
    new, basis = columns, np.zeros((len(columns), 0))
    while new.size:
        left, sizes, _ = np.linalg.svd(new - basis @ (basis.T @ new), full_matrices=False)
        new = left[:, sizes > 1e-10]
        basis = np.hstack([basis, new])
        new = np.hstack([matrix @ new for matrix in sized])
    return basis


def symmetric(matrix: Floats) -> Floats:
    """Return the symmetric part of a matrix."""
    part: Floats = 0.5 * (matrix + matrix.T)
    return part


def nearest(mass: Floats, directions: Floats, bounds: Floats) -> Floats | None:
    """Return the q nearest to 0 in the mass metric with `directions` q <= `bounds`; None if there is none."""
    n = len(mass)
    if (bounds >= 0.0).all():
        return np.zeros(n)
    moved = np.linalg.solve(mass, directions.T)
    gram = directions @ moved
    size = np.sqrt(np.diag(gram))
    for active in _possible(mass, directions / size[:, None], bounds / size):
        inside = gram[np.ix_(active, active)]
        if np.linalg.eigvalsh(inside / np.outer(size[active], size[active]))[0] < n * ROUNDING:
            continue  # linearly dependent sets of bounds need not be tried
        q: Floats = np.linalg.solve(inside.T, moved[:, active].T).T @ bounds[active]
        slack = n * ROUNDING * (np.abs(directions) @ np.abs(q) + np.abs(bounds))
        slack[active] = np.inf
        pushed = np.linalg.solve(inside, bounds[active])
        if (pushed <= 0.0).all() and (directions @ q <= bounds + slack).all():
            return q
    return None


def _possible(mass: Floats, directions: Floats, bounds: Floats) -> Iterator[list[int]]:
    """Yield the sets of bounds that may hold the nearest point: all if bounds are few, or the one that does.

    The latter is where x > 0 in the least squares of E x = f, x >= 0, with E = [-(D L^-T)^T; -b^T], f = [0; 1] and
    M = L L^T (Lawson and Hanson, Solving Least Squares Problems, chapter 23).
    """
    if len(bounds) <= FEW:
        sizes = range(1, min(len(mass), len(bounds)) + 1)
        yield from map(list, chain.from_iterable(combinations(range(len(bounds)), size) for size in sizes))
        return
    from scipy.optimize import nnls

    along = np.linalg.solve(np.linalg.cholesky(mass), directions.T)
    weights, _ = nnls(-np.vstack([along, bounds / np.abs(bounds).max()]), np.eye(len(mass) + 1)[-1])
    yield np.flatnonzero(weights).tolist()


def block_matrix(one: Floats, two: Floats, three: Floats, four: Floats) -> Floats:
    """Return [[one, two], [three, four]]; `np.block` takes much longer to inspect its arguments."""
    n, m = one.shape
    whole = np.empty((n + len(three), m + two.shape[1]))
    whole[:n, :m], whole[:n, m:], whole[n:, :m], whole[n:, m:] = one, two, three, four
    return whole


def growth(matrix: Floats) -> Floats:
    """Return exp(`matrix`) - 1 of one matrix or many, also accurate if small: scaled and squared Taylor series."""
    size = float(np.abs(matrix).sum(axis=-2).max(initial=0.0))
    squarings = max(0, math.frexp(size)[1])
    part = matrix * 0.5**squarings
    grown: Floats = part / TERMS
    for j in range(TERMS - 1, 0, -1):
        grown = (part + part @ grown) / j
    with np.errstate(over="ignore", invalid="ignore"):  # backwards in time, against strong damping
        for _ in range(squarings):
            grown = 2.0 * grown + grown @ grown
    return grown
