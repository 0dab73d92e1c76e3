"""Named tuples in memory, handed on by their address.

By value every call names each of some 80 fields, and arrays have seven each: a third of the time of compiling.
"""

from __future__ import annotations

import ctypes
import struct
from typing import Any

from numba import typeof, types
from numba.core import cgutils, ir
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.ir_utils import build_definitions
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import AttributeTemplate
from numba.core.untyped_passes import RewriteSemanticConstants
from numba.extending import (
    NativeValue,
    infer_getattr,
    intrinsic,
    lower_cast,
    lower_getattr_generic,
    models,
    register_model,
    unbox,
)


class Held(types.Type):
    """The type of the address of a named tuple, some of whose fields may be known to be False."""

    def __init__(self, of: Any, lacks: frozenset[str] = frozenset()) -> None:
        self.of = of
        self.lacks = lacks
        super().__init__(f"held({of}, without {sorted(lacks)})")

    def can_convert_to(self, typing: Any, other: Any) -> Any:
        """Return that this converts to a type of which fewer fields are known to be False."""
        converts = isinstance(other, Held) and other.of == self.of and other.lacks <= self.lacks
        return Conversion.safe if converts else None


@register_model(Held)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, manager.lookup(kind.of).get_value_type().as_pointer())


@lower_cast(Held, Held)
def _forget(context: Any, builder: Any, before: Any, after: Any, address: Any) -> Any:
    return address


@infer_getattr
class _Field(AttributeTemplate):
    key = Held

    def generic_resolve(self, typ: Any, attr: str) -> Any:  # type: ignore[override]
        """Return the type of a field; a tuple within is handed on by its address, too."""
        if attr not in typ.of.fields:
            return None
        field = typ.of[typ.of.fields.index(attr)]
        return Held(field) if isinstance(field, types.BaseNamedTuple) else field


@lower_getattr_generic(Held)
def _load(context: Any, builder: Any, kind: Any, address: Any, name: str) -> Any:
    at = kind.of.fields.index(name)
    place = cgutils.gep_inbounds(builder, address, 0, at)
    if isinstance(kind.of[at], types.BaseNamedTuple):
        return place
    return builder.load(place)


class InMemory:
    """A named tuple of numbers, arrays and named tuples, laid out in memory as kernels read it.

    Taken apart at each call it would cost 17 us, and a second to compile how.
    """

    def __init__(self, value: Any) -> None:
        self._value = value  # its arrays are pointed to
        self._numba_type_ = Held(typeof(value))
        form, numbers = _flattened(value)
        self._memory = ctypes.create_string_buffer(struct.pack("@" + form, *numbers))
        self.address = ctypes.addressof(self._memory)


def _flattened(value: Any) -> tuple[str, list[Any]]:
    """Return the layout of a value in memory, as `struct` has it, and the numbers themselves."""
    if isinstance(value, tuple):
        parts = [_flattened(part) for part in value]
        return "0q" + "".join(form for form, _ in parts) + "0q", [number for _, some in parts for number in some]
    if hasattr(value, "strides"):  # nobody owns it, and nothing is freed with it
        words = [0, 0, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides]
        return f"{len(words)}q", words
    return {bool: "?", int: "q", float: "d"}[type(value)], [value]


@unbox(Held)
def _pointer(kind: Any, placed: Any, c: Any) -> NativeValue:
    """Return the address; the tuple stays in memory as long as its caller holds it."""
    word = c.pyapi.object_getattr_string(placed, "address")
    address = c.pyapi.long_as_voidptr(word)
    c.pyapi.decref(word)
    return NativeValue(c.builder.bitcast(address, c.context.get_value_type(kind)))


def without(*fields: str) -> Any:
    """Return the function that says of a held tuple that these fields are False: their code is then not compiled."""

    @intrinsic
    def lacking(typing: Any, value: Any) -> Any:
        return Held(value.of, value.lacks | {*fields})(value), lambda context, builder, signature, args: args[0]

    return lacking


@register_pass(mutates_CFG=False, analysis_only=False)
class _Lacks(FunctionPass):
    """Write False for fields that are known to be, so that what hangs on them is left out before it is compiled."""

    _name = "fields_known_to_be_false"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        """Return whether something was changed."""
        lacks = {
            name: getattr(kind, "lacks", ()) for name, kind in zip(state.func_ir.arg_names, state.args, strict=False)
        }
        changed = False
        for block in state.func_ir.blocks.values():
            for line in block.find_insts(ir.Assign):
                field = line.value
                if (
                    isinstance(field, ir.Expr)
                    and field.op == "getattr"
                    and field.attr in lacks.get(field.value.name, ())
                ):
                    line.value, changed = ir.Const(False, line.loc), True
        if changed:
            state.func_ir._definitions = build_definitions(state.func_ir.blocks)
        return changed


class Pruning(Compiler):
    """A compiler that leaves out what hangs on fields that are known to be False."""

    def define_pipelines(self) -> Any:
        """Return the usual passes and this one."""
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            pipeline.add_pass_after(_Lacks, RewriteSemanticConstants)
            pipeline.finalize()
        return pipelines
