"""Branches of periodic orbits: where they turn, double and graze, and what the engine does there."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from contents import special_points


def first(omega=2.0, n_impacts=1, **changes):
    return vi.find_orbit(vi.ImpactOscillator(omega=omega, **changes), n_impacts=n_impacts)[0]


@pytest.fixture(scope="module")
def along_omega():
    return vi.continue_orbit(first(), "omega", (0.9, 4.0), step=0.03)


@pytest.fixture(scope="module")
def doubled():
    branch = vi.continue_orbit(first(2.6), "omega", (2.5, 2.7), step=0.1)
    return vi.continue_orbit(vi.switch_branch(branch.special[-1]), "omega", (2.5, 3.3), step=0.03, virtual=False)


def values_of(branch, kind):
    return [point.value for point in special_points(branch, kind)]


def name_of(orbit, osc=None, nudge=1e-4):
    """Return what the engine calls the motion that begins beside an orbit, maybe under another oscillator."""
    osc = osc or orbit.oscillator
    start = vi.State(osc.gap, orbit.velocities[0] * (1 + nudge), orbit.phases[0] * osc.period)
    return vi.recognise(vi.impact_section(osc, start=start, transient_impacts=4000, sample_impacts=400)).name


def test_period_doublings_agree_with_50_digits(values, along_omega):
    found = values_of(along_omega, "period_doubling")
    for known in values["period_doubling_w_of_n=1"]:
        assert min(found, key=lambda w: abs(w - float(known["w"]))) == pytest.approx(float(known["w"]), rel=1e-13)
    for point in along_omega.special:
        if point.kind == "period_doubling":
            assert 1 + point.orbit.trace + point.orbit.determinant == pytest.approx(0, abs=1e-12)


def test_the_graze_agrees_with_50_digits(values, along_omega):
    (known,) = values["grazing_w_of_n=1"]
    (point,) = special_points(along_omega, "grazing")
    assert point.value == pytest.approx(float(known["w"]), abs=1e-12)
    assert point.orbit.velocities[0] == pytest.approx(float(known["v"]), rel=1e-12)
    after = (point.touch_phase - point.orbit.phases[0]) % 1
    assert after == pytest.approx(float(known["tau_graze_over_T"]), abs=1e-9)
    assert point.orbit.admissible


def test_every_special_point_satisfies_its_own_condition(along_omega, doubled):
    for point in along_omega.special + doubled.special:
        assert point.residual < 1e-12


def test_the_branch_is_the_closed_form_at_every_point(along_omega):
    for orbit in along_omega.orbits[::10]:
        (known,) = vi.find_orbit(orbit.oscillator)
        assert orbit.velocities == pytest.approx(known.velocities, rel=1e-11)
        assert orbit.trace == pytest.approx(known.trace, rel=1e-8)
        assert orbit.admissible == known.admissible


def test_admissible_and_inadmissible_parts_meet_at_the_graze(along_omega):
    (graze,) = values_of(along_omega, "grazing")
    for orbit in along_omega.orbits:
        if abs(orbit.oscillator.omega - graze) > 1e-9:
            assert orbit.admissible == (orbit.oscillator.omega > graze)
    assert "inadmissible" in along_omega.message


def test_without_virtual_orbits_the_branch_ends_at_the_graze(values):
    branch = vi.continue_orbit(first(1.4), "omega", (0.9, 1.5), step=0.05, virtual=False)
    assert branch.outcome == ("grazing", "range")
    assert "grazes the stop" in branch.message
    assert all(orbit.admissible for orbit in branch.orbits)
    assert branch.orbits[0].oscillator.omega == pytest.approx(float(values["grazing_w_of_n=1"][0]["w"]), abs=1e-12)
    assert branch.orbits[-1].oscillator.omega == 1.5


def test_where_a_plastic_mass_is_held_the_branch_ends_at_one_value_whatever_the_steps():
    """Without restitution the force may hold the mass after its impact: no condition along the branch changes there."""
    (orbit,) = vi.find_orbit(vi.ImpactOscillator(omega=2.6, restitution=0.0, damping=0.05))
    branches = [vi.continue_orbit(orbit, "omega", (0.5, 4.0), step=step, virtual=False) for step in (0.01, 0.017, 0.04)]
    assert {branch.outcome for branch in branches} == {("inadmissible", "range")}
    ends = [branch.values[0] for branch in branches]
    assert ends == pytest.approx([ends[0]] * 3, rel=1e-9)
    assert all(
        f"omega = {end:.12g} rad/s, where its orbits" in branch.message
        for end, branch in zip(ends, branches, strict=True)
    )


@pytest.mark.parametrize("omega", [1.1, 2.0, 3.0])
def test_without_a_gap_no_branch_folds(omega):
    for parameter, ends in [("omega", (omega - 0.05, omega + 0.5)), ("restitution", (0.1, 1.0)), ("damping", (0, 1))]:
        branch = vi.continue_orbit(first(omega), parameter, ends, step=0.1)
        assert not values_of(branch, "fold")
        assert branch.outcome == ("range", "range")
        assert (np.diff(branch.values) > 0).all()


def test_a_branch_with_a_gap_turns_at_its_fold_where_the_two_roots_meet():
    """The closed form's roots are one where g^2 = R^2 (1 + (alpha w / beta)^2)."""
    osc = vi.ImpactOscillator(omega=1.2, gap=3.0)
    hit, grazed = vi.find_orbit(osc)
    branch = vi.continue_orbit(hit, "omega", (1.0, 2.0), step=0.02)
    (fold,) = values_of(branch, "fold")
    assert len(vi.find_orbit(osc.replace(omega=fold - 1e-9))) == 2
    assert len(vi.find_orbit(osc.replace(omega=fold + 1e-9))) == 0
    assert max(branch.values) == pytest.approx(fold, rel=1e-14)
    at = int(np.argmin([abs(orbit.velocities[0] - grazed.velocities[0]) for orbit in branch.orbits]))
    assert branch.orbits[at].oscillator.omega == pytest.approx(1.2, abs=0.05)
    (point,) = special_points(branch, "fold")
    assert point.orbit.trace == pytest.approx(1 + point.orbit.determinant, rel=1e-12)


def test_one_impact_is_born_with_velocity_zero_where_the_free_motion_grazes():
    """The unstable orbit ends where the gap is the steady amplitude."""
    branch = vi.continue_orbit(vi.find_orbit(vi.ImpactOscillator(omega=1.2, gap=3.0))[1], "gap", (1.0, 4.0), step=0.02)
    grazes = special_points(branch, "grazing")
    assert grazes[0].value == pytest.approx(vi.ImpactOscillator(omega=1.2).steady_amplitude, rel=1e-13)
    assert grazes[0].orbit.velocities[0] == pytest.approx(0, abs=1e-12)


def test_the_doubled_orbit_is_what_the_engine_settles_on(doubled):
    for omega in (2.66, 2.69):
        near = min(doubled.orbits, key=lambda orbit: abs(orbit.oscillator.omega - omega))
        (orbit,) = vi.find_orbit(near.oscillator.replace(omega=omega), n_periods=2, n_impacts=2, near=near)
        hits = vi.impact_section(orbit.oscillator, transient_impacts=8000, sample_impacts=2)
        assert sorted(hits["velocity"].values) == pytest.approx(sorted(orbit.velocities), rel=1e-10)
        assert orbit.stable


def test_the_doubled_branch_ends_where_it_was_born(values, doubled):
    born = float(values["period_doubling_w_of_n=1"][1]["w"])
    assert doubled.outcome[0] == "period_doubling"
    assert doubled.special[0].value == pytest.approx(born, rel=1e-13)
    assert doubled.special[0].orbit.name == "period-1 impact-1"
    assert doubled.values.min() == pytest.approx(born, abs=2e-3)


def test_the_doubled_orbit_doubles_again_and_the_engine_agrees(doubled):
    second = values_of(doubled, "period_doubling")[1]
    point = next(point for point in doubled.special if point.value == second)
    assert name_of(point.orbit, point.orbit.oscillator.replace(omega=second - 2e-3)) == "period-2 impact-2"
    assert name_of(point.orbit, point.orbit.oscillator.replace(omega=second + 2e-3)) == "period-4 impact-4"
    again = vi.switch_branch(point)
    assert again.name == "period-4 impact-4"
    assert again.determinant == pytest.approx(point.orbit.determinant**2, rel=1e-3)


def test_near_a_doubling_the_square_of_the_split_grows_with_the_parameter(values):
    """A pitchfork: half the split squared, the parameter is a quarter as far."""
    (point,) = vi.continue_orbit(first(2.6), "omega", (2.55, 2.7), step=0.1).special
    far, near = (abs(vi.switch_branch(point, amplitude=a).oscillator.omega - point.value) for a in (2e-3, 1e-3))
    assert far / near == pytest.approx(4.0, rel=1e-2)


def test_two_impacts_a_period_live_between_their_bifurcations():
    branch = vi.continue_orbit(first(0.95, n_impacts=2), "omega", (0.8, 1.1), step=0.02, virtual=False)
    stable = [orbit for orbit in branch.orbits if orbit.stable and orbit.admissible]
    for orbit in stable[:: max(1, len(stable) // 6)]:
        if min(abs(orbit.oscillator.omega - point.value) for point in branch.special) > 2e-3:
            assert name_of(orbit) == "period-1 impact-2"
    for point in branch.special:
        assert point.residual < 1e-12
        inside, outside = (
            name_of(point.orbit, point.orbit.oscillator.replace(omega=point.value + side)) for side in (-2e-3, 2e-3)
        )
        assert inside != outside


def test_where_one_impact_begins_to_graze_a_second_impact_is_born(values):
    """At the graze the orbits with one and with two impacts a period are one, an impact without velocity."""
    branch = vi.continue_orbit(first(0.95, n_impacts=2), "omega", (0.8, 1.1), step=0.05, virtual=False)
    (graze,) = special_points(branch, "grazing")
    known = values["grazing_w_of_n=1"][0]
    assert graze.value == pytest.approx(float(known["w"]), abs=1e-12)
    assert sorted(graze.orbit.velocities) == pytest.approx([0.0, float(known["v"])], abs=1e-11)


def test_three_impacts_fold_even_without_a_gap():
    """That no branch folds without a gap is a law of one impact only."""
    branch = vi.continue_orbit(first(0.6, n_impacts=3), "omega", (0.55, 0.75), step=0.03, virtual=False)
    (point,) = special_points(branch, "fold")
    assert point.orbit.admissible
    assert max(branch.values) == point.value
    beside = point.orbit.oscillator.replace(omega=point.value - 1e-5)
    pair = vi.find_orbit(beside, n_impacts=3)
    assert [orbit.stable for orbit in pair] in ([True, False], [False, False])
    assert (1 - pair[0].trace + pair[0].determinant) * (1 - pair[1].trace + pair[1].determinant) < 0


def test_a_branch_reaches_the_limits_of_restitution_and_damping():
    branch = vi.continue_orbit(first(2.5), "restitution", (0.0, 1.0), step=0.05)
    assert (branch.values[0], branch.values[-1]) == (0.0, 1.0)
    assert branch.orbits[0].determinant == 0.0
    assert branch.orbits[-1].determinant == pytest.approx(math.exp(-0.01 * 2 * math.pi / 2.5), rel=1e-14)
    branch = vi.continue_orbit(first(2.5), "damping", (0.0, 0.1), step=0.1)
    assert branch.orbits[0].determinant == pytest.approx(0.64, rel=1e-14)


def test_a_branch_through_undamped_resonance_is_smooth():
    branch = vi.continue_orbit(first(1.5, damping=0.0), "omega", (0.95, 1.6), step=0.05)
    at_resonance = min(branch.orbits, key=lambda orbit: abs(orbit.oscillator.omega - 1.0))
    expected = math.pi / 1.8
    assert at_resonance.velocities[0] == pytest.approx(expected, rel=0.2)
    assert branch.outcome == ("range", "range")


def test_frequency_stands_for_omega(values):
    turn = 2 * math.pi
    branch = vi.continue_orbit(first(2.6), "frequency", (2.5 / turn, 2.7 / turn), step=0.1)
    assert branch.special[0].value * turn == pytest.approx(float(values["period_doubling_w_of_n=1"][1]["w"]), rel=1e-13)


def test_the_dataset_is_labelled(doubled):
    data = doubled.dataset
    assert data["velocity"].dims == ("point", "impact")
    assert data["omega"].dims == ("point",)
    assert data["omega"].attrs["units"] == "rad/s"
    assert data.sizes["special"] == len(doubled.special)
    assert data["special_kind"].attrs["flag_meanings"].split()[int(data["special_kind"][0])] == "period_doubling"


def test_orbits_of_a_branch_may_be_stopped_on_request():
    news = []
    branch = vi.continue_orbit(
        first(), "omega", (1.5, 4.0), progress=lambda done, total, partial: news.append(done) or len(news) < 5
    )
    assert branch.outcome == ("stopped", "stopped")
    assert 5 <= len(branch.orbits) <= 12


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("omegaa", (1, 3)), "unknown parameter 'omegaa'.*did you mean 'omega'"),
        (("omega", (3, 1)), "`range` must be .*, got .3, 1"),
        (("omega", (2.5, 3)), "`range` must be .*, got .2.5, 3.*widen it"),
        (("omega", 3), "`range` must be two values of omega, got 3"),
        (("mass", (0, 3)), "`mass` must be .* > 0, got 0"),
    ],
)
def test_a_wrong_request_is_refused_by_name(arguments, named):
    with pytest.raises(ValueError, match=named):
        vi.continue_orbit(first(), *arguments)


def test_what_is_no_orbit_is_refused():
    with pytest.raises(ValueError, match="`orbit` must be .*, got 3"):
        vi.continue_orbit(3, "omega", (1, 3))
    with pytest.raises(ValueError, match="`step` must be .*, got 2"):
        vi.continue_orbit(first(), "omega", (1, 3), step=2)
    wrong = vi.Orbit(vi.ImpactOscillator(), 1, 1, (3.0,), (0.1,), (0j, 0j))
    with pytest.raises(ValueError, match="`orbit` is not periodic"):
        vi.continue_orbit(wrong, "omega", (1, 3))
    with pytest.raises(ValueError, match="`point` must be .*, got 'fold'"):
        vi.switch_branch(
            vi.continue_orbit(vi.find_orbit(vi.ImpactOscillator(omega=1.6, gap=3.0))[0], "omega", (1.5, 2)).special[0]
        )
