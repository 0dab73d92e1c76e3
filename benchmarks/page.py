"""The measurements as tables that read well on a terminal and as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

BEGIN, END = "<!-- begin of measurements, written by `make bench` -->", "<!-- end of measurements -->"
CASE_TITLES = {"chaotic": "w = 2.8", "period-1": "w = 2", "spread": "w 0.05 to 5"}
SHOWN = ("ours, one core", "heyoka, batch", "heyoka, one orbit", "the paper's scheme", "SciPy DOP853, one orbit")
STARTUP_TITLES = {
    "python": "Python alone",
    "import": "`import vibroimpact`",
    "import_engine": "`import vibroimpact as vi; vi.parameter_map`, which loads the engine",
    "help": "`vibroimpact --help`",
    "first_map_warm_cache": "a small map, kernels in the cache",
    "diagram": "a bifurcation diagram of 1000 frequencies, kernels in the cache",
    "describe": "`vibroimpact describe -p omega=2.6`, kernels in the cache",
    "first_map_empty_cache": "a small map, empty cache",
    "kernel_compile": "of which compiling the kernels",
    "first_map_of_a_system": "a small map of a system (an impact damper), empty cache",
    "section_after_it": "an impact section of this system after the map",
    "first_verdict_on_a_system": "a verdict on a system (one mass between two stops), empty cache",
}


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with so many significant digits, without an exponent where possible."""
    if value is None:
        return "-"
    if value != 0 and not 1e-3 <= abs(value) < 1e7:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa}e{int(exponent)}"
    if abs(value) >= 10 ** (digits - 1):
        return f"{float(f'{value:.{digits - 1}e}'):,.0f}"
    return f"{value:.{digits}g}"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table with aligned columns: the first to the left, the others to the right."""
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]

    def line(cells: Sequence[str]) -> str:
        first, *others = [*zip(cells, widths, strict=True)]
        return f"| {' | '.join([first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in others)])} |"

    ruler = [f"{'-' * widths[0]}", *(f"{'-' * (width - 1)}:" for width in widths[1:])]
    return "\n".join([line(head), line(ruler), *map(line, rows)])


def _shared(result: dict[str, Any]) -> str:
    """Return a warning if other work took part of the cores, which makes times unreliable."""
    last = result["threads"][-1]
    if last["cores_got"] > 0.95 * last["threads"]:
        return ""
    return f" **Other work shared the machine: {last['threads']} threads had {number(last['cores_got'])} cores.**"


def _met(row: dict[str, Any]) -> str:
    if row["met"] is None:
        return "not measured"
    return "yes, better than tried for" if row["surpassed"] else "yes" if row["met"] else "no"


def targets(result: dict[str, Any]) -> str:
    def amount(value: float | None, unit: str) -> str:
        return f"{number(value)} {unit}".strip() if value is not None else "-"

    return table(
        ["quantity", "target", "tried for", "measured", "met"],
        [
            [
                row["what"],
                f"{row['bound']} {amount(row['meet'], row['unit'])}",
                amount(row["try_for"], row["unit"]),
                amount(row["measured"], row["unit"]),
                _met(row),
            ]
            for row in result["targets"]
        ],
    )


def summary(result: dict[str, Any]) -> str:
    """Return the main results: the cost and the error of a chaotic motion, and how many targets are met."""
    rows = [
        [
            row["name"],
            f"{number(row['cost']['chaotic']['ns'])} ns",
            number(row["cost"]["chaotic"]["ratio"]),
            f"{number(row['error_first_20'], 2)} m/s",
        ]
        for row in result["contenders"]
        if row["name"] in SHOWN and not row["note"]
    ]
    met = [row["met"] for row in result["targets"] if row["met"] is not None]
    return (
        table(["a chaotic motion, w = 2.8", "time per impact", "relative", "error of the first 20 impacts"], rows)
        + f"\n\nOf the [targets](#targets), {sum(met)} of {len(met)} are met."
    )


def costs(result: dict[str, Any]) -> str:
    rows = []
    for row in result["contenders"]:
        found = [row["cost"].get(case) for case in CASE_TITLES]
        figures = [text for cost in found for text in ((number(cost["ns"]), number(cost["ratio"])) if cost else "--")]
        rows.append([row["name"], *([row["note"], *[""] * (2 * len(found) - 1)] if row["note"] else figures)])
    return table(["ns per impact", *(text for title in CASE_TITLES.values() for text in (title, "ratio"))], rows)


def _in_front(row: dict[str, Any]) -> str:
    return "yes" if row["stays_in_front"] else f"no, {number(row['passes_the_stop_by'])} m beyond"


def correctness(result: dict[str, Any]) -> str:
    return table(
        ["contender", "error, first 20", "error, settled", "stays in front of the stop", "sticks, leaves at T/2"],
        [
            [
                row["name"],
                number(row["error_first_20"], 2),
                number(row["error_settled"], 2),
                _in_front(row),
                row["stalls"] or ("yes" if row["sticks_and_leaves"] else "no"),
            ]
            for row in result["contenders"]
            if not row["note"]
        ],
    )


def maps(result: dict[str, Any]) -> str:
    found = result["maps"]
    total = {
        "map": "all five",
        "seconds": found["total_seconds"],
        "impacts_computed": found["total_impacts"],
        "steps_computed": found["total_steps"],
    }
    last = {**found["without_closing"], "map": "omega, mass, without early closing"}

    def line(row: dict[str, Any]) -> list[str]:
        cells = found["points"] ** 2 * (len(found["maps"]) if row is total else 1)
        each = row["impacts_computed"] / cells
        steps = row["steps_computed"] / row["impacts_computed"]
        return [row["map"], number(row["seconds"]), f"{each:.0f}", f"{each / 5100:.1%}", number(steps)]

    head = [f"{found['points']} x {found['points']}, {found['cores']} cores", "s", "impacts per cell", "share of 5100"]
    return table([*head, "steps per impact"], [line(row) for row in [*found["maps"], total, last]])


def growth(result: dict[str, Any], label: str, title: str, rows: list[dict[str, Any]]) -> str:
    body = [[f"{row[label]:,}", number(row["ns"]), number(row["steps_an_impact"])] for row in rows]
    return table([title, "ns per impact", "steps per impact"], body)


def gpu(result: dict[str, Any]) -> str:
    found = result["gpu"]
    rows = [
        [way, *(number(found[key][name]) for name in ("median_s", "impacts_computed_per_s", "impacts_answered_per_s"))]
        for key, way in (("every_impact", "without early closing"), ("early_closing", "with early closing"))
    ]
    title = f"{found['gpu']}, {found['date']}, {found['every_impact']['cells']:,} cells"
    head = [title, "s", "impacts computed per s", "impacts counted per s"]
    return table(head, rows)


def systems(found: dict[str, Any]) -> str:
    """Return the time per impact of systems, one thread, and the time of two of their maps."""
    costs_ = [[name, number(value)] for name, value in found["cost"].items()]
    sides = f"{found['points']} x {found['points']}, 1000 impacts per cell"
    maps_ = [
        [f"impact damper, clearance and frequency, {sides}", number(found["damper_map_seconds"])],
        [f"one mass between two stops, gap and frequency, {sides}", number(found["two_sided_map_seconds"])],
        [f"tube in four supports, three modes, force and frequency, {sides}", number(found["tube_map_seconds"])],
    ]
    return "\n\n".join([table(["system", "ns per impact"], costs_), table(["map", "s"], maps_)])


def tables(result: dict[str, Any]) -> str:
    """Return all tables as Markdown."""
    where = result["machine"]
    versions = ", ".join(f"{name} {number_}" for name, number_ in where["versions"].items())
    kind = "A quick run, too short to be reliable: " if result["quick"] else ""
    grown, found = result["growth"], result["maps"]
    threads = [
        [str(row["threads"]), *(number(row[name]) for name in ("ns", "speed_up", "cores_got"))]
        for row in result["threads"]
    ]
    startup = [[title, number(result["startup"][key])] for key, title in STARTUP_TITLES.items()]
    return "\n\n".join(
        [
            f"{kind}{result['date']}, {where['processor']}, {where['cores']} cores, {where['system']}, "
            f"Python {where['python']};\n{versions}.\nThe run took {result['minutes']:.1f} minutes."
            f"{_shared(result)}",
            "## Main results",
            summary(result),
            "## Time per impact",
            costs(result),
            "## Accuracy",
            correctness(result),
            "## The paper's five maps",
            maps(result),
            f"The five maps used {number(found['cores_got'])} cores on average, and all six at most "
            f"{number(found['peak_memory_mb'])} MB of memory.",
            "## GPU",
            gpu(result),
            "## Scaling",
            table(["threads", "ns per impact", "speed-up", "cores used"], threads),
            growth(result, "impacts", "impacts per cell", grown["impacts"]),
            growth(result, "cells", "cells, w = 2.8", grown["cells"]),
            growth(result, "omega_over_natural", "w / w_n", grown["stiffness"]),
            "## Systems of several modes and stops",
            systems(result["systems"]),
            "## Time to the first result",
            table(["whole process", "s"], startup),
            "## Targets",
            "*A / B* is the time of A divided by the time of B.",
            targets(result),
        ]
    )


def put_into(page: Path, text: str) -> None:
    """Replace the text between the marks of a page; without a page, the tables are the page."""
    old = page.read_text(encoding="utf-8") if page.exists() else f"# Benchmarks\n\n{BEGIN}\n{END}\n"
    head, _, rest = old.partition(BEGIN)
    tail = rest.partition(END)[2]
    page.write_text(f"{head}{BEGIN}\n\n{text}\n\n{END}{tail}", encoding="utf-8")
