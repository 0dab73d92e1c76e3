"""The benchmark measures everyone on the same oscillators, judges them, and writes down what it found."""

import dataclasses
import json
import runpy
import sys

import matplotlib.pyplot as plt
import numpy as np
import pytest

from fenced import ROOT

sys.path.insert(0, str(ROOT))  # `benchmarks` is no part of the package

from benchmarks import run
from benchmarks.effort import QUICK
from benchmarks.page import BEGIN, END, put_into
from benchmarks.problem import LowRun, known, verdict
from benchmarks.targets import TARGETS, Target
from benchmarks.taylor import heyoka

PICTURES = runpy.run_path(str(ROOT / "docs" / "compared_pictures.py"))
# Starts with an empty cache take a minute and prove nothing here.
LEAST = dataclasses.replace(QUICK, cells=64, impacts=160, map_points=4, largest_sweep=16, cold_starts=0)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("benchmarks")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "QUICK", LEAST)
        run.main(["--quick", "--out", str(folder / "results" / "figures.json"), "--page", str(folder / "page.md")])
    return folder


@pytest.fixture(scope="module")
def result(written):
    return json.loads((written / "results" / "figures.json").read_text())


@pytest.fixture(scope="module")
def measured(result):
    return {row["name"]: row for row in result["contenders"] if not row["note"]}


@pytest.mark.long
def test_every_contender_is_measured_or_says_why_not(result):
    for row in result["contenders"]:
        assert row["note"] or row["cost"]["chaotic"]["ns"] > 0
    first = result["contenders"][0]
    assert first["name"] == "ours, one core"
    assert [cost["ratio"] for cost in first["cost"].values()] == [1.0, 1.0, 1.0]


@pytest.mark.long
def test_ours_is_right_in_lanes_and_alone(measured):
    for name in ("ours, one core", "ours, all cores, early closing", "ours, one orbit"):
        row = measured[name]
        assert row["error_first_20"] < 1e-12
        assert row["error_settled"] < 1e-11
        assert row["stays_in_front"]
        assert row["sticks_and_leaves"]


@pytest.mark.long
def test_the_paper_s_scheme_rattles_where_the_mass_should_stick(measured):
    row = measured["the paper's scheme"]
    assert row["stalls"].startswith("rattles")
    assert row["error_settled"] > 1e-7


@pytest.mark.long
def test_an_event_solver_stalls_where_impacts_pile_up(measured):
    row = measured["SciPy DOP853, one orbit"]
    assert row["stalls"].startswith("stalls at")
    assert row["error_first_20"] < 1e-8


@pytest.mark.long
@pytest.mark.skipif(heyoka is None, reason="heyoka is not installed")
@pytest.mark.parametrize("how", ["one orbit", "batch"])
def test_heyoka_passes_the_stop_unless_sticking_is_added(measured, how):
    alone, helped = measured[f"heyoka, {how}"], measured[f"heyoka, {how}, sticking added"]
    assert alone["passes_the_stop_by"] > 0.1
    assert not alone["sticks_and_leaves"]
    assert helped["stays_in_front"]
    assert helped["sticks_and_leaves"]
    assert max(alone["error_first_20"], helped["error_settled"]) < 1e-10


def test_a_run_that_never_stuck_is_not_taken_for_one_that_did():
    next_hit = float(known()["sticking_w=0.1"]["impacts"][0]["v"])
    assert verdict(LowRun([0.3, next_hit, 0.2], 0.0))["sticks_and_leaves"]
    assert not verdict(LowRun([0.3, next_hit + 1e-5, 0.2], 0.0))["sticks_and_leaves"]
    assert not verdict(LowRun([0.3, next_hit, 0.2], 1e-3))["stays_in_front"]


@pytest.mark.long
def test_the_counts_of_the_maps_add_up(result):
    maps = result["maps"]
    assert len(maps["maps"]) == 5
    assert maps["total_impacts"] == sum(drawn["impacts_computed"] for drawn in maps["maps"])
    assert maps["without_closing"]["impacts_computed"] == maps["points"] ** 2 * 5100
    assert maps["maps"][0]["impacts_computed"] < maps["without_closing"]["impacts_computed"]
    assert 1 < result["steps_an_impact"] < 10


@pytest.mark.long
def test_cost_is_followed_over_threads_impacts_cells_and_stiffness(result):
    assert result["threads"][0]["threads"] == 1
    assert result["threads"][0]["speed_up"] == 1.0
    assert [row["omega_over_natural"] for row in result["growth"]["stiffness"]][::8] == [0.01, 100.0]
    for rows in result["growth"].values():
        assert all(row["ns"] > 0 and row["steps_an_impact"] > 0 for row in rows)


@pytest.mark.long
def test_every_number_to_meet_is_judged_or_left_open(result):
    assert len(result["targets"]) == len(TARGETS)
    for row in result["targets"]:
        assert (row["met"] is None) == (row["measured"] is None)
    assert next(row for row in result["targets"] if row["what"].startswith("certified steps"))["met"]


@pytest.mark.parametrize(("more_is_better", "found", "met"), [(False, 3, True), (False, 5, False), (True, 5, True)])
def test_a_bound_is_kept_from_the_side_it_names(more_is_better, found, met):
    target = Target("a figure", "s", 4, lambda _: found, more_is_better=more_is_better)
    assert target.judge({})["met"] is met


def test_the_page_keeps_its_words_and_changes_its_figures(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    put_into(page, "new")
    put_into(page, "newer")
    assert page.read_text() == f"before\n{BEGIN}\n\nnewer\n\n{END}\nafter\n"


@pytest.mark.long
def test_what_is_written_names_the_machine_but_not_its_owner(written, result):
    assert result["machine"]["cores"] >= 1
    assert result["machine"]["versions"]["numba"]
    text = (written / "page.md").read_text() + json.dumps(result)
    assert str(ROOT) not in text
    assert "## Targets" in text


def test_the_picture_of_cost_and_accuracy_shows_what_was_measured():
    measured = json.loads((ROOT / "benchmarks" / "results" / "latest.json").read_text())
    (ax,) = PICTURES["cost_and_accuracy"](measured).axes
    rows = {row["name"]: row for row in measured["contenders"] if row["name"] in PICTURES["DRAWN"]}
    assert [text.get_text() for text in ax.texts] == list(rows)
    for line, row in zip(ax.lines, rows.values(), strict=True):
        assert line.get_xydata().tolist() == [[row["error_first_20"], row["cost"]["chaotic"]["ns"]]]
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    assert all(left < line.get_xdata()[0] < right and low < line.get_ydata()[0] < high for line in ax.lines)
    ax.figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in ax.texts]
    assert all(ax.get_window_extent().contains(*corner) for box in boxes for corner in box.corners())
    assert [box.count_overlaps(boxes) for box in boxes] == [1] * len(boxes)
    plt.close(ax.figure)


def test_the_published_figure_shows_both_schemes_on_the_same_axes():
    """Where neither chatters nor is chaotic, they agree to the paper's step."""
    figure = PICTURES["published_figure"](omega=np.linspace(1.5, 2.5, 5), sample_impacts=100)
    paper, exact = figure.axes
    assert (paper.get_xlim(), paper.get_ylim()) == (exact.get_xlim(), exact.get_ylim())
    assert exact.get_xlabel() == r"angular driving frequency $\omega$ [rad/s]"
    for one, other in zip(paper.lines, exact.lines, strict=True):
        np.testing.assert_allclose(one.get_xydata(), other.get_xydata(), atol=5e-3)
    plt.close(figure)
