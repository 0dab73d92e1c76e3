"""How far a motion is from another one: boundaries against 50-digit values, closed forms and other functions."""

import numpy as np
import pytest

import vibroimpact as vi
from designs import random_oscillator
from systems import on_springs, pushed, pushed_pair, two_sided
from texts import edge, text_of
from vibroimpact.verdict.ranges import range_of

END_OF_STICKING = 0.34718041326569626  # of the default oscillator, rad/s
FAST = vi.ImpactOscillator(omega=2.0)
STICKS = vi.ImpactOscillator(
    damping=0.036507953860658415, omega=2.436481885540036, restitution=0.5131638170127344, gap=0.26418326107434165
)


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


@pytest.mark.parametrize(
    ("parameter", "span"), [("mass", (0.25, 4.0)), ("stiffness", (0.25, 4.0)), ("gap", (-3.0, 3.0))]
)
def test_the_boundaries_of_an_orbit_are_the_nearest_special_points_of_its_branch(parameter, span):
    verdict, present = vi.describe(FAST, parameters=[parameter]), FAST.values[parameter]
    branch = vi.continue_orbit(verdict.orbit, parameter, span, virtual=False)
    below = [point.value for point in branch.special if point.value < present]
    above = [point.value for point in branch.special if point.value > present]
    assert edge(verdict, parameter, -1).value == pytest.approx(max(below), rel=1e-11)
    assert edge(verdict, parameter, 1).value == pytest.approx(min(above), rel=1e-11)


@pytest.mark.long
def test_boundaries_are_those_that_a_branch_meets_in_other_steps():
    verdict = vi.describe(two_sided(2.0, 0.6, 0.5), parameters=["omega"])
    down, up = verdict.boundaries
    branch = vi.continue_orbit(verdict.orbit, "omega", (1.3, 3.8), step=0.04, virtual=False)
    assert [point.kind for point in branch.special] == ["pitchfork", "fold", "grazing"]
    below, above = branch.special[:2]  # the last graze lies beyond the fold, on unstable orbits
    assert (down.kind, down.value) == (below.kind, pytest.approx(below.value, rel=1e-11))
    assert (up.kind, up.value) == (above.kind, pytest.approx(above.value, rel=1e-11))
    (row,) = (row for row in str(verdict).splitlines() if row.startswith("  omega [rad/s]"))
    assert row.endswith(f" {up.what}")
    assert row.split()[2:4] == [f"{down.value:.6g}", down.what + ";" * bool(down.beyond)]
    assert f"  -{100 * (1 - down.value / 2):.2g} %" in str(verdict)


@pytest.mark.usefixtures("modal_engine")
@pytest.mark.parametrize(
    ("model", "parameter"),
    [(FAST, "amplitude"), (pushed, "force"), (pushed_pair, "force")],
    ids=["one mass", "as a system", "two masses"],
)
def test_at_gap_zero_the_force_only_changes_the_size(model, parameter):
    verdict = vi.describe(model, parameters=[parameter])
    assert not edge(verdict, parameter, -1).found
    assert not edge(verdict, parameter, 1).found


def test_a_bisected_boundary_parts_motions_of_different_names():
    osc, count = vi.ImpactOscillator(omega=2.8), 0
    for boundary in vi.describe(osc, parameters=["omega", "restitution"]).boundaries:
        assert boundary.kind == "change"
        assert 0.0 < boundary.half_width < 1e-5
        assert boundary.accuracy.startswith("to within")
        there = osc.replace(**{boundary.parameter: boundary.beyond_at})
        starts = [vi.State(there.gap, 0.3, phase * there.period) for phase in (0.1, 0.35, 0.6, 0.85)]
        after = {"transient_impacts": 10_000, "sample_impacts": 5000}
        hits = [vi.impact_section(there, start=start, **after) for start in starts]
        assert boundary.beyond in {vi.recognise(section, longest=512).name for section in hits}
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
    assert f"at least {0.5 - osc.steady_amplitude:.3g} m clear of the stop" in text_of(verdict)
    assert edge(verdict, "gap", -1).value == pytest.approx(osc.steady_amplitude, rel=1e-14)


def test_a_mass_pressed_for_ever_is_lifted_off_where_the_force_is_the_preload():
    verdict = vi.describe(vi.ImpactOscillator(gap=-2.0))
    lifted = {b.parameter: b.value for b in verdict.boundaries if b.found}
    assert verdict.kind == "stuck_forever"
    assert lifted == pytest.approx({"stiffness": 0.5, "amplitude": 2.0, "gap": -1.0}, rel=1e-14)


@pytest.mark.parametrize(("gap", "restitution"), [(0.1, 0.8), (0.1, 1.0), (0.0, 1.0), (-0.1, 1.0)])
def test_a_free_undamped_mass_has_no_boundaries(gap, restitution):
    """No motion attracts others, whatever the parameters: a table of them would say nothing."""
    design = vi.ImpactOscillator(damping=0.0, amplitude=0.0, gap=gap, restitution=restitution)
    text = text_of(vi.describe(design, parameters=["gap"], workers=1))
    assert "boundaries not sought: without load and damping, energies are kept between impacts" in text
    assert "no boundary" not in text


def test_an_orbit_that_ends_where_it_was_born_is_said_to_halve():
    down, _ = vi.describe(vi.ImpactOscillator(omega=2.68), parameters=["omega"]).boundaries
    assert (down.kind, round(down.value, 8)) == ("period_halving", 2.65392352)
    assert down.beyond == "period-1 impact-1"


@pytest.mark.long
def test_an_orbit_of_two_units_ends_where_both_are_struck_at_once():
    # Which comes first decides what the other one meets: there the motion jumps, and the orbit does not go on.
    model = vi.models.two_unit_impact_damper()
    verdict = vi.describe(model, parameters=["omega"])
    low, high = (edge.value for edge in verdict.boundaries)
    assert [edge.kind for edge in verdict.boundaries] == ["impacts_merge"] * 2
    branch = vi.continue_orbit(verdict.orbit, "omega", (0.999 * low, 1.001 * high))
    for orbit, value, inwards in ((branch.orbits[0], low, 1e-6), (branch.orbits[-1], high, -1e-6)):
        assert orbit.value("omega") == pytest.approx(value, rel=1e-10)
        half = 0.5 * orbit.system.period
        displacement, velocity, _ = orbit.motion(np.array([half]))
        start = vi.State(displacement=displacement[0], velocity=velocity[0], time=half)
        inside = model.replace(omega=value * (1.0 + inwards))
        section = vi.impact_section(inside, start=start, transient_impacts=4000, sample_impacts=9)
        apart = np.diff(section["time"].values) / inside.at().period
        i = int(np.argmin(apart))
        assert 0.0 < apart[i] < 1e-3
        assert section["stop"].values[i] != section["stop"].values[i + 1]


# Sticking


@pytest.mark.parametrize(("osc", "name"), [(STICKS, "omega"), (STICKS, "gap"), (FAST.replace(omega=0.3), "omega")])
def test_up_to_its_end_sticking_is_of_the_same_period(osc, name):
    verdict, present = vi.describe(osc, parameters=[name]), osc.values[name]
    n = verdict.motion.n_periods
    for end in verdict.boundaries:
        last = end.value if end.found else end.searched_to
        for share in np.linspace(0.0, 1.0, 13)[:-1]:
            there = osc.replace(**{name: present + share * (last - present)})
            assert [orbit.n_periods for orbit in vi.find_orbit(there, n_periods=n, n_impacts=-1)] == [n], (share, end)


@pytest.mark.long
def test_sticking_of_random_designs_hardly_ever_ends_before_its_boundary():
    """At 12 values spaced evenly up to it, and at 24 that come ever closer to the present one."""
    random, wrong, tried = np.random.default_rng(1313), [], 0
    shares = [*np.linspace(0.0, 1.0, 13)[1:-1], *0.5 ** np.arange(1, 25)]
    while tried < 12:
        osc = random_oscillator(random)
        if vi.recognise(vi.impact_section(osc, transient_impacts=1000, sample_impacts=400)).kind != "sticking":
            continue
        verdict = vi.describe(osc, parameters=["omega", "damping"], workers=1)
        if verdict.orbit is None or not verdict.orbit.sticks:
            continue
        tried += 1
        n = verdict.orbit.n_periods
        for end in verdict.boundaries:
            present, last = osc.values[end.parameter], end.value if end.found else end.searched_to
            there = [osc.replace(**{end.parameter: present * (last / present) ** share}) for share in shares]
            if not all(vi.find_orbit(design, n_periods=n, n_impacts=-1) for design in there):
                wrong.append((osc, end.kind, n))
    assert len(wrong) <= 1, wrong


# Ranges


def test_a_family_is_varied_no_further_than_it_makes_designs():
    @vi.family
    def clamp(squeeze=0.5):
        return vi.ImpactOscillator(restitution=1.0 - squeeze)

    varied = range_of(clamp, "squeeze", 3.0)
    assert varied.low == 0.125
    assert 0.99 < varied.high <= 1.0


def some_designs():
    rng = np.random.default_rng(5)
    for _ in range(200):
        yield vi.ImpactOscillator(
            damping=float(rng.choice([0.0, 0.1])),
            amplitude=float(rng.choice([0.0, 1.0])),
            restitution=float(rng.choice([0.0, 0.5, 1.0])),
            gap=float(rng.choice([0.0, -3.0, 0.2])),
        )
    for seed in range(20):
        yield on_springs(np.random.default_rng(seed))


def test_a_range_holds_the_present_value_and_stays_within_what_is_allowed():
    rng = np.random.default_rng(6)
    for design in some_designs():
        for name, present in design.values.items():
            varied = range_of(design, name, float(rng.uniform(0.1, 5.0)))
            assert varied.low <= present <= varied.high
            for direction in (-1, 1):
                path = varied.path(direction, 12)
                assert path == sorted(path, reverse=direction < 0)
                for value in path:
                    design.replace(**{name: value})
