"""The paper's study: its rules, its coverage of the paper, and the folder it writes."""

from __future__ import annotations

import json
import re
from collections import Counter
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact.studies.lee import pipeline, run
from vibroimpact.studies.lee.claims import merge_runs
from vibroimpact.studies.lee.laboratory import intervals
from vibroimpact.studies.lee.pipeline import CLAIMS
from vibroimpact.studies.lee.rules import (
    Assessment,
    Verdict,
    all_of,
    axis_limit,
    fills_interval,
    nearly_all,
    printed_value,
    proportional,
    trend,
)

HOLDS, CLOSE, FAILS = Verdict.HOLDS, Verdict.LAST_DIGIT, Verdict.FAILS


@pytest.mark.parametrize(
    ("found", "printed", "verdict"),
    [
        (0.2286, "0.23", HOLDS),
        (0.2350, "0.23", CLOSE),
        (0.2450, "0.23", FAILS),
        (0.4472, "0.44", CLOSE),
        (0.0049, "0.00", HOLDS),
        (2.7602, "3", HOLDS),
        (float("nan"), "3", FAILS),
    ],
)
def test_a_printed_value_is_compared_after_rounding_to_its_digits(found: float, printed: str, verdict: Verdict) -> None:
    assert printed_value(found, printed).verdict is verdict


def test_an_interval_is_filled_only_if_every_frequency_in_it_has_the_motion() -> None:
    positions = [0.2, 0.24, 0.25, 0.3]
    assert fills_interval(positions, [True, True, True, False], "0.10", "0.25").verdict is HOLDS
    assert fills_interval(positions, [True, False, True, False], "0.10", "0.25").verdict is CLOSE
    assert fills_interval(positions, [False, True, True, True], "0.10", "0.25").verdict is FAILS
    assert fills_interval(positions, [True, True, True, True], "0.4", "0.5").verdict is FAILS


def test_shares_trends_and_axes_are_judged_by_their_numbers_alone() -> None:
    assert nearly_all(0.95, "cells").verdict is HOLDS
    assert nearly_all(0.949, "cells").verdict is FAILS
    assert trend([1.0, 2.0, 3.0], "it", grows=True).verdict is HOLDS
    assert trend([1.0, 3.0, 2.0], "it", grows=True).verdict is FAILS
    assert trend([3.0, 2.0, 1.0], "it", grows=False).verdict is HOLDS
    assert trend([2.0, 2.0, 1.0], "it", grows=False).verdict is FAILS
    assert trend([1.0], "it", grows=True).verdict is FAILS
    assert [axis_limit(value, "8").verdict for value in (7.9, 8.5, 9.1, 6.5, 5.9)] == [
        HOLDS, CLOSE, FAILS, CLOSE, FAILS,
    ]  # fmt: skip
    assert proportional([5.0, 5.0 + 1e-12], 5.0).verdict is HOLDS
    assert proportional([5.0, 5.1], 5.0).verdict is FAILS
    assert proportional([], 5.0).verdict is FAILS


def test_a_statement_of_several_parts_is_as_true_as_its_weakest_part() -> None:
    parts = [Assessment(HOLDS, "one"), Assessment(CLOSE, "two"), Assessment(HOLDS, "one")]
    assert all_of(parts) == Assessment(CLOSE, "one; and two")


def test_runs_of_frequencies_are_told_in_words() -> None:
    omega = [1.0, 1.1, 1.2, 1.3]
    assert intervals(omega, np.array([True, True, False, True])) == "at w = 1 to 1.1, 1.3"
    assert intervals(omega, np.zeros(4, bool)) == "at no frequency"
    assert merge_runs(omega, ["a", "a", "b", "a"], 0.1) == [("a", 1.0, 1.1), ("other", 1.2, 1.3)]


def test_every_section_with_results_is_covered_and_no_statement_has_two_names() -> None:
    sections = Counter(claim.section for claim in CLAIMS)
    assert set(sections) == {"3", "3.1", "3.2", "3.3", "3.4", "3.5", "4.1", "4.2", "4.3", "4.4", "4.5", "5"}
    assert min(sections.values()) >= 4
    assert len({claim.id for claim in CLAIMS}) == len(CLAIMS)
    assert all(claim.id.startswith(claim.section + "-") and claim.quotation and claim.says for claim in CLAIMS)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    news: list[tuple[int, int, str]] = []
    out = tmp_path_factory.mktemp("reproduce") / "study"
    report = run(out, quick=True, progress=lambda done, total, text: news.append((done, total, text)))
    assert report == out / "report.html"
    assert news[-1][0] == news[-1][1]
    assert all(before[0] <= after[0] for before, after in pairwise(news))
    return out


@pytest.fixture(scope="module")
def claims(study: Path) -> dict[str, dict[str, Any]]:
    record = json.loads((study / "study.json").read_text(encoding="utf-8"))
    return {claim["quotation"]: claim for claim in record["claims"]}


class _Page(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.ids: list[str] = []
        self.tags: Counter[str] = Counter()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        self.links += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data")]
        self.ids += [value or "" for name, value in attrs if name == "id"]


@pytest.mark.long
def test_the_report_opens_from_disk_without_network_or_script(study: Path) -> None:
    text = (study / "report.html").read_text(encoding="utf-8")
    page = _Page(text)
    assert not page.tags["script"] + page.tags["link"] + page.tags["iframe"]
    assert "url(" not in text
    assert "@import" not in text
    inside = [link[1:] for link in page.links if link.startswith("#")]
    beside = [link for link in page.links if not link.startswith(("#", "data:image/png;base64,"))]
    assert set(inside) <= set(page.ids)
    assert len(page.ids) == len(set(page.ids))
    assert beside
    assert all((study / link).exists() for link in beside)
    assert page.tags["img"] == 20


@pytest.mark.long
def test_every_figure_of_the_paper_is_there_with_its_data(study: Path) -> None:
    for number in range(1, 21):
        for ending, start in (("png", b"\x89PNG"), ("svg", b"<?xml")):
            assert (study / "figures" / f"figure-{number:02d}.{ending}").read_bytes().startswith(start)
    stores = sorted(path.name for path in (study / "data").iterdir())
    figures = {int(re.findall(r"\d+", name)[0]) for name in stores}
    assert figures == set(range(2, 21))
    for name in stores:
        assert "oscillator" in vi.load(study / "data" / name).attrs
    sweep = vi.load(study / "data" / "figure-11.zarr")
    assert sweep["std"].dims == ("omega", "mass")


@pytest.mark.long
def test_the_report_names_every_statement_and_its_level(study: Path, claims: dict[str, dict[str, Any]]) -> None:
    text = (study / "report.html").read_text(encoding="utf-8")
    assert all(f'id="c{claim.id}"' in text for claim in CLAIMS)
    assert "Std = 0.05 m/s" in text
    assert all(claim["exact"] and claim["because"] and claim["rule"] for claim in claims.values())


# quotation: the verdict that 50-digit reference values or a closed form demand
KNOWN = {
    "the maximum impact velocity is 0.23 (w = 0.1)": "holds",  # 0.228634...
    "at phase 0.03 (w = 0.1)": "holds",  # 0.033846...
    "the sticking occurs at phase 0.11 (w = 0.1)": "holds",  # 0.112769...
    "[m = 5] The resonance of free oscillation is w_n = 0.44": "last digit",  # sqrt(0.2) = 0.447...
    "[k = 0.1] The resonance of free oscillation is w_n = 0.31": "last digit",  # sqrt(0.1) = 0.316...
    "the ... period-2 impact-1 motion appears at w = 4": "holds",
    "again leading to a complex motion (w = 1.0, Fig. 7)": "does not hold",  # grazes at 1.0071... only
    "In the large-Std and moderate-Std regions, the motions are unstable": "does not hold",
    "the magnitudes of the impact velocities are proportioned to f (f = 5)": "holds",
    "[m = 0.1] Thus, the amplitude on the y-axis is increased to 8": "does not hold",  # the resonance reaches 17.3
    "[k = 5] Thus, the amplitude in the y-axis is reduced to 3": "holds",
    "When the stiffness k increases, so do ... the impact motions": "does not hold",  # they become softer
    "[r = 0.1] the first impact resonance shifts to w = 1": "does not hold",  # it vanishes on the way, near 1.7
}


@pytest.mark.long
@pytest.mark.parametrize(("quotation", "verdict"), KNOWN.items())
def test_statements_whose_truth_is_known_are_judged_so(
    claims: dict[str, dict[str, Any]], quotation: str, verdict: str
) -> None:
    assert claims[quotation]["verdict"] == verdict, claims[quotation]


@pytest.mark.long
def test_where_another_motion_comes_from_rest_coexistence_is_named(claims: dict[str, dict[str, Any]]) -> None:
    claim = claims["the period-1 impact-1 motion is within [1.25, 2.5]"]
    assert claim["verdict"] == "does not hold"
    # Period-1 impact-1 is stable from w = 1.258962234877 on.
    assert re.search(r"coexistence: .* lead to period-1 impact-1 motions, not at w = 1.25$", claim["because"])
    resonance = claims["[r = 0.1] the first impact resonance shifts to w = 1"]
    assert "period-1 sticking" in resonance["because"]


@pytest.mark.long
def test_what_is_found_agrees_with_the_reference_values(claims: dict[str, dict[str, Any]]) -> None:
    hardest = claims["the maximum impact velocity is 0.23 (w = 0.1)"]["exact"]
    assert float(hardest.split()[0]) == pytest.approx(0.22863412623842875574, rel=1e-5)
    ends = claims["when w = 1.0, the impact motion starts to bifurcate"]["exact"]
    assert float(ends.split()[0]) == pytest.approx(1.0071051254336962617, abs=5e-4)


def test_a_stopped_study_leaves_nothing_and_says_so(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt, match="nothing was written under"):
        run(tmp_path / "study", quick=True, progress=lambda done, total, text: done < 20)
    assert list(tmp_path.iterdir()) == []


def test_only_a_former_study_is_ever_replaced(tmp_path: Path) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "draft.txt").write_text("mine")
    with pytest.raises(FileExistsError, match="not an earlier study"):
        run(tmp_path / "thesis", overwrite=True)
    former = tmp_path / "study"
    former.mkdir()
    (former / pipeline.RECORD).write_text("{}")
    with pytest.raises(FileExistsError, match="allow overwriting"):
        run(former)
    with pytest.raises(KeyboardInterrupt):
        run(former, quick=True, overwrite=True, progress=lambda done, total, text: done < 5)
    assert (former / pipeline.RECORD).read_text() == "{}"


@pytest.mark.parametrize("arguments", [{"level": 0.0}, {"level": "high"}, {"workers": 0}])
def test_a_wrong_argument_is_named_before_anything_is_computed(tmp_path: Path, arguments: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=f"`{next(iter(arguments))}`"):
        run(tmp_path / "study", **arguments)
    assert list(tmp_path.iterdir()) == []
