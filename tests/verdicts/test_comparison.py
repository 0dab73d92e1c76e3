"""Two designs side by side: a table, a dataset and a picture say the same of both."""

import json
import math
import re

import matplotlib
import numpy as np
import pytest

import vibroimpact as vi
from designs import shaker
from systems import one_mass, two_sided
from texts import edge, hardest_hit, line, text_of
from vibroimpact.indices import INDICES
from vibroimpact.report import sentences_of
from vibroimpact.verdict import Comparison

DESIGNS = {
    "one mass": (vi.ImpactOscillator(omega=1.4), vi.ImpactOscillator(omega=2.0, gap=0.5)),
    "one mass between stops": (two_sided(2.0, 0.6, 0.5), two_sided(2.2, 0.6, 0.55)),
}


@pytest.fixture(scope="module", params=DESIGNS)
def comparison(request):
    return vi.compare(*DESIGNS[request.param], names=("old", "new"), parameters=["omega"])


def test_the_table_is_aligned_and_stars_what_differs(comparison):
    lines, (old, new) = str(comparison).splitlines(), (verdict.oscillator for verdict in comparison.verdicts)
    assert lines[0].split() == ["old", "new"]
    second = lines[0].index("new")
    starred = [line.split(" [")[0] for line in lines if " *" in line[: lines[0].index("old")]]
    gaps = [f"gap of {name}" for name in old.stop_names] if len(old.stops) > 1 else ["gap"]
    assert starred == ["angular driving frequency", "driving frequency", *gaps]
    (hertz,) = (line for line in lines if line.startswith("driving frequency [Hz]"))
    shown = [old.omega / (2.0 * np.pi), new.omega / (2.0 * np.pi)]
    assert [float(cell) for cell in hertz.split()[-2:]] == pytest.approx(shown, rel=1e-5)
    assert all(line[second - 1] == " " and line[second] != " " for line in lines[:20])
    (motion,) = (line for line in lines if line.startswith("motion"))
    assert [motion[second:].strip(), motion[lines[0].index("old") : second].strip()] == [
        verdict.motion.name for verdict in reversed(comparison.verdicts)
    ]


@pytest.mark.usefixtures("modal_engine")
@pytest.mark.parametrize("kind", [lambda osc: osc, one_mass], ids=["one mass", "as a system"])
def test_the_spreads_of_cycles_are_zero_and_not_rounding(kind):
    comparison = vi.compare(*map(kind, DESIGNS["one mass"]), names=("old", "new"), parameters=[])
    rows = {line.split(" [")[0].split("  ")[0]: line.split() for line in str(comparison).splitlines()}
    for spread in ("standard deviation of impact velocities", "spread of the impact phases"):
        assert rows[spread][-2] == "0"


def test_a_comparison_holds_both_verdicts(comparison):
    data = comparison.dataset
    assert data["design"].values.tolist() == ["old", "new"]
    for i, verdict in enumerate(comparison.verdicts):
        assert verdict.to_dict() == vi.describe(verdict.oscillator, parameters=["omega"]).to_dict()
        for name, value in verdict.oscillator.values.items():
            assert data[name].values[i] == value
        for name in INDICES:
            np.testing.assert_equal(float(data[name][i]), verdict.indices[name])
        down = float(data["boundary"].sel(parameter="omega", direction=-1)[i])
        assert down == edge(verdict, "omega", -1).value
    assert data["power"].attrs["units"] == "W"
    assert set(comparison.to_dict()) == {"old", "new"}
    assert sentences_of(data)


def test_the_figure_shows_both_designs_from_either_kind_of_input(comparison):
    verdicts = comparison.verdicts
    given = (comparison.dataset, {}), ([verdict.oscillator for verdict in verdicts], {"names": ("old", "new")})
    for designs, names in given:
        figure = vi.plotting.comparison_figure(designs, periods=2, **names)
        assert len(figure.axes) == 6
        for ax, name, verdict in zip(figure.axes[:2], ("old", "new"), verdicts, strict=True):
            assert ax.get_title().startswith(f"{name}: {verdict.motion.name} from rest")
            assert f"{verdict.oscillator.omega:g} rad/s" in ax.get_title()
        assert figure.axes[2].get_ylim() == figure.axes[3].get_ylim()
        if len(verdicts[0].oscillator.stops) == 1:
            assert figure.axes[2].get_xlim() == figure.axes[3].get_xlim()
        else:
            assert all("above" in {text.get_text() for text in ax.texts} for ax in figure.axes[:4])
        matplotlib.pyplot.close(figure)


def test_the_figure_refuses_what_is_no_pair_of_designs():
    with pytest.raises(ValueError, match="`designs` must be .* got an ImpactOscillator"):
        vi.plotting.comparison_figure(vi.ImpactOscillator())


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
        for end in verdict.boundaries:
            there = data["boundary"].sel(parameter=end.parameter, direction=end.direction)
            assert there.values[at] == pytest.approx(end.value, nan_ok=True)
            assert np.isnan(there.values[1 - at])
            kind = data["boundary_kind"].sel(parameter=end.parameter, direction=end.direction)
            assert kind.attrs["flag_meanings"].split()[kind.values[at]] == end.kind


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
    assert f"clearance_mm {shaker.values['clearance_mm']:g} mm" in text_of(verdict)
    assert json.loads(json.dumps(verdict.to_dict(), allow_nan=False))["model"]["rpm"] == 1500.0
    two = vi.compare(shaker, shaker.replace(rpm=1200.0), parameters=["rpm"])
    assert two.dataset["rpm"].values.tolist() == [1500.0, 1200.0]
    assert "rpm [1/min] *" in str(two)


@pytest.fixture(scope="module")
def quiet_from_rest():
    """Two modes of 30 and 110 Hz between stops: nine initial conditions in ten lead to impacts, rest does not."""
    bounce, rates = 0.770821, 2.0 * math.pi * np.array([30.0, 110.0])
    stops = [
        vi.Stop(direction=[-1, -1], gap=6e-4, restitution=bounce, name="left"),
        vi.Stop(direction=[1, -1], gap=8.60185e-4, restitution=bounce, name="right"),
    ]
    force = vi.Force(omega=2.0 * math.pi * 114.739, harmonics={1: [2.2238, 1.1119]})
    return vi.ImpactSystem(
        mass=0.1 * np.eye(2),
        damping=np.diag(0.002 * rates),
        stiffness=np.diag(0.1 * rates**2),
        force=force,
        stops=stops,
    )


def test_a_verdict_a_table_and_a_picture_say_who_hits_where_a_start_from_rest_does_not(quiet_from_rest):
    both = vi.compare(quiet_from_rest, quiet_from_rest.replace(left_gap=2e-3), parameters=[])
    first, second = both.verdicts
    hits = vi.parameter_map(
        quiet_from_rest, omega=[quiet_from_rest.omega], start=257, indices=("max_velocity",), transient_impacts=3000,
        sample_impacts=200,
    )["max_velocity"].values[0, 1:]  # fmt: skip
    share = float(np.isfinite(hits).mean())
    assert share > 0.5
    assert first.motion.name == second.motion.name == "no impact"
    assert first.worst.share == pytest.approx(share, abs=0.02)
    assert first.worst.max_velocity == pytest.approx(np.nanmax(hits), rel=0.2)  # a sample of chaos
    told = f"hits hardest from {100 * first.worst.share:.2g} % of the initial conditions: chaotic"
    assert told in line(first, "motion")
    assert "hits hardest" not in str(second)
    (row,) = (row for row in str(both).splitlines() if row.startswith("hardest hit, from any initial condition [m/s]"))
    assert row.split()[-5:] == [f"({100 * first.worst.share:.2g}", "%", "of", "them)", "0"]
    assert both.dataset["worst_velocity"].values.tolist() == [first.worst.max_velocity, 0.0]
    assert any(words.startswith("  hardest hit from any initial condition: ") for words in sentences_of(both.dataset))
    title = f"from {100 * first.worst.share:.1f} % of initial conditions: chaotic"
    titles = [ax.get_title() for ax in vi.plotting.comparison_figure(both.dataset, periods=2).axes[:2]]
    assert titles[0].split("\n")[:3] == [
        "A: no impact from rest",
        title,
        f"up to {first.worst.max_velocity:.4g} m/s",
    ]
    assert titles[1].split("\n")[0] == "B: no impact from rest"
    assert "initial conditions" not in titles[1]


def test_the_hardest_hit_says_how_many_initial_conditions_are_undecided():
    """Without loss no motion attracts others: those that hit harder go on for ever."""
    lossless = vi.ImpactOscillator(stiffness=1e4, damping=0.0, amplitude=5.0, frequency=20.0, restitution=1.0, gap=1e-3)
    both = vi.compare(lossless, lossless.replace(damping=5.0), parameters=[])
    (row,) = (row for row in str(both).splitlines() if row.startswith("hardest hit, from any initial condition [m/s]"))
    assert "100 % are undecided" in row
    assert both.dataset["undecided"].values.tolist() == [1.0, 0.0]
    assert "100 % undecided" in str(both).splitlines()[-1]
    hard = vi.impact_section(lossless, start=vi.State(0.0, 4.0), transient_impacts=20000).velocity.values.max()
    assert hard > 10.0 * float(both.dataset["worst_velocity"][0])
