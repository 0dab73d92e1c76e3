"""Named tuples in memory, handed on by their address.

By value every call names each of some 80 fields, and arrays have seven each: a third of the time of compiling.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, models, register_model


class Held(types.Type):
    """The type of the address of a named tuple."""

    def __init__(self, of: Any) -> None:
        self.of = of
        super().__init__(f"held({of})")


@register_model(Held)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, manager.lookup(kind.of).get_value_type().as_pointer())


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


@intrinsic
def held(typing: Any, value: Any) -> Any:
    """Return the address of a named tuple, valid until the function that asks for it returns."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return cgutils.alloca_once_value(builder, args[0])

    return Held(value)(value), codegen
