"""Laws of restitution that any function gives: compiled to C, and called where the table of a cell says.

Kernels are kept on disk and the addresses of functions are those of one process, so that an address is a number of a
cell as others are: below 2^53 it is exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import cfunc, float64, int64, njit, types
from numba.core.errors import NumbaError
from numba.extending import intrinsic

from vibroimpact.kernels.shared.interrupts import uninterrupted

_COMPILED: dict[float, Any] = {}  # by the marks of what was compiled: what is called must not go away


@intrinsic
def _called(typingctx: Any, address: Any, v: Any, number: Any, order: Any) -> Any:
    """Return the value of the C function double(double, double, long) at an address."""

    def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        double, long = ir.DoubleType(), ir.IntType(64)
        kind = ir.FunctionType(double, [double, double, long]).as_pointer()
        place = builder.inttoptr(builder.fptoui(values[0], long), kind)
        return builder.call(place, values[1:])

    return types.float64(types.float64, types.float64, types.float64, types.int64), codegen


@intrinsic
def _read(typingctx: Any, address: Any, index: Any) -> Any:
    """Return a number of a table at an address."""

    def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        place = builder.inttoptr(builder.fptoui(values[0], ir.IntType(64)), ir.DoubleType().as_pointer())
        return builder.load(builder.gep(place, [values[1]]))

    return types.float64(types.float64, types.int64), codegen


@njit(error_model="numpy")
def _entry(address, index):
    return _read(address, index)


@njit(error_model="numpy")
def restitution(rows, z, v, k):
    """Return r of a stop at a speed in steps, and d(r v)/dv; `lawless` notes that a law gave no number from 0 to 1."""
    number = rows[k.restitution + z]
    if rows[k.law + z] == 0.0:
        return number, number
    speed = max(v / rows[k.tick], 1e-300)  # not every law has a value at rest
    r = _called(rows[k.law + z], speed, number, 0)
    slope = _called(rows[k.law + z], speed, number, 1)
    if not 0.0 <= r <= 1.0:
        rows[k.lawless] = 1.0
        return 0.0, 0.0
    return r, r + speed * slope


def address_of(code: float, rule: Callable[[Callable[[Any], Any], Any], Any]) -> float:
    """Return the address of what computes a law, which is compiled when it is first needed; 0.1 to 0.5 s.

    Raises
    ------
    ValueError
        Numba cannot compile it.
    """
    if code not in _COMPILED:
        try:
            inner = _compiled(rule(_compiled, _entry))

            def guarded(v, number, order):
                try:
                    return inner(v, number, order)
                except Exception:
                    return math.nan

            with uninterrupted():
                _COMPILED[code] = cfunc(float64(float64, float64, int64), error_model="numpy")(guarded)
        except (NumbaError, TypeError) as error:
            raise ValueError(
                "`restitution` is a function that numba cannot compile; write it with numbers and `math` alone, and "
                f"numba.njit before functions that it calls: {error}"
            ) from error
    return float(_COMPILED[code].address)


def _compiled(function: Any) -> Any:
    return function if hasattr(function, "py_func") else njit(error_model="numpy")(function)
