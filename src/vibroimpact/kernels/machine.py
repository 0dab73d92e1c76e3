"""How kernels are compiled, and what the processor can do and Python cannot express.

Numba's disk cache does not notice a change in a helper of another file, so the cache lies in a folder named
after a hash of all kernel sources: changed sources find an empty folder.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.core import config as _config
from numba.extending import intrinsic
from platformdirs import user_cache_dir


def _import_without_scipy(name: str) -> None:
    """Import a module of Numba's that looks for SciPy's linear algebra: no kernel needs it, and it takes 0.2 s.

    Whoever compiles a matrix product of their own still finds it: SciPy is there, as Numba is then told.
    """
    blas = "scipy.linalg.cython_blas"
    if name in sys.modules or blas in sys.modules:
        return
    sys.modules[blas] = None  # type: ignore[assignment]
    try:
        import_module(name).__dict__["_HAVE_BLAS"] = True
    finally:
        del sys.modules[blas]


_import_without_scipy("numba.np.arraymath")

# Numba fills its settings in at run time, unseen by type checkers.
config: Any = _config


@intrinsic
def next_ticket(typingctx: Any, counter: Any) -> Any:
    """Return `counter[0]` and add one to it, at one stroke."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, args[0])
        return builder.atomic_rmw("add", array.data, ir.Constant(ir.IntType(64), 1), "monotonic")

    return types.int64(counter), codegen


@cache
def cache_folder() -> str:
    """Return the folder of compiled kernels; `NUMBA_CACHE_DIR` moves it."""
    sources = sorted(Path(__file__).parent.rglob("*.py"))
    key = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]
    root = os.environ.get("NUMBA_CACHE_DIR") or user_cache_dir("vibroimpact", appauthor=False)
    return str(Path(root) / f"kernels-{key}")


def inner(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function that compiled ones call: wrappers for Python would take a third of the compiler's time.

    Called from Python, as tests and the simulator of CUDA do, it gets a wrapper then.
    """
    if function is None:
        return partial(inner, **options)
    bare: Any = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    made: Any = njit(**bare, **options)(function)
    made._insert = lambda *overload: None  # Python finds no entry: one without a wrapper leads to address 0
    wrapped = cache(lambda: njit(error_model="numpy")(lambda *arguments: made(*arguments)))
    made._compile_for_args = lambda *arguments: wrapped()(*arguments)
    return made


WHOLE = 6755399441055744.0  # 1.5 * 2^52: adding and taking it away again rounds to a whole number


@inner(forceinline=True)
def whole(x):
    """Return the whole number that is nearest."""
    return (x + WHOLE) - WHOLE


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
