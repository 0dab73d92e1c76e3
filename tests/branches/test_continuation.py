"""Branches of periodic orbits over one parameter: closed forms, 50 digits, and where they end."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from balls import GRAVITY, ball, of_the_ball
from branching import first, shaker, specials, values_of
from contents import special_points
from systems import FORMS, bouncing_ball, chain, changed, one_mass, symmetric_orbit, two_sided
from vibroimpact.orbits import orbit_distance
from vibroimpact.report import sentences_of

pytestmark = pytest.mark.usefixtures("modal_engine")


@pytest.fixture(scope="module")
def along_omega(as_model):
    return vi.continue_orbit(first(as_model=as_model), "omega", (0.9, 4.0), step=0.03)


# Values of 50 digits, and closed forms


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


BRANCHES = {
    "one mass": lambda: vi.continue_orbit(first(), "omega", (0.9, 4.0), step=0.1),
    "one mass as a system": lambda: vi.continue_orbit(first(as_model=one_mass), "omega", (0.9, 4.0), step=0.1),
    "a ball on a table": lambda: vi.continue_orbit(
        vi.find_orbit(ball.replace(amplitude=0.0285))[0], "amplitude", (0.02, 0.04), step=0.1
    ),
    "three masses": lambda: vi.continue_orbit(vi.find_orbit(chain())[0], "bar_gap", (0.4, 0.9), step=0.1),
    "between two stops": lambda: vi.continue_orbit(symmetric_orbit(two_sided()), "omega", (1.0, 2.5), step=0.1),
}


@pytest.mark.parametrize("name", BRANCHES)
def test_every_special_point_satisfies_its_own_condition(name):
    branch = BRANCHES[name]()
    assert len(branch.special) > 1
    for point in branch.special:
        assert point.residual < 1e-12


def test_the_branch_is_the_closed_form_at_every_point(along_omega):
    for orbit in along_omega.orbits[::10]:
        (known,) = vi.find_orbit(orbit.model)
        assert orbit.velocities == pytest.approx(known.velocities, rel=1e-11)
        assert orbit.trace == pytest.approx(known.trace, rel=1e-8)
        assert orbit.admissible == known.admissible


def test_admissible_and_inadmissible_parts_meet_at_the_graze(along_omega):
    (graze,) = values_of(along_omega, "grazing")
    for orbit in along_omega.orbits:
        if abs(orbit.value("omega") - graze) > 1e-9:
            assert orbit.admissible == (orbit.value("omega") > graze)
    assert "inadmissible" in along_omega.message


@pytest.mark.parametrize(("restitution", "n_periods"), [(0.5, 1), (0.25, 2), (0.8, 3)])
def test_the_ball_folds_and_doubles_over_the_amplitude_where_the_closed_form_says(restitution, n_periods):
    fold, doubling = of_the_ball(restitution, n_periods)
    of_gamma = GRAVITY / ball().omega ** 2
    orbit = vi.find_orbit(
        ball.replace(restitution=restitution, amplitude=0.5 * (fold + doubling) * of_gamma), n_periods=n_periods
    )[0]
    branch = vi.continue_orbit(orbit, "amplitude", (0.95 * fold * of_gamma, 1.05 * doubling * of_gamma), step=0.1)
    for kind, gamma in {"fold": fold, "period_doubling": doubling}.items():
        (point,) = special_points(branch, kind)
        assert point.value / of_gamma == pytest.approx(gamma, rel=1e-12)
        assert point.orbit.admissible
    for orbit in branch.orbits:
        assert np.prod(orbit.multipliers) == pytest.approx(orbit.determinant, rel=1e-10)


def test_the_ball_folds_and_doubles_over_the_frequency_where_known():
    (orbit, *_) = vi.find_orbit(bouncing_ball(1.2, omega=3.0))
    branch = vi.continue_orbit(orbit, "omega", (2.7, 3.6), step=0.1)
    gammas = {point.kind: 1.2 * (point.value / 3.0) ** 2 for point in branch.special}
    assert gammas["fold"] == pytest.approx(1.047197551197, abs=1e-12)
    assert gammas["period_doubling"] == pytest.approx(1.526823700519, abs=1e-12)


def test_one_mass_as_a_system_has_the_special_points_of_the_oscillator():
    rng, met = np.random.default_rng(7), 0
    for number in range(3):
        osc = vi.ImpactOscillator(
            omega=rng.uniform(2.2, 2.7), restitution=rng.uniform(0.6, 0.9), damping=rng.uniform(0.0, 0.05)
        )
        known = vi.find_orbit(osc)[0]
        orbit = min(vi.find_orbit(one_mass(osc)), key=lambda other: orbit_distance(other, known))
        axis = ("omega", "gap", "restitution")[number % 3]
        value = osc.values[axis]
        span = {"omega": (2.0, 3.0), "gap": (value - 0.4, value + 0.4), "restitution": (0.3, 1.0)}[axis]
        parameter = axis if axis == "omega" else f"stop_1_{axis}"
        points = specials(vi.continue_orbit(orbit, parameter, span, step=0.1))
        expected = specials(vi.continue_orbit(known, axis, span, step=0.1))
        assert [kind for kind, _ in points] == [kind for kind, _ in expected]
        assert [at for _, at in points] == pytest.approx([at for _, at in expected], rel=1e-10)
        met += len(expected)
    assert met > 2


@pytest.mark.long(but=1)
@pytest.mark.parametrize("how", ["permuted and mirrored, in other units", "a mode more"])
def test_special_points_do_not_depend_on_coordinates(how):
    system = chain()
    if how == "a mode more":
        more = [np.diag([*part.diagonal(), 0.0]) for part in (np.zeros((3, 3)),) * 3]
        for part, grown, entry in zip(
            (system.mass, system.damping, system.stiffness), more, (2.0, 0.1, 3.0), strict=True
        ):
            grown[:3, :3], grown[3, 3] = part, entry
        other = vi.ImpactSystem(
            mass=more[0],
            damping=more[1],
            stiffness=more[2],
            force=vi.Force(omega=0.9, harmonics={1: [1.0, 0.0, 0.0, 0.5]}),
            stops=[vi.Stop(direction=[0, 0, 1, 0], gap=0.5, restitution=0.7, name="bar")],
        )
    else:
        basis = np.diag([0.5, 3.0, -2.0])[[2, 0, 1]]
        other = changed(system, basis=basis)
    branches = [
        vi.continue_orbit(vi.find_orbit(one)[0], f"{one.stop_names[0]}_gap", (0.4, 0.9), step=0.1)
        for one in (system, other)
    ]
    ours, theirs = map(specials, branches)
    assert [kind for kind, _ in ours] == [kind for kind, _ in theirs]
    assert len(ours) > 1
    assert [at for _, at in ours] == pytest.approx([at for _, at in theirs], rel=1e-10)


def over_frequency(name):
    """Return an orbit whose branch over the angular frequency meets a special point, and those of that kind."""
    if name == "between two stops":
        return symmetric_orbit(two_sided()), "pitchfork", (1.05, 2.1), 0.4
    return first(2.6, as_model=FORMS[name]), "period_doubling", (2.5, 2.7), 0.1


@pytest.mark.parametrize("name", [*FORMS, "between two stops"])
def test_a_frequency_in_hertz_and_steps_of_any_length_give_the_same_points(name, values):
    orbit, kind, (low, high), step = over_frequency(name)
    turn = 2 * math.pi
    fine = special_points(vi.continue_orbit(orbit, "omega", (low, high), step=0.05), kind)[0].value
    coarse = vi.continue_orbit(orbit, "frequency", (low / turn, high / turn), step=step)
    assert turn * special_points(coarse, kind)[0].value == pytest.approx(fine, rel=1e-12)
    if kind == "period_doubling":
        assert fine == pytest.approx(float(values["period_doubling_w_of_n=1"][1]["w"]), rel=1e-13)


# Where branches end


def test_without_virtual_orbits_the_branch_ends_at_the_graze(as_model, values):
    branch = vi.continue_orbit(first(1.4, as_model=as_model), "omega", (0.9, 1.5), step=0.05, virtual=False)
    assert branch.outcome == ("grazing", "range")
    assert "grazes the stop" in branch.message
    assert all(orbit.admissible for orbit in branch.orbits)
    assert branch.values[0] == pytest.approx(float(values["grazing_w_of_n=1"][0]["w"]), abs=1e-12)
    assert branch.values[-1] == 1.5


def test_where_a_plastic_mass_is_held_the_branch_ends_at_one_value_whatever_the_steps(as_model):
    """Without restitution the force may hold the mass after its impact: no condition along the branch changes there."""
    orbit = first(2.6, as_model=as_model, restitution=0.0, damping=0.05)
    branches = [vi.continue_orbit(orbit, "omega", (0.5, 4.0), step=step, virtual=False) for step in (0.01, 0.017, 0.04)]
    assert {branch.outcome for branch in branches} == {("inadmissible", "range")}
    ends = [branch.values[0] for branch in branches]
    assert ends == pytest.approx([ends[0]] * 3, rel=1e-9)
    assert all(
        f"omega = {end:.12g} rad/s, where its orbits" in branch.message
        for end, branch in zip(ends, branches, strict=True)
    )


def test_rising_from_a_plastic_impact_is_no_graze():
    osc = vi.ImpactOscillator(omega=1.6, restitution=0.0, damping=0.1, gap=0.3)
    orbit = vi.find_orbit(osc)[0]
    branch = vi.continue_orbit(vi.find_orbit(one_mass(osc))[0], "stop_1_gap", (0.0, 0.7), step=0.1)
    assert specials(branch) == specials(vi.continue_orbit(orbit, "gap", (0.0, 0.7), step=0.1)) == []
    assert branch.orbits[0].admissible == vi.find_orbit(osc.replace(gap=0.0))[0].admissible


@pytest.mark.long
def test_a_branch_that_loses_its_last_contact_ends_where_the_steady_motion_touches_the_stop():
    """x'' + .05 x' + x = sin wt touches where (1 - w^2)^2 + (.05 w)^2 = 1/gap^2; the message and the point agree."""
    gap, damping = 5.8, 0.05
    stops = [vi.Stop(direction=1, gap=gap, stiffness=0.1)]
    soft = vi.ImpactSystem(
        mass=1, damping=damping, stiffness=1, force=vi.Force(omega=1.0, harmonics={1: 1}), stops=stops
    )
    half = 1.0 - 0.5 * damping**2
    squares = half + np.array([-1.0, 1.0]) * np.sqrt(half**2 - 1.0 + 1.0 / gap**2)
    (orbit,) = vi.find_orbit(soft)
    branch = vi.continue_orbit(orbit, "omega", (0.8, 1.3))
    assert branch.outcome == ("grazing", "grazing")
    ends = branch.values[[0, -1]]
    assert ends == pytest.approx(np.sqrt(squares), abs=1e-11)
    assert [point.value for point in special_points(branch, "grazing")] == ends.tolist()
    for low in ends:
        assert f"omega = {low:.12g} rad/s, where it grazes the stop" in branch.message


def test_a_branch_reaches_the_limits_of_restitution_and_damping(as_model):
    orbit = first(2.5, as_model=as_model)
    restitution = next(name for name in orbit.model.values if name.endswith("restitution"))
    branch = vi.continue_orbit(orbit, restitution, (0.0, 1.0), step=0.05)
    assert (branch.values[0], branch.values[-1]) == (0.0, 1.0)
    assert branch.orbits[0].determinant == 0.0
    assert branch.orbits[-1].determinant == pytest.approx(math.exp(-0.01 * 2 * math.pi / 2.5), rel=1e-14)
    branch = vi.continue_orbit(damped(as_model), "damping", (0.0, 0.1), step=0.1)
    assert branch.orbits[0].determinant == pytest.approx(0.64, rel=1e-14)


def damped(as_model):
    """Return the orbit of a family whose parameters are damping and frequency."""

    @vi.family
    def model(damping=0.01, omega=2.5):
        return as_model(vi.ImpactOscillator(omega=omega, damping=damping))

    return vi.find_orbit(model)[0]


def test_a_branch_through_undamped_resonance_is_smooth(as_model):
    branch = vi.continue_orbit(first(1.5, as_model=as_model, damping=0.0), "omega", (0.95, 1.6), step=0.05)
    at_resonance = min(branch.orbits, key=lambda orbit: abs(orbit.value("omega") - 1.0))
    expected = math.pi / 1.8
    assert at_resonance.velocities[0] == pytest.approx(expected, rel=0.2)
    assert branch.outcome == ("range", "range")


def test_a_branch_along_a_familys_parameter_meets_the_same_bifurcation_as_the_tied_oscillators():
    tight = shaker.replace(clearance_mm=0.1)
    (orbit,) = vi.find_orbit(tight)
    branch = vi.continue_orbit(orbit, "rpm", (1450.0, 1600.0), step=0.05)
    (point,) = special_points(branch, "period_doubling")
    assert point.orbit.value("rpm") == point.value
    assert branch.outcome == ("range", "range")
    sides = [vi.find_orbit(tight.at(rpm=point.value + change))[0].stable for change in (-1e-6, 1e-6)]
    assert sorted(sides) == [False, True]
    doubled = vi.switch_branch(point)
    assert (doubled.name, doubled.model.values["clearance_mm"]) == ("period-2 impact-2", 0.1)
    with pytest.raises(ValueError, match="unknown parameter 'omega'; choose from unbalance, rpm, clearance_mm"):
        vi.continue_orbit(orbit, "omega", (1.0, 2.0))


def test_a_branch_ends_where_a_family_makes_no_model_any_more(as_model):
    @vi.family
    def clamp(squeeze=0.2, omega=2.0):
        return as_model(vi.ImpactOscillator(omega=omega, restitution=1.0 - squeeze))

    (orbit,) = vi.find_orbit(clamp)
    branch = vi.continue_orbit(orbit, "squeeze", (0.1, 1.5), step=0.05)
    assert branch.outcome == ("range", "lost")
    assert branch.values[-1] == pytest.approx(1.0, abs=1e-3)
    with pytest.raises(
        ValueError, match=r"clamp fails at squeeze=1.0.*, omega=2: `restitution` must be between 0 and 1"
    ):
        vi.boundary_curves(clamp, ("squeeze", "omega"), ((0.1, 1.5), (2.0, 3.0)), n_periods=(1,), lines=2)


# Results and requests


def test_the_dataset_is_labelled(along_omega):
    data = along_omega.dataset
    assert data["velocity"].dims == ("point", "impact")
    assert data["omega"].dims == ("point",)
    assert data["omega"].attrs["units"] == "rad/s"
    assert data.sizes["special"] == len(along_omega.special)
    meanings = data["special_kind"].attrs["flag_meanings"].split()
    assert [meanings[int(kind)] for kind in data["special_kind"]] == [point.kind for point in along_omega.special]


def test_orbits_of_a_branch_may_be_stopped_on_request(as_model):
    news = []
    branch = vi.continue_orbit(
        first(as_model=as_model),
        "omega",
        (1.5, 4.0),
        progress=lambda done, total, partial: news.append(done) or len(news) < 5,
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
        (("omega", (0, 3)), "`omega` must be .* > 0, got 0"),
    ],
)
def test_a_wrong_request_is_refused_by_name(as_model, arguments, named):
    with pytest.raises(ValueError, match=named):
        vi.continue_orbit(first(as_model=as_model), *arguments)


def test_a_parameter_without_bounds_of_its_own_is_refused_where_no_mass_is():
    with pytest.raises(ValueError, match="`mass` must be .* > 0, got 0"):
        vi.continue_orbit(first(), "mass", (0, 3))


def test_what_is_no_orbit_is_refused(as_model):
    with pytest.raises(ValueError, match="`orbit` must be .*, got 3"):
        vi.continue_orbit(3, "omega", (1, 3))
    with pytest.raises(ValueError, match="`step` must be .*, got 2"):
        vi.continue_orbit(first(as_model=as_model), "omega", (1, 3), step=2)
    wrong = vi.Orbit(vi.ImpactOscillator(), 1, 1, (3.0,), (0.1,), (0j, 0j))
    with pytest.raises(ValueError, match="`orbit` is not periodic"):
        vi.continue_orbit(wrong, "omega", (1, 3))
    folded = vi.continue_orbit(first(1.6, as_model=as_model, gap=3.0), "omega", (1.5, 2)).special[0]
    with pytest.raises(ValueError, match="`point` must be .*, got 'fold'"):
        vi.switch_branch(folded)


@pytest.mark.long
def test_a_branch_along_which_a_contact_is_born_is_named_by_the_impacts_that_it_has():
    pair = two_sided(
        stops=[
            vi.Stop(direction=1, gap=0.2, stiffness=100.0, name="above"),
            vi.Stop(direction=-1, gap=1.4, stiffness=100.0, name="below"),
        ],
        force=vi.Force(omega=2.0, harmonics={1: 1.0}),
    )
    branch = vi.continue_orbit(vi.find_orbit(pair, stops="above")[0], "below_gap", (1.0, 1.5))
    assert {orbit.n_impacts for orbit in branch.orbits} == {1, 2}
    texts = [text.get_text() for text in vi.plotting.branch_diagram(branch).get_legend().get_texts()]
    assert texts[0] == "period-1 impact-1 to impact-2"
    assert "period-1 impact-1 to impact-2: " in sentences_of(branch.dataset)[0]
