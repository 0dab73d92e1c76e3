"""The numbers to meet, and whether they are met."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Result = dict[str, Any]


@dataclass(frozen=True)
class Target:
    """A number that has to lie below `meet`, or above it where `more_is_better`."""

    what: str
    unit: str
    meet: float
    measured: Callable[[Result], float | None]
    try_for: float | None = None
    more_is_better: bool = False

    def judge(self, result: Result) -> Result:
        found = self.measured(result)

        def within(bound: float | None) -> bool | None:
            if found is None or bound is None:
                return None
            return found >= bound if self.more_is_better else found <= bound

        return {
            "what": self.what,
            "unit": self.unit,
            "bound": "at least" if self.more_is_better else "at most",
            "meet": self.meet,
            "try_for": self.try_for,
            "measured": found,
            "met": within(self.meet),
            "surpassed": within(self.try_for),
        }


def _cost(name: str, case: str, figure: str = "ns") -> Callable[[Result], float | None]:
    def look(result: Result) -> float | None:
        row = next(row for row in result["contenders"] if row["name"] == name)
        cost = row["cost"].get(case)
        return None if cost is None else float(cost[figure])

    return look


def _two_threads(result: Result) -> float | None:
    return next((row["speed_up"] for row in result["threads"] if row["threads"] == 2), None)


def _five_maps(result: Result) -> float | None:
    # Smaller maps are another question.
    return result["maps"]["total_seconds"] if result["maps"]["points"] == 200 else None


def _mass_map(result: Result) -> float | None:
    return result["maps"]["without_closing"]["seconds"] if result["maps"]["points"] == 200 else None


def _portrait(result: Result) -> float | None:
    return result["basins_seconds"] if result["maps"]["points"] == 200 else None


def _taking_up(result: Result) -> float | None:
    return result["stores"]["taking_up_s"] if result["stores"]["points"] == 1000 else None


def _gpu_rate(result: Result) -> float:
    return float(result["gpu"]["every_impact"]["impacts_computed_per_s"])


def _over_first_map(name: str) -> Callable[[Result], float | None]:
    def ratio(result: Result) -> float | None:
        found, first = result["startup"][name], result["startup"]["first_map_empty_cache"]
        return found / first if found and first else None

    return ratio


def _found(group: str, name: str) -> Callable[[Result], float | None]:
    return lambda result: result[group][name]


def _system_map(name: str) -> Callable[[Result], float | None]:
    return lambda result: result["systems"][name] if result["systems"]["points"] == 200 else None


ONE = "ours, one core"
TARGETS = (
    Target("time per impact, one core, without early closing, w from 0.05 to 5", "ns", 27, _cost(ONE, "spread"), 20),
    Target("the same, w = 2.8", "ns", 28, _cost(ONE, "chaotic")),
    Target("the same, w = 2", "ns", 18, _cost(ONE, "period-1")),
    Target("certified steps per impact, w from 0.05 to 5", "", 2.0, lambda result: result["steps_an_impact"]),
    Target("time per impact of a single orbit, w = 2.8", "ns", 400, _cost("ours, one orbit", "chaotic")),
    Target("the paper's five maps, two cores, early closing", "s", 3.0, _five_maps),
    Target("the (w, m) map, two cores, without early closing", "s", 4.5, _mass_map),
    Target("largest memory use during these six maps", "MB", 500, _found("maps", "peak_memory_mb")),
    Target("heyoka, one orbit / ours, w = 2.8", "", 105, _cost("heyoka, one orbit", "chaotic", "ratio"), None, True),
    Target("the paper's scheme / ours, w = 2.8", "", 500, _cost("the paper's scheme", "chaotic", "ratio"), None, True),
    Target("speed-up by a second thread", "", 1.9, _two_threads, 1.95, True),
    Target("all indices / Std alone, without early closing", "", 1.6, lambda result: result["all_indices_over_std"]),
    Target("one mass as a system / as an oscillator", "", 1.1, _found("systems", "over_one_mass")),
    Target("heyoka / ours, two masses and two stops", "", 25, _found("systems", "heyoka_over_ours"), None, True),
    Target("cantilever, 4 modes / 1 mode, engine of systems", "", 6, _found("systems", "cantilever_4_over_1")),
    Target("8 equal modes / 1, engine of systems", "", 8, _found("systems", "modes_8_over_1")),
    Target("200 x 200 map of an impact damper, two cores", "s", 60, _system_map("damper_map_seconds")),
    Target("200 x 200 map of one mass between two stops, two cores", "s", 5, _system_map("two_sided_map_seconds")),
    Target(
        "heyoka / ours, one mass and a one-sided spring", "", 20, _found("systems", "heyoka_over_spring"), None, True
    ),
    Target("200 x 200 map of one mass and a one-sided spring, two cores", "s", 30, _system_map("spring_map_seconds")),
    Target("16 stops of which two are struck / two stops", "", 1.5, _found("systems", "stops_16_over_2")),
    Target("200 x 200 map of a tube in four supports, two cores", "s", 60, _system_map("tube_map_seconds")),
    Target("400 x 400 basins, w = 3, two cores", "s", 20, _portrait),
    Target("extra time of a map in a store, relative to memory", "", 0.05, _found("stores", "overhead")),
    Target("opening a finished store of 1e6 cells again", "s", 2.0, _taking_up),
    Target("overhead per tile on a Dask cluster", "ms", 3.0, _found("cluster", "milliseconds_a_tile")),
    Target("speed-up by a second Dask worker", "", 1.8, lambda result: result["cluster"]["speed_up"], None, True),
    Target("import of the engine", "s", 0.45, _found("startup", "import_engine")),
    Target("`vibroimpact --help`", "s", 0.35, _found("startup", "help")),
    Target("first map, kernels in the cache", "s", 1.2, _found("startup", "first_map_warm_cache")),
    Target("compiling the kernels", "s", 15, _found("startup", "kernel_compile")),
    Target("first map of a system / of one mass, empty cache", "", 2.0, _over_first_map("first_map_of_a_system")),
    Target(
        "first verdict on a system / first map of one mass, empty cache",
        "",
        2.5,
        _over_first_map("first_verdict_on_a_system"),
    ),
    Target("first impact section of a system, after a map", "s", 3.0, _found("startup", "section_after_it")),
    Target("a verdict, kernels in the cache", "s", 1.5, _found("startup", "describe")),
    Target("a diagram of 1000 frequencies, kernels in the cache", "s", 2.0, _found("startup", "diagram")),
    Target("impacts per second on a GPU, without early closing", "", 1e9, _gpu_rate, 4e9, True),
)


def judged(result: Result) -> list[Result]:
    return [target.judge(result) for target in TARGETS]
