"""What a user waits for before the first result: imports, help, compilation."""

from __future__ import annotations

from statistics import median
from tempfile import TemporaryDirectory

from benchmarks.effort import Effort
from benchmarks.measure import child

IMPORT = "import vibroimpact"
ENGINE = "import vibroimpact as vi; vi.parameter_map"
DIAGRAM = (
    "import numpy as np, vibroimpact as vi; "
    "vi.bifurcation_diagram(vi.ImpactOscillator(), omega=np.linspace(0.05, 5, 1000))"
)
BYTECODE = {"PYTHONDONTWRITEBYTECODE": ""}  # written by the first of them, as an installer does
SMALL_MAP = (
    "import numpy as np, vibroimpact as vi; "
    "vi.parameter_map(vi.ImpactOscillator(), omega=np.linspace(2, 3, 16), sample_impacts=200)"
)
COMMAND = "-m", "vibroimpact"
DESCRIBE = *COMMAND, "describe", "-p", "omega=2.6"
FIRST_MAP = *COMMAND, "map", "--x", "omega=2:3:16", "--sample-impacts", "200"
DAMPER = "--model", "impact_damper", "--sample-impacts", "200"
SYSTEM_MAP = *COMMAND, "map", "--x", "frequency=24:36:16", *DAMPER
SYSTEM_SECTION = *COMMAND, "section", *DAMPER
SYSTEM_VERDICT = *COMMAND, "describe", "--model", "two_sided_oscillator"


def measure(effort: Effort) -> dict[str, float | None]:
    """Return seconds of whole processes, the start of Python included."""

    def seconds(*arguments: str, **environment: str) -> float:
        return median(child(*arguments, **BYTECODE, **environment)[0] for _ in range(effort.rounds))

    def cold(*commands: tuple[str, ...]) -> list[float | None]:
        """Return the seconds of processes one after the other, the first with an empty cache."""
        rounds = []
        for _ in range(effort.cold_starts):
            with TemporaryDirectory() as folder:
                rounds.append([child(*command, NUMBA_CACHE_DIR=folder)[0] for command in commands])
        return [median(times) for times in zip(*rounds, strict=True)] if rounds else [None] * len(commands)

    warm = seconds("-c", SMALL_MAP)  # this process has filled the cache
    (first,) = cold(FIRST_MAP)
    of_system, section = cold(SYSTEM_MAP, SYSTEM_SECTION)
    (verdict,) = cold(SYSTEM_VERDICT)
    return {
        "python": seconds("-c", "pass"),
        "import": seconds("-c", IMPORT),
        "import_engine": seconds("-c", ENGINE),
        "help": seconds("-m", "vibroimpact", "--help"),
        "first_map_warm_cache": warm,
        "diagram": seconds("-c", DIAGRAM),
        "describe": seconds(*DESCRIBE),
        "first_map_empty_cache": first,
        "kernel_compile": None if first is None else first - seconds(*FIRST_MAP),
        "first_map_of_a_system": of_system,
        "section_after_it": section,
        "first_verdict_on_a_system": verdict,
    }
