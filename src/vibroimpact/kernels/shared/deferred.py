"""Parts of kernels that are compiled when they are first called, and kept by themselves.

What a model never does is never compiled, and what several kernels do is compiled once. A kernel holds of such a part
its name and the types that it is called with, and asks for its address when it first comes to the call.
"""

from __future__ import annotations

import ctypes
import hashlib
import inspect
import os
import pickle
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any

from llvmlite import binding, ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from vibroimpact.kernels.shared.held import Held
from vibroimpact.kernels.shared.interrupts import uninterrupted, within_kernels
from vibroimpact.kernels.shared.machine import cache_folder, compiled

ASK = "vibroimpact_address"  # what kernels call to learn an address
_ADDRESS, _LENGTH = ir.IntType(8).as_pointer(), ir.IntType(64)


def deferred(
    what: str, seconds: float, returns: Any = types.none, *, by_kind: bool = False
) -> Callable[[Callable[..., Any]], Any]:
    """Compile a part of kernels when it is first called: `what` it computes and in how many seconds is announced.

    `returns` is the type of what it returns, as its callers are compiled before. The part is compiled once, whichever
    fields of a held tuple are known to be False, or `by_kind` for each set of them, without their code.
    """

    def general(kind: Any) -> Any:
        return Held(kind.of) if isinstance(kind, Held) and not by_kind else types.unliteral(kind)

    def part(function: Callable[..., Any]) -> Any:
        place = function.__module__, function.__name__

        def define(typing: Any, *arguments: Any) -> Any:
            signature = returns(*map(general, arguments))
            return signature, partial(_call, pickle.dumps((*place, signature)))

        called_with = inspect.signature(function)
        context = inspect.Parameter("typing", inspect.Parameter.POSITIONAL_ONLY)
        parameters = [context, *called_with.parameters.values()]
        define.__signature__ = called_with.replace(parameters=parameters)  # type: ignore[attr-defined]
        define.__name__ = function.__name__
        called: Any = intrinsic(define)
        called.part = compiled(what, seconds)(function)  # what Python calls
        called.general = not by_kind
        return called

    return part


def _call(request: bytes, context: Any, builder: Any, signature: Any, values: Any) -> Any:
    """Emit a call of a part, whose address is asked for where it is not yet known."""
    _note(request)
    kind = context.call_conv.get_function_type(signature.return_type, signature.args)
    address = cgutils.add_global_variable(builder.module, _ADDRESS, "address_of_part")
    address.linkage, address.initializer = "internal", _ADDRESS(None)
    with builder.if_then(cgutils.is_null(builder, builder.load(address)), likely=False):
        ask = cgutils.get_or_insert_function(builder.module, ir.FunctionType(_ADDRESS, [_ADDRESS, _LENGTH]), ASK)
        words = context.insert_const_bytes(builder.module, request)
        builder.store(builder.call(ask, [words, _LENGTH(len(request))]), address)
    part = builder.bitcast(builder.load(address), kind.as_pointer())
    result = cgutils.alloca_once_value(builder, cgutils.get_null_value(kind.args[0].pointee))
    failure = cgutils.alloca_once(builder, kind.args[1].pointee)  # nothing in kernels raises
    arguments = context.call_conv._get_arg_packer(signature.args).as_arguments(builder, values)
    builder.call(part, [result, failure, *arguments])
    return context.get_returned_value(builder, signature.return_type, builder.load(result))


def _address(words: int, size: int) -> int:
    """Return the address of the part that a kernel asks for; without it nothing can go on."""
    try:
        with uninterrupted():
            return compile_part(ctypes.string_at(words, size))
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(70)


within_kernels.append(_address.__code__)
_callback = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)(_address)
binding.add_symbol(ASK, ctypes.cast(_callback, ctypes.c_void_p).value)


@cache
def compile_part(request: bytes) -> int:
    """Compile what a kernel asks for, or find it in the cache; return its address."""
    module, name, signature = pickle.loads(request)
    part = getattr(import_module(module), name).part
    part.compile(signature)
    overload = part.overloads[signature.args]
    return int(overload.library.get_pointer_to_function(overload.fndesc.llvm_func_name))


# What kernels that were compiled may ask for, so that it can be compiled beforehand: a file each


def _note(request: bytes) -> None:
    path = Path(cache_folder(), f"{hashlib.sha256(request).hexdigest()[:16]}.part")
    written = path.with_suffix(f".{os.getpid()}")  # others may read the path at any moment
    with suppress(OSError):
        written.write_bytes(request)
        written.replace(path)


def noted() -> list[bytes]:
    """Return all that kernels in the cache may ask for, in the order in which it was noted."""
    paths = sorted(Path(cache_folder()).glob("*.part"), key=lambda path: path.stat().st_mtime)
    return [path.read_bytes() for path in paths]


def is_general(request: bytes) -> bool:
    """Return whether a part is compiled once for all models, so that whoever may ask for it most likely does."""
    module, name, _ = pickle.loads(request)
    return bool(getattr(import_module(module), name).general)
