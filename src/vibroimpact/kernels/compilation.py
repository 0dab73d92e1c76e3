"""How kernels are compiled and where the compiled code is kept.

Numba's disk cache does not notice a change in a helper of another file, so the cache lies in a folder named
after a hash of all kernel sources: changed sources find an empty folder.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from numba import njit
from numba.core import config as _config
from platformdirs import user_cache_dir

# Numba fills its settings in at run time, unseen by type checkers.
config: Any = _config


@cache
def cache_folder() -> str:
    """Return the folder of compiled kernels; `NUMBA_CACHE_DIR` moves it."""
    sources = sorted(Path(__file__).parent.glob("*.py"))
    key = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]
    root = os.environ.get("NUMBA_CACHE_DIR") or user_cache_dir("vibroimpact", appauthor=False)
    return str(Path(root) / f"kernels-{key}")


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
