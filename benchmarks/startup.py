"""What a user waits for before the first result: imports, help, compilation."""

from __future__ import annotations

from statistics import median
from tempfile import TemporaryDirectory

from benchmarks.effort import Effort
from benchmarks.measure import child

IMPORT = "import vibroimpact"
ENGINE = "import vibroimpact as vi; vi.parameter_map"
FIRST_MAP = (
    "import numpy as np, vibroimpact as vi; "
    "vi.parameter_map(vi.ImpactOscillator(), omega=np.linspace(2, 3, 16), sample_impacts=200)"
)
DIAGRAM = (
    "import numpy as np, vibroimpact as vi; "
    "vi.bifurcation_diagram(vi.ImpactOscillator(), omega=np.linspace(0.05, 5, 1000))"
)
BYTECODE = {"PYTHONDONTWRITEBYTECODE": ""}  # written by the first of them, as an installer does
DESCRIBE = ("-m", "vibroimpact", "describe", "-p", "omega=2.6")


def measure(effort: Effort) -> dict[str, float | None]:
    """Return seconds of whole processes, the start of Python included."""

    def seconds(*arguments: str, **environment: str) -> float:
        return median(child(*arguments, **BYTECODE, **environment)[0] for _ in range(effort.rounds))

    empty: list[float] = []
    for _ in range(effort.cold_starts):
        with TemporaryDirectory() as folder:
            empty.append(child("-c", FIRST_MAP, NUMBA_CACHE_DIR=folder)[0])
    warm = seconds("-c", FIRST_MAP)  # this process has filled the cache
    cold = median(empty) if empty else None
    return {
        "python": seconds("-c", "pass"),
        "import": seconds("-c", IMPORT),
        "import_engine": seconds("-c", ENGINE),
        "help": seconds("-m", "vibroimpact", "--help"),
        "first_map_warm_cache": warm,
        "diagram": seconds("-c", DIAGRAM),
        "describe": seconds(*DESCRIBE),
        "first_map_empty_cache": cold,
        "kernel_compile": None if cold is None else cold - warm,
    }
