"""How kernels are compiled, and what the processor can do and Python cannot express.

Numba's disk cache does not notice a change in a helper of another file, so the cache lies in a folder named
after a hash of all kernel sources: changed sources find an empty folder.
"""

from __future__ import annotations

import gc
import hashlib
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.core import config as _config
from numba.core.codegen import JITCodeLibrary
from numba.core.event import Event, Listener, register
from numba.extending import intrinsic
from platformdirs import user_cache_dir

from vibroimpact import compiling
from vibroimpact.kernels.shared.claims import claim_what_is_missing
from vibroimpact.kernels.shared.held import Pruning


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
    sources = sorted(Path(__file__).parents[1].rglob("*.py"))
    key = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]
    root = os.environ.get("NUMBA_CACHE_DIR") or user_cache_dir("vibroimpact", appauthor=False)
    return str(Path(root) / f"kernels-{key}")


# Kernels allocate nothing, and count no references to their arguments: a quarter of the time of a system's steps.
BARE: Any = {"error_model": "numpy", "_nrt": False}


class _Part(JITCodeLibrary):
    """What LLVM is given of a function that only others call, which may hold a copy of it and are optimised after it.

    `hints` are attributes of LLVM's that say how.
    """

    hints: tuple[str, ...] = ()

    def _optimize_functions(self, module: Any) -> None:
        super()._optimize_functions(module)
        for function in module.functions:
            for hint in () if function.is_declaration else self.hints:
                function.add_function_attribute(hint)

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True


def _compiler(*hints: str) -> type[Pruning]:
    """Return the compiler of parts with such hints."""
    library = type("_HintedPart", (_Part,), {"hints": hints})

    class PartCompiler(Pruning):
        def __init__(self, typing: Any, target: Any, _: Any, *rest: Any) -> None:
            super().__init__(typing, target, library(target.codegen(), "part"), *rest)
            self.state.flags.no_compile = True

    return PartCompiler


_PartCompiler = _compiler()


def inner(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function that compiled ones call: what Python needs takes almost half of the compiler's time.

    One that is called often is compiled into its callers (`forceinline`): a call hands a whole layout on the stack.

    Where Python calls it after all, as tests and the simulator of CUDA do, it is compiled once more for that.
    """
    if function is None:
        return partial(inner, **options)
    part = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": _PartCompiler}
    dispatcher: Any = njit(**BARE | part | options)(function)
    compile_one = dispatcher._compiler.compile

    def compile_named(*signature: Any) -> Any:
        """Return the compiled function, which others know by its entry; it needs one, called or not."""
        result = compile_one(*signature)._replace(entry_point=object())
        result.target_context.insert_user_function(result.entry_point, result.fndesc, [result.library])
        return result

    dispatcher._compiler.compile = compile_named
    dispatcher._insert = lambda *overload: None
    callable_one = cache(lambda: njit(error_model="numpy")(function))
    dispatcher._compile_for_args = lambda *arguments, **named: callable_one()  # what Python then calls
    return dispatcher


# Optimised on its own before it becomes a part of others: loops over lanes gain a tenth.
loop = partial(inner, pipeline_class=Pruning)
# Hardly ever called, so that it is made small: nothing else would pay for the time that it takes.
rare = partial(inner, pipeline_class=_compiler("noinline", "cold", "minsize", "optsize"))


@inner
def copy(source, target):
    """Copy a row to the beginning of another: a slice would bring in checks of shapes, two seconds of compiling."""
    for j in range(len(source)):
        target[j] = source[j]


WHOLE = 6755399441055744.0  # 1.5 * 2^52: adding and taking it away again rounds to a whole number


@inner(forceinline=True)
def whole(x):
    """Return the whole number that is nearest."""
    return (x + WHOLE) - WHOLE


# Of each driver: what it computes, in about how many seconds it is compiled, and where it is kept.
_announcements: dict[Any, tuple[str, float, str]] = {}
ONCE, ANEW = "once on this machine", "in each process, as {} cannot be written: NUMBA_CACHE_DIR names another folder"


class _Announcer(Listener):
    """Announces what is compiled, not what the cache holds. No garbage is collected meanwhile: a tenth less time.

    One thread compiles at a time.
    """

    collects = False

    def on_start(self, event: Event) -> None:
        if announcement := _announcements.get(event.data["dispatcher"]):
            if gc.isenabled():
                self.collects = True
                gc.disable()
            compiling.begin(*announcement)

    def on_end(self, event: Event) -> None:
        if event.data["dispatcher"] in _announcements:
            compiling.end()
            if self.collects and not compiling.under_way():
                self.collects = False
                gc.enable()


register("numba:compile", _Announcer())


def compiled(what: str, seconds: float) -> Callable[[Callable[..., Any]], Any]:
    """Compile a driver of kernels without the interpreter lock, cached on disk where that can be written.

    `what` it computes and in about how many seconds it is compiled is announced when that begins.
    """

    def driver(function: Callable[..., Any]) -> Any:
        cache_dir, how = config.CACHE_DIR, BARE | {"nogil": True, "pipeline_class": Pruning}
        config.CACHE_DIR = cache_folder()
        try:
            os.makedirs(cache_folder(), exist_ok=True)  # else Numba takes one where versions mix
            dispatcher = njit(**how, cache=True)(function)
            _announcements[dispatcher] = what, seconds, ONCE
            _mend(dispatcher._cache)
            claim_what_is_missing(dispatcher, cache_folder(), _announcements[dispatcher])
        except (OSError, RuntimeError):  # no folder to write to
            dispatcher = njit(**how)(function)
            _announcements[dispatcher] = what, seconds, ANEW.format(cache_folder())
        finally:
            config.CACHE_DIR = cache_dir
        return dispatcher

    return driver


def _mend(cache: Any) -> None:
    """Let a cache that cannot be read, or no longer be written, be none."""
    load, save = cache.load_overload, cache.save_overload

    def loaded(*what: Any) -> Any:
        try:
            return load(*what)
        except Exception:  # a file cut off or overwritten: whatever unpickling it raises
            with suppress(OSError):
                cache.flush()
            return None

    def saved(*what: Any) -> None:
        with suppress(OSError):
            save(*what)

    cache.load_overload, cache.save_overload = loaded, saved
