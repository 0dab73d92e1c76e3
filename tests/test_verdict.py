"""What a verdict says is true: against 50-digit values, closed forms, and what other functions of the package find."""

import json
import math
import re
from dataclasses import asdict
from itertools import pairwise

import matplotlib
import numpy as np
import pytest

import vibroimpact as vi
from designs import RARE, shaker
from vibroimpact.backends import ImpactWindow, get_backend
from vibroimpact.coexistence.measuring import Runner, Start, cells_of
from vibroimpact.indices import INDICES
from vibroimpact.model.oscillator import PARAMETERS
from vibroimpact.plotting import comparison_figure
from vibroimpact.verdict.advice import Advice
from vibroimpact.verdict.changes import advice_text, ends_of
from vibroimpact.verdict.compare import Comparison
from vibroimpact.verdict.edges import Edge
from vibroimpact.verdict.ranges import range_of

END_OF_STICKING = 0.34718041326569626  # of the default oscillator, rad/s


@pytest.fixture(scope="module")
def fast():
    return vi.describe(vi.ImpactOscillator(omega=2.0))


@pytest.fixture(scope="module")
def chaotic():
    return vi.describe(vi.ImpactOscillator(omega=2.8))


def edge(verdict, parameter, direction):
    return next(e for e in verdict.boundaries if (e.parameter, e.direction) == (parameter, direction))


def hardest_hit(osc, start=None):
    section = vi.impact_section(osc, start=start, transient_impacts=3000, sample_impacts=4000)
    return float(section["velocity"].max()) if section.sizes["impact"] else 0.0


# What it does


def test_the_motion_at_w_2_is_named_with_its_50_digit_velocity_and_phase(fast, values):
    known = values["period_n_impact_1"]["w=2.0,n=1"]
    assert fast.motion.name == "period-1 impact-1"
    assert fast.motion.velocities == pytest.approx((float(known["v"]),), rel=1e-13)
    assert fast.motion.phases == pytest.approx((float(known["phase_frac"]),), rel=1e-13)
    assert "once per period: 6.226 m/s at phase 0.499" in str(fast)


def test_the_energy_lost_is_that_of_the_impact_and_the_power_that_over_the_period(fast):
    """E = m (1 - r^2) v^2 / 2."""
    (v,) = fast.motion.velocities
    assert fast.indices["dissipation"] == pytest.approx(0.5 * (1 - 0.8**2) * v**2, rel=1e-9)
    assert fast.power == pytest.approx(0.5 * (1 - 0.8**2) * v**2 / fast.oscillator.period, rel=1e-9)


def test_neighbours_approach_at_the_rate_of_the_50_digit_multiplier(fast, values):
    largest = float(values["period_n_impact_1"]["w=2.0,n=1"]["mult1"][0])
    halving = -math.log(2.0) / math.log(largest)
    assert abs(fast.orbit.multipliers[0]) == pytest.approx(largest, rel=1e-9)
    assert f"{halving:.2g} periods" in str(fast)


def test_at_w_0_1_the_mass_rests_for_the_50_digit_share_of_the_time(values):
    known = values["sticking_w=0.1"]
    verdict = vi.describe(vi.ImpactOscillator(omega=0.1), parameters=[])
    assert verdict.kind == "sticking"
    share = float(known["stuck_duration"]) / float(known["T"])
    assert verdict.indices["stick_fraction"] == pytest.approx(share, abs=1e-9)
    assert verdict.max_velocity == pytest.approx(float(known["max_v"]), rel=1e-11)
    assert f"{100 * share:.3g} % of the time at rest" in " ".join(str(verdict).split())
    assert "erases all memory" in " ".join(str(verdict).split())


@pytest.mark.long
def test_chaos_at_w_2_8_is_told_with_its_exponent_and_how_far_one_can_foresee(chaotic, values):
    known = float(values["lyapunov_w=2.8"]["lam_per_time_mean_se"][0])
    assert chaotic.kind == "chaotic"
    assert chaotic.indices["lyapunov"] == pytest.approx(known, rel=0.05)
    periods = math.log(1e6) / chaotic.indices["lyapunov"] / chaotic.oscillator.period
    assert f"predictable for about {periods:.2g} periods" in str(chaotic)
    assert str(chaotic).splitlines()[2].startswith("motion      from rest chaotic")


@pytest.mark.parametrize("name", ["fast", "chaotic"])
def test_every_index_is_that_of_parameter_map(request, name):
    verdict = request.getfixturevalue(name)
    sweep = vi.parameter_map(verdict.oscillator, indices=tuple(INDICES), omega=[verdict.oscillator.omega])
    for index in INDICES:
        assert verdict.indices[index] == float(sweep[index][0])


@pytest.mark.long
@pytest.mark.parametrize("omega", [2.0, 0.1, 2.8])  # a cycle, sticking, chaos
def test_the_motion_from_rest_is_computed_once_and_where_it_does_not_repeat_watched_besides(omega, monkeypatch):
    osc, calls = vi.ImpactOscillator(omega=omega), []
    engine = type(get_backend("cpu"))

    def counted(name):
        whole = getattr(engine, name)

        def call(self, cells, *asked):
            calls.extend(name for row in cells if row == next(iter(osc.cells({}))))
            return whole(self, cells, *asked)

        return call

    for name in ("indices", "share", "samples", "follow"):
        monkeypatch.setattr(engine, name, counted(name))
    verdict = vi.describe(osc, parameters=["omega", "gap"])
    assert verdict.transient == ""
    assert omega == 2.8 or verdict.watched < 5000
    assert calls == ["follow"] * (2 if omega == 2.8 else 1)


# How far it is from something else


def test_the_period_doubling_below_w_1_4_is_the_50_digit_one(values):
    known = max(float(row["w"]) for row in values["period_doubling_w_of_n=1"] if float(row["w"]) < 1.4)
    down = edge(vi.describe(vi.ImpactOscillator(omega=1.4), parameters=["omega"]), "omega", -1)
    assert (down.kind, down.accuracy, down.beyond) == ("period_doubling", "exact", "period-2 impact-2")
    assert down.value == pytest.approx(known, rel=1e-13)
    assert down.change == pytest.approx(known / 1.4 - 1.0, rel=1e-11)


def test_the_grazing_above_w_0_95_is_the_50_digit_one(values):
    verdict = vi.describe(vi.ImpactOscillator(omega=0.95), parameters=["omega"])
    up = edge(verdict, "omega", 1)
    assert verdict.motion.name == "period-1 impact-2"
    assert (up.kind, up.accuracy) == ("grazing", "exact")
    assert up.value == pytest.approx(float(values["grazing_w_of_n=1"][0]["w"]), rel=1e-12)


def test_sticking_at_w_0_1_ends_upwards_at_the_end_of_sticking():
    up = edge(vi.describe(vi.ImpactOscillator(omega=0.1), parameters=["omega"]), "omega", 1)
    assert (up.kind, up.accuracy) == ("end_of_sticking", "exact")
    assert up.value == pytest.approx(END_OF_STICKING, rel=1e-12)


def test_the_boundaries_of_an_orbit_are_the_nearest_special_points_of_its_branch(fast):
    for parameter in ("mass", "stiffness", "gap"):
        varied = range_of(fast.oscillator, parameter, 3.0)
        branch = vi.continue_orbit(fast.orbit, parameter, (varied.low, varied.high), virtual=False)
        below = [point.value for point in branch.special if point.value < varied.value]
        above = [point.value for point in branch.special if point.value > varied.value]
        assert edge(fast, parameter, -1).value == pytest.approx(max(below), rel=1e-11)
        assert edge(fast, parameter, 1).value == pytest.approx(min(above), rel=1e-11)


def test_at_gap_zero_the_force_only_changes_the_size(fast):
    assert not edge(fast, "amplitude", -1).found
    assert not edge(fast, "amplitude", 1).found


def test_a_bisected_boundary_parts_motions_of_different_names(chaotic):
    runner, count = Runner(), 0
    for boundary in chaotic.boundaries:
        if boundary.kind == "change" and boundary.parameter in ("omega", "restitution"):
            assert 0.0 < boundary.half_width < 1e-5
            assert boundary.accuracy.startswith("to within")
            there = chaotic.oscillator.replace(**{boundary.parameter: boundary.beyond_at})
            starts = [Start(0.0, 0.3, phase) for phase in (0.1, 0.35, 0.6, 0.85)]
            motions = runner.measure(cells_of([there] * 4, starts), ImpactWindow(10_000, 5000))
            assert boundary.beyond in {motion.name for motion in motions}
            count += 1
    assert count == 4


def test_without_impacts_the_motion_first_touches_the_stop_where_its_amplitude_is_the_gap():
    osc = vi.ImpactOscillator(gap=0.5)
    verdict = vi.describe(osc)
    assert verdict.kind == "no_impact"
    found = [boundary for boundary in verdict.boundaries if boundary.found]
    assert {boundary.parameter for boundary in found} == {"mass", "stiffness", "amplitude", "omega", "gap"}
    for boundary in found:
        assert boundary.kind == "first_contact"
        there = osc.replace(**{boundary.parameter: boundary.value})
        assert there.steady_amplitude == pytest.approx(there.gap, rel=1e-12)
    assert f"stays {0.5 - osc.steady_amplitude:.3g} m clear" in " ".join(str(verdict).split())
    assert edge(verdict, "gap", -1).value == pytest.approx(osc.steady_amplitude, rel=1e-14)


def test_a_mass_pressed_for_ever_is_lifted_off_where_the_force_is_the_preload():
    verdict = vi.describe(vi.ImpactOscillator(gap=-2.0))
    lifted = {b.parameter: b.value for b in verdict.boundaries if b.found}
    assert verdict.kind == "stuck_forever"
    assert lifted == pytest.approx({"stiffness": 0.5, "amplitude": 2.0, "gap": -1.0}, rel=1e-14)


# What coexists, and what would calm it


def test_at_w_3_a_sticking_motion_coexists_with_a_periodic_one():
    verdict = vi.describe(vi.ImpactOscillator(omega=3.0), parameters=[])
    mine, other = verdict.attractors
    assert (mine.name, mine.from_rest) == ("period-6 sticking", True)
    assert (other.name, other.from_rest) == ("period-2 impact-2", False)
    assert mine.share + other.share == pytest.approx(1.0)
    assert 0.05 < mine.share < 0.25  # about one start in eight
    assert "period-6 sticking (this motion)" in " ".join(str(verdict).split())


@pytest.mark.long(but=1)
@pytest.mark.parametrize("omega", [2.0, 1.4, 2.8, 0.1])
def test_advice_that_is_followed_does_what_it_says(omega):
    osc = vi.ImpactOscillator(omega=omega)
    verdict = vi.describe(osc, parameters=["omega", "mass", "gap"])
    now = hardest_hit(osc)
    assert verdict.advice
    for advice in verdict.advice:
        changed = osc.replace(**{advice.parameter: advice.value})
        then = hardest_hit(changed)
        assert then <= advice.max_velocity * (1.0 + 1e-6 if "chaotic" not in advice.motion else 1.02)
        if advice.benefit == "softer":
            assert then <= 0.801 * now
        elif advice.benefit == "no_chaos":
            assert vi.recognise(vi.impact_section(changed, transient_impacts=3000)).kind in ("periodic", "sticking")
        else:
            assert then == 0.0
    changes = [abs(advice.change) for advice in verdict.advice]
    assert changes == sorted(changes)


def test_the_smallest_change_that_softens_the_hits_is_no_smaller_than_needed():
    """Period-1 impact-1 has a closed form: half the advised change of w must not soften the hits by a fifth."""
    osc = vi.ImpactOscillator(omega=2.0)
    (advice,) = vi.describe(osc, parameters=["omega"]).advice
    between = osc.replace(omega=2.0 + 0.95 * (advice.value - 2.0))
    assert hardest_hit(between) > 0.8 * hardest_hit(osc)


def test_where_nothing_hits_there_is_nothing_to_calm():
    verdict = vi.describe(vi.ImpactOscillator(gap=0.5), parameters=["omega"])
    assert verdict.advice == ()
    assert "no impacts from rest" in " ".join(str(verdict).split())


# How it is told


def verdict_of(osc):
    return vi.describe(osc, parameters=[])


def test_what_is_given_in_hertz_is_told_in_hertz_too():
    """w = 2 pi 20 Hz."""
    verdict = vi.describe(vi.ImpactOscillator(stiffness=4e4, frequency=20.0), parameters=[])
    assert "omega 125.664 rad/s (20 Hz)" in " ".join(str(verdict).split())


def test_a_change_of_the_gap_is_told_beside_the_gap_and_beside_the_static_deflection():
    osc = vi.ImpactOscillator(amplitude=2.0, stiffness=2000.0, gap=0.2e-3)  # f/k = 1 mm
    up = Edge("gap", 1, "fold", 0.25e-3, 0.05, "f/k")
    assert list(ends_of(verdict_of(osc), up)) == [("0.00025\n+25 %\n+5 % of f/k", "fold")]
    at_zero = Edge("gap", 1, "fold", 0.25e-3, 0.25, "f/k")
    zero_has_no_shares = [("0.00025\n+25 % of f/k", "fold")]
    assert list(ends_of(verdict_of(osc.replace(gap=0.0)), at_zero)) == zero_has_no_shares
    wide = Edge("gap", 1, "fold", 2.5e-3, 0.25, "")
    assert list(ends_of(verdict_of(osc.replace(gap=2e-3)), wide)) == [("0.0025\n+25 %", "fold")]


def test_boundaries_are_a_table_in_the_units_that_were_given():
    """Rows of the text, of the notebook and of a comparison are the same; w = 2 pi n/60."""
    osc = vi.ImpactOscillator(mass=1.2, stiffness=26860.0, damping=8.0, amplitude=100.0, frequency=25.0, gap=0.5e-3)
    units = {"frequency": "rpm", "gap": "mm"}
    own, verdict = (vi.describe(osc, parameters=["omega", "gap"], units=given) for given in (None, units))
    assert own.boundaries == verdict.boundaries
    lines = str(verdict).splitlines()
    at = lines.index("boundaries")
    columns = [match.start() for match in re.finditer(r"\S+(?: \S+)*", lines[at + 1])]
    assert lines[at + 1].split("  ")[1] == "parameter"
    table = [[line[i:j].strip() for i, j in pairwise([*columns, None])] for line in lines[at + 2 : at + 6]]
    assert [row[0] for row in table] == ["frequency [rpm]", "", "gap [mm]", ""]
    edges = iter(verdict.boundaries)
    for row, scale in ((table[0], 30.0 / math.pi), (table[2], 1e3)):
        for place, what in (row[1:3], row[3:5]):
            edge = next(edges)
            value, _, half = place.partition(" ± ")
            assert float(value) == pytest.approx(edge.value * scale, rel=1e-4)
            assert float(half) == pytest.approx(edge.half_width * scale, rel=0.3)
            assert what == edge.what
            assert what in verdict._repr_html_()
            assert place in verdict._repr_html_()
            assert place in str(Comparison(("A", "B"), (verdict, verdict)))
    assert "frequency 1500 rpm" in " ".join(str(verdict).split())
    assert "gap 0.5 mm" in " ".join(str(verdict).split())
    advised = verdict.advice[0]
    assert advised.parameter == "omega"
    assert f"frequency by 2.8 % to {advised.value * 30.0 / math.pi:.6g} rpm" in " ".join(str(verdict).split())
    assert "rad/s" not in " ".join(str(verdict).split()) + str(Comparison(("A", "B"), (verdict, verdict)))
    assert "omega" not in str(verdict)


def test_advice_that_merely_ends_the_chaos_says_so():
    osc = vi.ImpactOscillator()
    calm = Advice("mass", 1.01, 0.01, "", "no_chaos", "period-10 impact-6", 0.9985, 1.0, 385)
    assert "period-10 impact-6, no longer chaotic, hardest hit" in advice_text(osc, calm)
    softer = Advice("mass", 1.01, 0.01, "", "softer", "period-1 impact-1", 0.5, 1.0, 385)
    assert "chaotic" not in advice_text(osc, softer)


def test_on_a_boundary_no_digits_of_rounding_are_told():
    """A preload k g as large as the force: any more force lifts the mass off the stop."""
    verdict = vi.describe(vi.ImpactOscillator(gap=-1.0), parameters=["amplitude"])
    place, what = next(ends_of(verdict, verdict.boundaries[1]))
    assert place == "at once"
    assert what.startswith("the force first lifts the mass off the stop")
    verdict = verdict_of(vi.ImpactOscillator())
    for digits in (1e-15, -3e-13):
        noise = Edge("omega", 1, "grazing", 2.0 * (1.0 + digits), digits, "", beyond="chaotic")
        assert list(ends_of(verdict, noise)) == [("at once", "grazing;\nchaotic beyond")]
    near = Edge("omega", 1, "grazing", 2.0 * (1.0 + 1e-9), 1e-9, "")
    assert "at once" not in str(list(ends_of(verdict, near)))


# Hard cases


@pytest.mark.long(but=2)
@pytest.mark.parametrize(
    ("numbers", "kind"),
    [
        ({"gap": 0.5}, "no_impact"),
        ({"amplitude": 0.0, "gap": 1.0}, "no_impact"),
        ({"gap": -2.0}, "stuck_forever"),
        ({"amplitude": 0.0}, "stuck_forever"),
        ({"amplitude": 0.0, "gap": -0.1}, "stuck_forever"),
        ({"restitution": 0.0}, "sticking"),
        ({"restitution": 0.0, "omega": 0.5, "gap": -0.3}, "sticking"),
        ({"restitution": 1.0}, "periodic"),
        ({"restitution": 1.0, "damping": 0.0}, "undecided"),
        ({"damping": 0.0, "omega": 1.0, "gap": 1.0}, "periodic"),
        ({"omega": 2.8, "gap": -0.2}, None),
    ],
)
def test_every_hard_case_has_a_verdict_that_can_be_read_and_stored(numbers, kind):
    verdict = vi.describe(vi.ImpactOscillator(**numbers), parameters=["gap", "amplitude"])
    assert kind is None or verdict.kind == kind
    assert len(verdict.boundaries) == 4
    assert str(verdict).startswith("oscillator")
    assert "nan" not in str(verdict)
    stored = json.loads(json.dumps(verdict.to_dict(), allow_nan=False))
    assert stored["motion"]["name"] == verdict.motion.name


def test_a_motion_that_outlasts_its_budget_is_told_as_such():
    hasty = vi.Tolerances(flight_periods=1.0, steps_per_impact=1)
    verdict = vi.describe(RARE, parameters=["omega"], tolerances=hasty)
    assert verdict.kind == "budget"
    assert "raise `flight_periods` or `steps_per_impact`" in " ".join(str(verdict).split())
    assert "none, as the motion from rest was not followed to its end" in " ".join(str(verdict).split())


def test_units_a_million_times_off_change_no_words():
    """Metres and seconds against micrometres and milliseconds: the same shares, kinds and percentages."""
    plain = vi.ImpactOscillator(omega=1.4)
    small = vi.ImpactOscillator(mass=1.0, damping=10.0, stiffness=1e6, amplitude=1.0, omega=1400.0)
    one, other = (vi.describe(osc, parameters=["omega"]) for osc in (plain, small))
    assert one.motion.name == other.motion.name
    for a, b in zip(one.boundaries, other.boundaries, strict=True):
        assert (a.kind, a.beyond) == (b.kind, b.beyond)
        assert a.change == pytest.approx(b.change, rel=1e-9)


def test_progress_counts_parts_and_can_stop():
    news = []
    whole = vi.describe(
        vi.ImpactOscillator(), parameters=["omega"], progress=lambda done, total, _: news.append((done, total))
    )
    assert whole.complete
    assert news == [(i, 4) for i in (1, 2, 3, 4)]
    partial = vi.describe(vi.ImpactOscillator(), parameters=["omega"], progress=lambda done, total, _: False)
    assert not partial.complete
    assert partial.motion.name == "period-1 impact-1"
    assert "before the end" in str(partial)


def test_the_work_of_a_verdict_is_bounded(fast, chaotic):
    assert fast.cells <= 15_000
    assert chaotic.cells <= 20_000


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"parameters": ["omga"]}, "did you mean 'omega'"),
        ({"parameters": ["gap", "gap"]}, "drop the repeated one"),
        ({"within": 0.0}, "`within` must be above 0 and up to 1000, got 0.0"),
        ({"within": "far"}, "`within` must be above 0 and up to 1000, got 'far'"),
        ({"units": {"gpa": "mm"}}, "unknown parameter 'gpa'"),
        ({"units": {"gap": "s"}}, "`units['gap']` must be a unit that m can be turned into, got 's'"),
        ({"units": {"gap": 5}}, "`units['gap']` must be a unit that m can be turned into, got 5"),
        ({"units": {"restitution": "mm"}}, "`units['restitution']` must be 1 or %, got 'mm'"),
        ({"units": "mm"}, '`units` must be units by parameter, such as {"gap": "mm"}, got \'mm\''),
    ],
)
def test_a_wrong_request_names_the_argument_and_the_remedy(arguments, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        vi.describe(vi.ImpactOscillator(), **arguments)


def test_only_an_oscillator_is_described():
    with pytest.raises(ValueError, match="`osc` must be an ImpactOscillator, an ImpactSystem or a family, got 3"):
        vi.describe(3)


# Two designs


@pytest.fixture(scope="module")
def comparison():
    a, b = vi.ImpactOscillator(omega=1.4), vi.ImpactOscillator(omega=2.0, gap=0.5)
    return vi.compare(a, b, names=("old", "new"), parameters=["omega"])


def test_the_table_is_aligned_and_stars_what_differs(comparison):
    lines = str(comparison).splitlines()
    assert lines[0].split() == ["old", "new"]
    second = lines[0].index("new")
    starred = [line for line in lines if " *" in line[: lines[0].index("old")]]
    assert [line.split(" [")[0] for line in starred] == ["angular driving frequency", "driving frequency", "gap"]
    (hertz,) = (line for line in lines if line.startswith("driving frequency [Hz]"))
    assert [float(cell) for cell in hertz.split()[-2:]] == pytest.approx([0.7 / np.pi, 1.0 / np.pi], rel=1e-5)
    assert all(line[second - 1] == " " and line[second] != " " for line in lines[:20])
    assert any(line.startswith("motion") and "period-1 impact-1" in line and "no impact" in line for line in lines)


def test_the_spreads_of_cycles_are_zero_and_not_rounding(comparison):
    rows = {line.split(" [")[0].split("  ")[0]: line.split() for line in str(comparison).splitlines()}
    for spread in ("standard deviation of impact velocities", "spread of the impact phases"):
        assert rows[spread][-2] == "0"


def test_a_comparison_holds_both_verdicts(comparison):
    data = comparison.dataset
    assert data["design"].values.tolist() == ["old", "new"]
    assert data["gap"].values.tolist() == [0.0, 0.5]
    for i, verdict in enumerate(comparison.verdicts):
        assert verdict.to_dict() == vi.describe(verdict.oscillator, parameters=["omega"]).to_dict()
        for name in INDICES:
            np.testing.assert_equal(float(data[name][i]), verdict.indices[name])
        down = float(data["boundary"].sel(parameter="omega", direction=-1)[i])
        assert down == edge(verdict, "omega", -1).value
    assert data["power"].attrs["units"] == "W"
    assert set(comparison.to_dict()) == {"old", "new"}


def test_a_family_is_described_and_compared_by_its_own_parameters():
    verdict = vi.describe(shaker)
    assert verdict.oscillator == shaker.at()
    assert {b.parameter for b in verdict.boundaries} == {"unbalance", "rpm", "clearance_mm"}
    assert verdict.motion == vi.describe(shaker.at(), parameters=[]).motion
    up = edge(verdict, "rpm", 1)
    assert up.exact
    assert up.kind == "period_doubling"
    assert up.beyond in {attractor.name for attractor in vi.attractors(shaker.replace(rpm=up.beyond_at))}
    for advice in verdict.advice:
        changed = shaker.replace(**{advice.parameter: advice.value}).at()
        assert hardest_hit(changed) <= advice.max_velocity * (1.0 + 1e-6)
    assert f"clearance_mm {shaker.values['clearance_mm']:g} mm" in " ".join(str(verdict).split())
    assert json.loads(json.dumps(verdict.to_dict(), allow_nan=False))["model"]["rpm"] == 1500.0
    two = vi.compare(shaker, shaker.replace(rpm=1200.0), parameters=["rpm"])
    assert two.dataset["rpm"].values.tolist() == [1500.0, 1200.0]
    assert "rpm [1/min] *" in str(two)


def test_a_family_is_varied_no_further_than_it_makes_designs():
    @vi.family
    def clamp(squeeze=0.5):
        return vi.ImpactOscillator(restitution=1.0 - squeeze)

    varied = range_of(clamp, "squeeze", 3.0)
    assert varied.low == 0.125
    assert 0.99 < varied.high <= 1.0


def test_two_designs_need_two_names():
    osc = vi.ImpactOscillator()
    for names in (("A", "A"), ("A",), "AB", (1, 2)):
        with pytest.raises(ValueError, match="`names` must be two different names"):
            vi.compare(osc, osc, names=names)


def test_boundaries_of_two_designs_are_compared_by_parameter_and_direction():
    """A family has other parameters than an oscillator: a row, and a place in the dataset, is for one of them."""
    ball = vi.family(vi.models.bouncing_ball)
    osc = vi.ImpactOscillator(omega=2.0)
    both = Comparison(("A", "B"), (vi.describe(osc, parameters=["omega"]), vi.describe(ball, parameters=["amplitude"])))
    rows = dict(re.findall(r"^(.*?)  +(.*)$", str(both), re.MULTILINE))
    (loud,) = (row for name, row in rows.items() if re.fullmatch(r"amplitude \[.*\], up to", name))
    assert loud.split()[0] == rows["omega [rad/s], up to"].split()[-1] == "-"
    data = both.dataset
    assert data["parameter"].values.tolist() == ["omega", "amplitude"]
    for at, verdict in enumerate(both.verdicts):
        for edge in verdict.boundaries:
            there = data["boundary"].sel(parameter=edge.parameter, direction=edge.direction)
            assert there.values[at] == pytest.approx(edge.value, nan_ok=True)
            assert np.isnan(there.values[1 - at])
            kind = data["boundary_kind"].sel(parameter=edge.parameter, direction=edge.direction)
            assert kind.attrs["flag_meanings"].split()[kind.values[at]] == edge.kind


def test_the_figure_shows_both_designs_from_either_kind_of_input(comparison):
    figures = [
        comparison_figure(comparison.dataset),
        comparison_figure([verdict.oscillator for verdict in comparison.verdicts], names=("old", "new")),
    ]
    for figure in figures:
        assert len(figure.axes) == 6
        titles = [ax.get_title() for ax in figure.axes[:2]]
        assert titles[0].startswith("old: period-1 impact-1 from rest")
        assert titles[1].startswith("new: no impact from rest")
        assert figure.axes[2].get_xlim() == figure.axes[3].get_xlim()
        matplotlib.pyplot.close(figure)


def test_the_figure_refuses_what_is_no_pair_of_designs():
    with pytest.raises(ValueError, match="`designs` must be .* got an ImpactOscillator"):
        comparison_figure(vi.ImpactOscillator())


def test_a_range_holds_the_present_value_and_stays_within_what_is_allowed():
    rng = np.random.default_rng(5)
    for _ in range(200):
        osc = vi.ImpactOscillator(
            damping=float(rng.choice([0.0, 0.1])),
            amplitude=float(rng.choice([0.0, 1.0])),
            restitution=float(rng.choice([0.0, 0.5, 1.0])),
            gap=float(rng.choice([0.0, -3.0, 0.2])),
        )
        for name in PARAMETERS:
            varied = range_of(osc, name, float(rng.uniform(0.1, 5.0)))
            assert varied.low <= asdict(osc)[name] <= varied.high
            for direction in (-1, 1):
                path = varied.path(direction, 12)
                assert path == sorted(path, reverse=direction < 0)
                for value in path:
                    osc.replace(**{name: value})
