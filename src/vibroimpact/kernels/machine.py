"""How kernels are compiled, and what the processor can do and Python cannot express.

Numba's disk cache does not notice a change in a helper of another file, so the cache lies in a folder named
after a hash of all kernel sources: changed sources find an empty folder.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.core import config as _config
from numba.extending import intrinsic
from platformdirs import user_cache_dir

REGISTERS = 2
# Lanes a register: eight doubles in 512 bits, where the processor has them; LLVM splits them where it has not.
WIDTH = 8
BLOCK = REGISTERS * WIDTH  # lanes that are stepped together
# Numba fills its settings in at run time, unseen by type checkers.
config: Any = _config


@intrinsic
def fma(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    """Return a b + c with one rounding."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
        return builder.fma(*args)

    return types.float64(types.float64, types.float64, types.float64), codegen


@intrinsic
def select(typingctx: Any, condition: Any, yes: Any, no: Any) -> Any:
    """Return `yes` where the condition holds, else `no`; both are evaluated, neither may matter untaken."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
        return builder.select(*args)

    return types.float64(types.boolean, types.float64, types.float64), codegen


@intrinsic
def next_ticket(typingctx: Any, counter: Any) -> Any:
    """Return `counter[0]` and add one to it, at one stroke."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, args[0])
        return builder.atomic_rmw("add", array.data, ir.Constant(ir.IntType(64), 1), "monotonic")

    return types.int64(counter), codegen


def each_lane(step: Any) -> Any:
    """Return a function (lanes, transient, total) that calls `step(lanes, i, transient, total)` for a block of lanes i.

    A certified step is one long chain of dependent operations: with one register of lanes the processor waits for
    itself; two registers in turns cost a quarter less. LLVM makes such a loop where the loop's metadata request it;
    numba has no way to write them, so the loop is built here.
    """

    @intrinsic
    def loop(typingctx: Any, lanes: Any, transient: Any, total: Any) -> Any:
        def codegen(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
            index = context.get_value_type(types.intp)
            before = builder.block
            body, after = builder.append_basic_block("lane"), builder.append_basic_block("lanes.end")
            builder.branch(body)
            builder.position_at_end(body)
            i = builder.phi(index)
            function = types.Dispatcher(step)
            call = function.get_call_type(context.typing_context, (lanes, types.intp, transient, total), {})
            context.get_function(function, call)(builder, (args[0], i, *args[1:]))
            following = builder.add(i, index(1))
            i.add_incoming(index(0), before)
            i.add_incoming(following, builder.block)
            again = builder.cbranch(builder.icmp_unsigned("<", following, index(BLOCK)), body, after)
            again.set_metadata("llvm.loop", _request(builder.module))
            builder.position_at_end(after)
            return context.get_dummy_value()

        return types.void(lanes, transient, total), codegen

    return loop


def _request(module: ir.Module) -> Any:
    def wish(name: str, *value: int) -> Any:
        return module.add_metadata([ir.MetaDataString(module, name), *(ir.IntType(32)(number) for number in value)])

    wishes = (
        wish("llvm.loop.vectorize.width", WIDTH),
        wish("llvm.loop.interleave.count", REGISTERS),
        wish("llvm.loop.unroll.disable"),  # or so short a loop is unrolled before it can be vectorised
    )
    request = module.add_metadata(wishes)
    request.operands = (request, *wishes)  # the metadata of a loop begins with itself
    return request


@cache
def cache_folder() -> str:
    """Return the folder of compiled kernels; `NUMBA_CACHE_DIR` moves it."""
    sources = sorted(Path(__file__).parent.rglob("*.py"))
    key = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]
    root = os.environ.get("NUMBA_CACHE_DIR") or user_cache_dir("vibroimpact", appauthor=False)
    return str(Path(root) / f"kernels-{key}")


def inner(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function that only compiled ones call: wrappers for Python take a fifth of the compiler's time.

    The simulator of CUDA calls those of `device` from Python.
    """
    if function is None:
        return partial(inner, **options)
    bare: Any = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    made: Any = njit(**bare, **options)(function)
    # Python finds no entry to call: without these, a call of one that is compiled would jump to address 0.
    made._insert = lambda *overload: None
    made._compile_for_args = partial(_refuse, function.__name__)
    return made


def _refuse(name: str, *args: Any, **kws: Any) -> None:
    raise TypeError(f"`{name}` is called by compiled functions only; `{name}.py_func` is the Python function")


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a driver of kernels without the interpreter lock, cached on disk where that can be written."""
    kept = config.CACHE_DIR
    config.CACHE_DIR = cache_folder()
    try:
        return njit(nogil=True, error_model="numpy", cache=True)(function)
    except RuntimeError:  # no folder to write to: compile anew in each process
        return njit(nogil=True, error_model="numpy")(function)
    finally:
        config.CACHE_DIR = kept
