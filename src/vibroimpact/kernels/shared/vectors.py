"""Many lanes as one value: kernels written for numbers step them too, whatever the shape of what they step.

LLVM makes vectors of a loop over lanes only where it can prove that no row of lanes overlaps another; where rows lie at
places known at run time alone, as for any number of modes and stops, the vectors are written out. `fma` and `select`
take numbers and vectors alike; a lane of a vector has the bits of the number.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from llvmlite.binding import get_host_cpu_features
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

from vibroimpact.kernels.shared.machine import config

# One value is two registers of 512 bits, or of 256, so that what one waits for the other fills; where the processor has
# narrower ones than a value is made for, most of it is spilled.
_HOST = get_host_cpu_features()
LANES = 16 if _HOST.get("avx512f") else 8
# With registers of 256 bits a truth fills a number's place. LLVM packs and unpacks what its own comparisons of two
# registers give, a tenth of all instructions, so AVX is asked for by name.
MASKS = LANES == 8 and bool(_HOST.get("avx")) and config.CPU_NAME is None and config.CPU_FEATURES is None
_NUMBERS = ir.VectorType(ir.DoubleType(), LANES)
_TRUTHS = _NUMBERS if MASKS else ir.VectorType(ir.IntType(1), LANES)
_HALF, _BITS = ir.VectorType(ir.DoubleType(), 4), ir.VectorType(ir.IntType(64), LANES)
_PLACE = ir.IntType(32)
# How AVX names comparisons that are false where either side is no number, and quiet.
_COMPARISONS = {"<": 0x11, "<=": 0x12, ">=": 0x1D, ">": 0x1E, "==": 0x00}


class Vector(types.Type):
    """The type of so many numbers, or truths."""

    def __init__(self, truths: bool) -> None:
        self.truths = truths
        super().__init__("truths" if truths else "numbers")


NUMBERS, TRUTHS = Vector(False), Vector(True)
_SINGLE = types.Float, types.Integer


@register_model(Vector)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _TRUTHS if kind.truths else _NUMBERS)


def _spread(context: Any, builder: Any, value: Any, kind: Any) -> Any:
    """Return a vector; of one number, as often as it has lanes."""
    if isinstance(kind, Vector):
        return value
    value = context.cast(builder, value, kind, types.float64)
    empty = ir.Constant(_NUMBERS, ir.Undefined)
    first = builder.insert_element(empty, value, _PLACE(0))
    return builder.shuffle_vector(first, empty, ir.Constant(ir.VectorType(_PLACE, LANES), [0] * LANES))


def _call(builder: Any, name: str, *values: Any) -> Any:
    kind = ir.FunctionType(_NUMBERS, [_NUMBERS] * len(values))
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64"), values)


def _halves(builder: Any, name: str, result: Any, values: tuple[Any, ...], *more: Any) -> list[Any]:
    """Call an instruction of AVX for each half of the values; `more` follows them."""
    kind = ir.FunctionType(result, [_HALF] * len(values) + [value.type for value in more])
    function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.x86.avx.{name}.256")
    parts = []
    for places in (range(4), range(4, 8)):
        picks = ir.Constant(ir.VectorType(_PLACE, 4), list(places))
        half = [builder.shuffle_vector(value, ir.Constant(value.type, ir.Undefined), picks) for value in values]
        parts.append(builder.call(function, [*half, *more]))
    return parts


def _by_halves(builder: Any, name: str, values: tuple[Any, ...], *more: Any) -> Any:
    """Return the vector that an instruction of AVX makes of both halves of others."""
    parts = _halves(builder, name, _HALF, values, *more)
    return builder.shuffle_vector(*parts, ir.Constant(ir.VectorType(_PLACE, 8), list(range(8))))


def _compare(builder: Any, name: str, a: Any, b: Any) -> Any:
    if not MASKS:
        return builder.fcmp_ordered(name, a, b)
    return _by_halves(builder, "cmp.pd", (a, b), ir.Constant(ir.IntType(8), _COMPARISONS[name]))


def _define(operation: Any, result: Vector, emit: Callable[..., Any], places: int = 2) -> None:
    """Let an operation of Python take vectors of numbers, beside which a single number stands for all lanes."""

    @type_callable(operation)
    def _typed(context: Any) -> Any:
        def resolved(*kinds: Any) -> Any:
            fits = all(kind is NUMBERS or isinstance(kind, _SINGLE) for kind in kinds)
            return result if fits and NUMBERS in kinds and len(kinds) == places else None

        return (lambda a: resolved(a)) if places == 1 else lambda a, b: resolved(a, b)

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return emit(builder, *map(lambda v, k: _spread(context, builder, v, k), values, signature.args))

    singles = (Vector,) if places == 1 else (Vector, *_SINGLE)
    for first in singles:
        for second in singles if places == 2 else (Vector,):
            if Vector in (first, second):
                lower_builtin(operation, *((first, second) if places == 2 else (Vector,)))(lower)


for _operation, _name in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _define(_operation, NUMBERS, lambda builder, a, b, name=_name: getattr(builder, name)(a, b))
for _operation, _name in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
):
    _define(_operation, TRUTHS, lambda builder, a, b, name=_name: _compare(builder, name, a, b))
_define(operator.neg, NUMBERS, lambda builder, a: builder.fneg(a), 1)
_define(abs, NUMBERS, lambda builder, a: _call(builder, "fabs", a), 1)
_define(math.sqrt, NUMBERS, lambda builder, a: _call(builder, "sqrt", a), 1)
_define(math.log, NUMBERS, lambda builder, a: _call(builder, "log", a), 1)


def _logical(operation: Any, name: str) -> None:
    @type_callable(operation)
    def _typed(context: Any) -> Any:
        return lambda a, b: TRUTHS if a is TRUTHS and b is TRUTHS else None

    @lower_builtin(operation, Vector, Vector)
    def _lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        if not MASKS:
            return getattr(builder, name)(*values)
        bits = getattr(builder, name)(*(builder.bitcast(value, _BITS) for value in values))
        return builder.bitcast(bits, _TRUTHS)


_logical(operator.and_, "and_")
_logical(operator.or_, "or_")


@intrinsic
def fma(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    """Return a b + c with one rounding."""
    kinds = a, b, c
    wide = NUMBERS in kinds

    def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        if wide:
            return _call(builder, "fma", *map(lambda v, k: _spread(context, builder, v, k), values, signature.args))
        return builder.fma(*map(lambda v, k: context.cast(builder, v, k, types.float64), values, signature.args))

    return (NUMBERS if wide else types.float64)(*kinds), codegen


@intrinsic
def select(typingctx: Any, condition: Any, yes: Any, no: Any) -> Any:
    """Return `yes` where the condition holds, else `no`; both are evaluated, neither may matter untaken."""
    wide = condition is TRUTHS

    def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        ends = zip(values[1:], signature.args[1:], strict=True)
        if wide:
            yes, no = (_spread(context, builder, v, k) for v, k in ends)
            return (
                _by_halves(builder, "blendv.pd", (no, yes, values[0])) if MASKS else builder.select(values[0], yes, no)
            )
        return builder.select(values[0], *(context.cast(builder, v, k, types.float64) for v, k in ends))

    return (NUMBERS if wide else types.float64)(condition, yes, no), codegen


@intrinsic
def no(typingctx: Any, truth: Any) -> Any:
    """Return the negation of a truth."""

    def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        if truth is TRUTHS and MASKS:
            return builder.bitcast(builder.not_(builder.bitcast(values[0], _BITS)), _TRUTHS)
        return builder.not_(values[0])

    return truth(truth), codegen


@intrinsic
def never(typingctx: Any, number: Any) -> Any:
    """Return a truth that holds nowhere."""
    kind = TRUTHS if number is NUMBERS else types.boolean
    return kind(number), lambda context, builder, signature, values: context.get_constant_null(kind)


def _extreme(name: str, comparison: str) -> Callable[..., Any]:
    """Return the function of two numbers or vectors that gives the first where it compares so, else the second."""

    @intrinsic
    def extreme(typingctx: Any, a: Any, b: Any) -> Any:
        kind = NUMBERS if NUMBERS in (a, b) else types.float64

        def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            if kind is NUMBERS:
                a, b = (_spread(context, builder, v, k) for v, k in zip(values, signature.args, strict=True))
                if MASKS:
                    return _by_halves(builder, f"{name}.pd", (a, b))
            else:
                a, b = (context.cast(builder, v, k, kind) for v, k in zip(values, signature.args, strict=True))
            return builder.select(builder.fcmp_ordered(comparison, a, b), a, b)

        return kind(a, b), codegen

    return extreme


least = _extreme("min", "<")
most = _extreme("max", ">")


# A flat array holds rows of numbers; with None in the place of `wide` one number is meant.


def kind_at(wide: Any) -> Any:
    """Return the type of what lies at a place."""
    return types.float64 if wide in (None, types.none) else NUMBERS


def place_of(context: Any, builder: Any, array: tuple[Any, Any], place: Any, kind: Any) -> Any:
    """Return the place of a value of this type in an array (type and value), from a place on."""
    view = context.make_array(array[0])(context, builder, array[1])
    pointer = builder.gep(view.data, [place])
    return builder.bitcast(pointer, _NUMBERS.as_pointer()) if kind is NUMBERS else pointer


def read(builder: Any, pointer: Any) -> Any:
    """Emit a load from where a value lies, which is aligned as a number is."""
    value = builder.load(pointer)
    value.align = 8
    return value


def write(context: Any, builder: Any, pointer: Any, value: Any, kinds: tuple[Any, Any]) -> None:
    """Emit a store of a value, from its type to that of the place."""
    value = _spread(context, builder, value, kinds[0]) if kinds[1] is NUMBERS else context.cast(builder, value, *kinds)
    builder.store(value, pointer).align = 8


@intrinsic
def put_at(typingctx: Any, array: Any, place: Any, wide: Any, value: Any) -> Any:
    """Store numbers from a place on, or the one number there."""
    kind = kind_at(wide)

    def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        pointer = place_of(context, builder, (array, values[0]), values[1], kind)
        write(context, builder, pointer, values[3], (value, kind))
        return context.get_dummy_value()

    return types.none(array, types.intp, wide, value), codegen


@intrinsic
def get(typingctx: Any, array: Any, row: Any, wide: Any) -> Any:
    """Return a row's numbers, or the one number."""
    kind = kind_at(wide)

    def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return read(builder, place_of(context, builder, (array, values[0]), _first(builder, values[1], kind), kind))

    return kind(array, types.intp, wide), codegen


@intrinsic
def put(typingctx: Any, array: Any, row: Any, wide: Any, value: Any) -> Any:
    """Store a row's numbers, or the one number."""
    kind = kind_at(wide)

    def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        pointer = place_of(context, builder, (array, values[0]), _first(builder, values[1], kind), kind)
        write(context, builder, pointer, values[3], (value, kind))
        return context.get_dummy_value()

    return types.none(array, types.intp, wide, value), codegen


def _first(builder: Any, row: Any, kind: Any) -> Any:
    """Return the place where a row begins."""
    return builder.mul(row, row.type(LANES), flags=["nsw"]) if kind is NUMBERS else row


@intrinsic
def anywhere(typingctx: Any, truths: Any) -> Any:
    """Return whether something is true in any lane."""

    def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        if truths is not TRUTHS:
            return context.cast(builder, values[0], truths, types.boolean)
        if MASKS:
            bits = builder.or_(*_halves(builder, "movmsk.pd", ir.IntType(32), values))
        else:
            bits = builder.bitcast(values[0], ir.IntType(LANES))
        return builder.icmp_unsigned("!=", bits, bits.type(0))

    return types.boolean(truths), codegen
