"""Branch diagrams: the look of a part tells its stability, letters stand at bifurcations, samples lie beneath."""

import numpy as np
import pytest

import vibroimpact as vi
from drawn import legend_texts
from vibroimpact.plotting.continuation import INADMISSIBLE, LOOKS, SAMPLES, STABLE, UNSTABLE, branch_diagram, split

OSC = vi.ImpactOscillator()
RANGE = (0.9, 3.0)


@pytest.fixture(scope="module")
def branch():
    """Return the period-1 impact-1 branch, through its graze and three period doublings."""
    return vi.continue_orbit(vi.find_orbit(OSC)[0], "omega", RANGE)


@pytest.fixture(scope="module")
def doubled(branch):
    return vi.continue_orbit(vi.switch_branch(branch.special[-1]), "omega", RANGE)


@pytest.fixture(scope="module")
def diagram():
    return vi.bifurcation_diagram(OSC, omega=np.linspace(*RANGE, 41), sample_impacts=40)


def lines_over(ax):
    """Return the drawn stretches of branches: lines without a marker."""
    return [line for line in ax.lines if line.get_marker() in ("None", None, "") and len(line.get_xdata()) > 1]


def test_a_branch_is_parted_exactly_at_its_bifurcations(branch, values):
    parts = list(split(branch.dataset, "omega"))
    assert [part.look for part in parts] == [INADMISSIBLE, STABLE, UNSTABLE, STABLE, UNSTABLE]
    meets = [part.values[0] for part in parts[1:]]
    assert meets == [part.values[-1] for part in parts[:-1]], "parts meet in a point"
    np.testing.assert_array_equal(meets, [point.value for point in branch.special])
    assert meets[0] == pytest.approx(float(values["grazing_w_of_n=1"][0]["w"]), abs=1e-10)
    assert (parts[0].values[0], parts[-1].values[-1]) == pytest.approx(RANGE)
    assert sum(len(part.values) - 1 for part in parts) == len(branch.orbits) - 1


def test_a_branch_of_one_point_is_one_part(branch):
    (part,) = split(branch.dataset.isel(point=[-1]), "omega")
    assert part.look == UNSTABLE
    np.testing.assert_array_equal(part.values, branch.dataset["omega"].values[-1:])


@pytest.mark.parametrize("rounded", [0, 1])
def test_how_rounding_falls_at_a_bifurcation_does_not_matter(branch, rounded):
    data = branch.dataset.copy(deep=True)
    data["stable"][np.isin(data["omega"], data["special_value"])] = rounded  # its multiplier is -1, or is it?
    assert [part.look for part in split(data, "omega")] == [INADMISSIBLE, STABLE, UNSTABLE, STABLE, UNSTABLE]


def test_stable_parts_are_solid_unstable_dashed_and_impossible_ones_dotted(branch, ax):
    branch_diagram(branch, ax=ax)
    looks = [LOOKS[look]["linestyle"] for look in (INADMISSIBLE, STABLE, UNSTABLE, STABLE, UNSTABLE)]
    drawn = lines_over(ax)
    assert [line.is_dashed() for line in drawn] == [look != "solid" for look in looks]
    assert drawn[0].get_alpha() < 1.0
    assert drawn[0]._unscaled_dash_pattern[1] != drawn[2]._unscaled_dash_pattern[1]
    assert legend_texts(ax) == [
        "period-1 impact-1",
        "stable",
        "unstable",
        "inadmissible orbits (they penetrate the stop)",
        "PD: period doubling",
        "G: grazing",
    ]
    assert ax.get_xlabel() == r"angular driving frequency $\omega$ [rad/s]"
    assert ax.get_ylabel() == "impact velocity $I$ [m/s]"


def test_letters_stand_at_the_bifurcations_and_are_joined_where_they_would_overlap(branch, ax):
    branch_diagram(branch, ax=ax)
    places = {text.get_text(): text.xy for text in ax.texts}
    assert [text.get_text() for text in ax.texts] == ["G, PD", "PD", "PD"]
    assert places["G, PD"][0] == branch.special[0].value
    marks = [line for line in ax.lines if line.get_marker() in ("o", "s")]
    assert sorted(float(line.get_xdata()[0]) for line in marks) == [point.value for point in branch.special]


def test_a_point_on_two_branches_is_named_once_and_each_name_has_its_colour(branch, doubled, ax):
    branch_diagram([branch, doubled], ax=ax)
    assert {"period-1 impact-1", "period-2 impact-2"} <= set(legend_texts(ax))
    assert len({line.get_color() for line in lines_over(ax)}) == 2
    places = [round(float(line.get_xdata()[0]), 9) for line in ax.lines if line.get_marker() == "o"]
    assert len(places) == len(set(places))
    assert round(branch.special[-1].value, 9) in places
    of_doubled = [line for line in lines_over(ax) if line.get_color() == lines_over(ax)[-1].get_color()]
    assert len(of_doubled) >= 2, "each impact of a cycle is a line"


def test_the_samples_lie_in_grey_beneath_and_on_the_stable_part(branch, diagram, ax):
    branch_diagram(branch, diagram, ax=ax)
    dots = ax.lines[0]
    assert dots.get_color() == SAMPLES
    assert dots.get_zorder() < lines_over(ax)[0].get_zorder()
    assert ax.get_xlim() == RANGE
    x, y = dots.get_data()
    between = (x > 1.6) & (x < 2.5)
    stable = next(part for part in split(branch.dataset, "omega") if part.values[0] < 2.0 < part.values[-1])
    np.testing.assert_allclose(y[between], np.interp(x[between], stable.values, stable.heights[:, 0]), rtol=2e-2)
    assert legend_texts(ax)[0] == "impact velocity (one dot per impact)"


def test_columns_without_a_sample_are_marked_over_branches_too(branch, diagram, ax):
    holed = diagram.copy(deep=True)
    holed["velocity"][:3], holed["status"][:3] = np.nan, vi.Status.BUDGET
    branch_diagram(branch, holed, ax=ax)
    assert any(text == "not followed to the end (3 columns)" for text in legend_texts(ax))


def test_parts_that_are_no_motion_do_not_widen_the_view(branch, ax):
    far = branch.dataset.copy(deep=True)
    first = far["admissible"].values == 0
    far["velocity"].values[first] = 1e6
    branch_diagram(far, ax=ax)
    assert ax.get_ylim()[1] < 10.0


def test_what_is_no_branch_or_goes_another_way_is_refused(branch, diagram):
    other = branch.dataset.rename(omega="gap")
    strobe = vi.bifurcation_diagram(OSC, omega=[1.0, 2.0], section="stroboscopic", sample_periods=5)
    over_gap = diagram.rename(omega="gap")
    for arguments, words in (
        (([],), "`branches` must hold at least one"),
        ((diagram,), "got a result of bifurcation_diagram with velocity"),
        ((None,), "`branches` must be branches of periodic orbits, got a NoneType"),
        (([branch, other],), "`branches` must go along one parameter, got omega, gap"),
        ((branch, strobe), "`diagram` must hold impacts over omega, as `branches` do, got periods over omega"),
        (
            (branch, over_gap),
            "got impacts over gap",
        ),
        ((branch, branch.dataset), "`diagram` must be a result of bifurcation_diagram"),
        ((branch, 3), "`diagram` must be a result of bifurcation_diagram"),
    ):
        with pytest.raises(ValueError) as caught:  # noqa: PT011
            branch_diagram(*arguments)
        assert words in str(caught.value)
