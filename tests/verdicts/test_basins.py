"""Which initial conditions lead to which motion: portraits over planes of impacts and of states."""

import itertools
import json
import math

import numpy as np
import pytest
import xarray as xr

import vibroimpact as vi
from contents import names_of_starts
from designs import RARE, random_oscillator
from systems import THREE, TWINS, changed, linear, random_pair, two_sided
from vibroimpact.coexistence import striking
from witness import follow

TWO = vi.ImpactOscillator(omega=3.0)  # a cycle and a sticking orbit
CHAOS = vi.ImpactOscillator(omega=3.0, restitution=0.9, gap=0.05)  # chaos and period-4 impact-3
PHASE, VELOCITY = np.linspace(0.0, 1.0, 41), np.linspace(0.0, 3.0, 41)
IMPACTS = {"phase": PHASE, "velocity": VELOCITY}
STATES = {"displacement_1": np.linspace(-0.2, 0.2, 7), "velocity_1": np.linspace(-2.0, 2.0, 7)}
PLANES = {"one mass": (TWO, IMPACTS), "two masses": (THREE, STATES)}


@pytest.fixture(scope="module")
def portrait():
    return vi.basins(TWO, **IMPACTS)


def impact_of_one_mass(phase, velocity):
    return vi.State(TWO.gap, velocity, phase * TWO.period)


def state_of_one_mass(displacement, velocity):
    return vi.State(displacement, velocity, 0.25 * TWO.period)


def state_of_two_masses(displacement, velocity):
    return vi.State([0.0, displacement], [0.0, velocity])


def test_a_finer_portrait_at_omega_3_says_the_same(portrait):
    assert portrait["attractor"].dims == ("phase", "velocity")
    assert portrait["attractor"].attrs["flag_meanings"] == "undecided period-2_impact-2 period-6_sticking"
    assert float(portrait["share"].sum()) == 1.0
    assert float(portrait["share"][1]) == pytest.approx(1 / 8, abs=0.01)
    counted = [(portrait["attractor"] == number).mean() for number in (0, 1)]
    np.testing.assert_array_equal(portrait["share"], counted)


def test_a_start_on_a_cycle_costs_some_600_steps(portrait):
    assert portrait.attrs["steps_computed"] / portrait["attractor"].size < 700


@pytest.mark.parametrize(
    ("model", "plane"),
    [(TWO, IMPACTS), (THREE, {"phase": PHASE[::5], "velocity": VELOCITY[::5], "stop": "left"})],
    ids=PLANES,
)
def test_phase_0_and_phase_1_are_the_same_starts(model, plane):
    found = vi.basins(model, **plane)["attractor"]
    assert len(np.unique(found)) > 1
    np.testing.assert_array_equal(found[0], found[-1])


@pytest.mark.parametrize(
    ("model", "plane", "every"),
    [
        (TWO, {"phase": PHASE, "velocity": VELOCITY[::2]}, (4, 2)),
        (CHAOS, {"phase": PHASE, "velocity": VELOCITY[::2]}, (4, 2)),
        (THREE, STATES, (2, 2)),
    ],
    ids=["sticking", "chaos", "two masses"],
)
def test_a_finer_grid_keeps_what_becomes_of_the_starts_they_share(model, plane, every):
    fine = vi.basins(model, **plane)
    coarse = vi.basins(model, **{name: plane[name][::step] for name, step in zip(plane, every, strict=True)})
    shared = tuple(slice(None, None, step) for step in every)
    np.testing.assert_array_equal(names_of_starts(fine)[shared], names_of_starts(coarse))
    np.testing.assert_array_equal(fine["status"][shared], coarse["status"])


@pytest.mark.parametrize(
    ("model", "axes", "near"), [(*PLANES["one mass"], 0.0), (*PLANES["two masses"], 1e-14)], ids=PLANES
)
def test_threads_change_no_bit_nor_does_the_order_of_axes_change_a_label(model, axes, near):
    first, second = axes
    plain, alone = (vi.basins(model, **axes, **more) for more in ({}, {"workers": 1}))
    xr.testing.assert_identical(alone, plain)
    turned = vi.basins(model, **dict(reversed(axes.items())), workers=1)
    assert turned["attractor"].dims == (second, first)
    xr.testing.assert_allclose(turned.transpose(first, ...), plain.transpose(first, ...), rtol=near, atol=near)
    assert turned.attrs == plain.attrs


@pytest.mark.parametrize(
    ("model", "larger", "plane"),
    [
        (CHAOS, CHAOS.replace(amplitude=2.0, gap=2.0 * CHAOS.gap), {"phase": PHASE[::4], "velocity": VELOCITY[::4]}),
        (THREE, changed(THREE, length=2.0), STATES),
    ],
    ids=PLANES,
)
def test_a_portrait_scales_with_force_and_gap(model, larger, plane):
    one = vi.basins(model, **plane)
    two = vi.basins(larger, **{name: (1.0 if name == "phase" else 2.0) * plane[name] for name in plane})
    np.testing.assert_array_equal(one["attractor"], two["attractor"].values)
    np.testing.assert_array_equal(2.0 * one["max_velocity"], two["max_velocity"].values)
    np.testing.assert_array_equal(4.0 * one["dissipation"], two["dissipation"].values)


@pytest.mark.parametrize(
    ("model", "plane", "start"),
    [
        (TWO, {"phase": PHASE[3::9], "velocity": VELOCITY[::8]}, impact_of_one_mass),
        (
            TWO,
            {"displacement": np.linspace(-2.0, 0.0, 5), "velocity": np.linspace(-1.0, 1.0, 4), "phase": 0.25},
            state_of_one_mass,
        ),
        (THREE, {name: values[::2] for name, values in STATES.items()}, state_of_two_masses),
    ],
    ids=["impacts of one mass", "states of one mass", "states of two masses"],
)
def test_the_attractor_of_a_start_is_the_motion_that_it_alone_leads_to_and_that_its_impacts_show(model, plane, start):
    portrait = vi.basins(model, **plane)
    labels, (first, second) = names_of_starts(portrait), portrait["attractor"].dims
    for (i, a), (j, b) in itertools.product(enumerate(plane[first]), enumerate(plane[second])):
        (one,) = vi.attractors(model, [start(a, b)])
        section = vi.impact_section(model, start=start(a, b), sample_impacts=1500)
        assert [one.name.replace(" ", "_"), vi.recognise(section).name.replace(" ", "_")] == [labels[i, j]] * 2


def test_impacts_on_a_stop_are_the_nearest_states_that_strike_it():
    begun = vi.State([0.1, 0.05], [0.3, -0.2])
    plane = {"phase": np.array([0.1, 0.6]), "velocity": np.array([0.4, 1.5, 2.5])}
    portrait = vi.basins(THREE, **plane, stop="left", start=begun)
    stop = THREE.stops[1]
    towards = np.linalg.solve(THREE.mass, stop.direction)
    towards = towards / (stop.direction @ towards)
    for i, phase in enumerate(plane["phase"]):
        for j, v in enumerate(plane["velocity"]):
            q = np.array(begun.displacement) + (stop.gap - stop.direction @ begun.displacement) * towards
            rate = np.array(begun.velocity) + (v - stop.direction @ begun.velocity) * towards
            start = vi.State(q, rate, phase * THREE.period)
            first = vi.impact_section(THREE, start=start, transient_impacts=0, sample_impacts=1)
            assert str(first["stop"][0].item()) == "left"
            assert float(first["velocity"][0]) == pytest.approx(v, rel=1e-12)
            (one,) = vi.attractors(THREE, [start])
            assert one.name.replace(" ", "_") == names_of_starts(portrait)[i, j]


def test_a_portrait_marks_where_its_attractors_lie(portrait):
    cycle = vi.attractors(TWO)[0]
    np.testing.assert_allclose(portrait["point_phase"][0, :2], cycle.phases, rtol=0, atol=1e-9)
    np.testing.assert_allclose(portrait["point_velocity"][0, :2], cycle.velocities, rtol=0, atol=1e-9)
    assert int(portrait["point_phase"][0].count()) == 2
    look = vi.basins(TWO, displacement=[-1.0, -0.5], velocity=[0.0, 0.5], phase=0.25)
    there = names_of_starts(look)[0, 0].replace("_", " ")
    known = next(one for one in vi.attractors(TWO) if one.name == there)
    row = look.isel(attractor_id=int(look["attractor"][0, 0]))
    y, v = (row[name].dropna("point").values for name in ("point_displacement", "point_velocity"))
    assert len(y) == known.n_periods
    leads = vi.attractors(TWO, [vi.State(a, b, 0.25 * TWO.period) for a, b in zip(y, v, strict=True)])
    assert [one.name for one in leads] == [there]


def irregular_portraits():
    """Yield two random oscillators with chaos, or rests now and then, each with a portrait."""
    random, found = np.random.default_rng(8), 0
    while found < 2:
        osc = random_oscillator(random)
        portrait = vi.basins(osc, phase=[0.1, 0.45, 0.8], velocity=[0.2, 1.1])
        if {"chaotic", "intermittent_sticking"} & set(names_of_starts(portrait).ravel()):
            found += 1
            starts = itertools.product(portrait["phase"].values.tolist(), portrait["velocity"].values.tolist())
            yield osc, portrait, [vi.State(osc.gap, velocity, phase * osc.period) for phase, velocity in starts]


def test_initial_conditions_have_the_same_attractors_in_a_list_and_in_a_portrait():
    plane = {"displacement_1": [-0.2, 0.0, 0.1], "velocity_1": [-1.0, 1.5]}
    states = [state_of_two_masses(*pair) for pair in itertools.product(*plane.values())]
    for model, portrait, starts in (*irregular_portraits(), (THREE, vi.basins(THREE, **plane), states)):
        listed, labels = vi.attractors(model, starts), names_of_starts(portrait)
        assert [attractor.name.replace(" ", "_") for attractor in listed] == sorted(
            set(labels.ravel()) - {"undecided"}, key=lambda name, labels=labels: -(labels == name).sum()
        )
        np.testing.assert_array_equal(portrait["share"], [attractor.share for attractor in listed])


@pytest.mark.parametrize(
    ("model", "plane"),
    [
        (RARE, {"phase": [0.2, 0.7], "velocity": [1.0, 2.0]}),
        (two_sided(0.95, 0.8, 6.0), {"displacement": [0.0, 5.0], "velocity": [1.0, 20.0]}),
    ],
    ids=["one mass", "one mass between stops"],
)
def test_a_start_out_of_budget_is_undecided_and_says_so(model, plane):
    found = vi.basins(model, **plane, tolerances=vi.Tolerances(flight_periods=1.0, steps_per_impact=1))
    assert (found["attractor"] == -1).all()
    assert (found["status"] == vi.Status.BUDGET).all()


@pytest.mark.parametrize(
    ("model", "axes"),
    [
        (TWO, {"phase": np.linspace(0, 1, 300), "velocity": np.linspace(0.1, 3, 300)}),
        (TWINS, {"displacement": np.linspace(-0.05, 0.05, 80), "velocity": np.linspace(-1.0, 1.0, 80)}),
    ],
    ids=["one mass", "one mass between stops"],
)
def test_a_sweep_that_is_stopped_returns_what_it_has(model, axes):
    news = []

    def stop(done, total, partial):
        news.append((done, total, partial["status"].shape))
        return False

    found = vi.basins(model, **axes, workers=1, progress=stop)
    done, total, shape = news[0]
    side = len(axes["velocity"])
    assert 0 < done < total == side**2
    assert shape == (side, side)
    interrupted = found["status"] == vi.Status.INTERRUPTED
    assert (found["attractor"].values[interrupted] == -1).all()
    assert float(found["share"].sum()) == pytest.approx(1.0 - float(interrupted.mean()), abs=1e-12)
    assert 0.0 < float(interrupted.mean()) < 1.0


@pytest.mark.long
def test_the_witness_leads_to_the_same_attractors():
    plane = {name: values[::3] for name, values in STATES.items()}
    labels, tried = names_of_starts(vi.basins(THREE, **plane)), set()
    for i, y in enumerate(plane["displacement_1"]):
        for j, v in enumerate(plane["velocity_1"]):
            motion = follow(linear(THREE), [0.0, y], [0.0, v], 0.0, impacts=600, most_periods=150)
            phases = [event.time / THREE.period for event in motion.impacts if event.time > 138 * THREE.period]
            label = {0: "no_impact", 36: "period-2_impact-6", 32: "period-3_impact-8"}.get(len(phases), "transient")
            assert label in (labels[i, j], "transient")
            tried.add(label)
    assert {"period-2_impact-6", "period-3_impact-8"} <= tried


# How it is told, and what it costs


def test_a_portrait_says_what_holds_the_other_coordinates_and_comes_back_from_disk(tmp_path):
    begun = vi.State([0.1, 0.0], [0.0, 0.2], 0.25 * THREE.period)
    portrait = vi.basins(THREE, displacement_0=[-0.1, 0.1], velocity_1=[-1.0, 0.5], start=begun)
    assert portrait["attractor"].dims == ("displacement_0", "velocity_1")
    assert portrait["displacement_0"].attrs == {
        "long_name": "displacement of coordinate 0",
        "units": "m",
        "symbol": "q_0",
    }
    assert json.loads(portrait.attrs["arguments"])["phase"] == pytest.approx(0.25)
    assert vi.load(vi.save(portrait, tmp_path / "basins.zarr")).identical(portrait)
    axes = vi.plotting.basin_portrait(portrait)
    assert axes.get_xlabel() == r"displacement of coordinate 0 $q_\mathrm{0}$ [m]"
    assert axes.get_ylabel() == r"velocity of coordinate 1 $\dot q_\mathrm{1}$ [m/s]"
    assert "others of q = (0.1, 0) m, q' = (0, 0.2) m/s" in axes.get_title().replace("\n", " ")
    assert r"\psi/T$ = 0.25" in axes.get_title()


def harvester():
    """Return a two-sided pair: a driven mass on a spring, and a free one under a weight between two stops on it."""
    force = vi.Force(omega=math.pi, harmonics={1: [1.0, 0.0]}, constant=[0.0, -0.12201 * 0.15])
    stops = [vi.Stop(direction=[sign, -sign], gap=0.175, restitution=0.5, name=name) for sign, name in
             ((1, "top"), (-1, "bottom"))]  # fmt: skip
    return vi.ImpactSystem(
        mass=np.diag([1.0, 0.15]),
        damping=np.diag([0.2, 0.0]),
        stiffness=np.diag([math.pi**2, 0.0]),
        force=force,
        stops=stops,
    )


@pytest.fixture
def solutions(monkeypatch):
    """Return the list to which every cycle that is solved for is added."""
    made, solve = [], striking.settled_orbit
    monkeypatch.setattr(striking, "settled_orbit", lambda *given: made.append(given[1:]) or solve(*given))
    return made


def test_a_cycle_of_many_initial_conditions_is_followed_and_solved_for_once(solutions, monkeypatch):
    # Each cell's mean is one over the impacts that its own round kept, also where its cycle was closed early.
    followed, told, follow_on = [], [], striking.follow
    monkeypatch.setattr(striking, "follow", lambda *given: followed.append(told[-1]) or follow_on(*given))
    grid = {"phase": np.linspace(0.0, 1.0, 15), "velocity": np.linspace(0.0, 1.0, 15)}
    portrait = vi.basins(
        harvester(), **grid, stop="top", progress=lambda done, total, partial: told.append((done, total))
    )
    assert portrait["attractor"].attrs["flag_meanings"] == "undecided period-1_impact-5"
    assert (portrait["attractor"] == 0).all()
    assert len(solutions) == len(followed) == 1
    # Not all is done before the attractors are known.
    assert all(done < total == 225 for done, total in followed)
    assert told[-1] == (225, 225)
    assert [done for done, _ in told] == sorted(done for done, _ in told)


@pytest.mark.long(but=4)
@pytest.mark.parametrize("seed", range(0, 24, 3))
def test_no_cycle_is_solved_for_twice(seed, solutions):
    motions = vi.attractors(random_pair(seed))
    assert len(solutions) == sum(attractor.kind == "periodic" for attractor in motions)


def test_an_initial_condition_outside_the_tolerance_joins_the_known_cycle_unsolved(solutions, monkeypatch):
    monkeypatch.setattr(striking, "_members", lambda settled, left, at, seen: left == at)
    starts = [vi.State([0.0, y]) for y in (-0.05, -0.1, 0.05)]
    (found,) = vi.attractors(harvester(), starts)
    assert found.share == 1.0
    assert len(solutions) == 1


IMPACT, STATE = {"phase": [0.1, 0.2], "velocity": [0.5, 1.0]}, {"displacement_0": [0.0, 0.1], "velocity_1": [0.0, 0.1]}


@pytest.mark.parametrize(
    ("model", "axes", "message"),
    [
        (
            TWO,
            {"phase": [0.1, 0.2]},
            r"the axes must be \(displacement, velocity\), .* or \(phase, velocity\), got `phase`",
        ),
        (TWO, {}, "the axes must be .*, got no axis"),
        (TWO, IMPACT | {"displacement": [0.0]}, "the axes must be .*, got `phase`, `velocity`, `displacement`"),
        (TWO, IMPACT | {"gap": [0.0]}, "unknown coordinate 'gap'; choose from displacement, velocity, phase"),
        (TWO, IMPACT | {"phase": [0.1, 1.2]}, "`phase` must be between 0 and 1, got 1.2; give"),
        (TWO, IMPACT | {"velocity": [-0.1, 1.2]}, "`velocity` must be .*>= 0, got -0.1; an impact"),
        (TWO, IMPACT | {"velocity": [1.0, 0.5]}, "`velocity` must increase strictly, .* from 1 to 0.5"),
        (TWO, IMPACT | {"velocity": []}, r"`velocity` must be a one-dimensional, .* list of numbers, got \[\]"),
        (TWO, IMPACT | {"velocity": "fast"}, "`velocity` must be a one-dimensional, .* list of numbers, got 'fast'"),
        (TWO, IMPACT | {"velocity": [0.5, math.nan]}, "`velocity` must be a finite number .*, got nan"),
        (
            TWO,
            {"displacement": [-1.0, 0.5], "velocity": [0.0, 1.0]},
            "the axes must stay in front of all stops, but displacement = 0.5 and velocity = 0 lies beyond 'stop' by",
        ),
        (
            TWO,
            {"displacement": [-1.0, 0.0], "velocity": [0.0], "phase": 1.0},
            "`phase` must be .* less than 1, got 1.0",
        ),
        (TWO, IMPACT | {"workers": 0}, "`workers` must be a whole number >= 1, got 0"),
        (TWO, IMPACT | {"sample_impacts": 0}, "`sample_impacts` must be a whole number >= 1, got 0"),
        (TWO, IMPACT | {"backend": "fixed-step"}, "`backend` must be one that computes n_periods and n_impacts, got"),
        (
            THREE,
            {"displacement_2": [0.0]},
            "unknown coordinate 'displacement_2'; choose from displacement_0, velocity_0",
        ),
        (THREE, {"displacement_0": [0.0, 0.1]}, "the axes must be two of displacement_0, .*, got `displacement_0`"),
        (
            THREE,
            STATE | {"velocity_0": [0.0]},
            "the axes must be two of .*, got `displacement_0`, `velocity_1`, `velocity_0`",
        ),
        (THREE, STATE | {"start": vi.State(0.1)}, "`start` must be a State of 2 coordinates, got State"),
        (THREE, STATE | {"stop": "left"}, r"`stop` applies only to the axes \(phase, velocity\)"),
        (THREE, {"phase": [0.1, 0.2], "velocity": [1.0]}, "`stop` must name the stop that is struck: right, left"),
        (
            THREE,
            {"phase": [0.1], "velocity": [1.0], "stop": "up"},
            "unknown `stop` 'up'|`stop` must be .* 'up'",
        ),
        (THREE, {"phase": [0.1], "velocity": [-1.0], "stop": "left"}, "`velocity` must be .*>= 0, got -1"),
        (
            THREE,
            {"displacement_1": [0.0, 9.0], "velocity_1": [0.0]},
            "displacement_1 = 9 and velocity_1 = 0 lies beyond 'right'",
        ),
        (THREE, STATE | {"backend": "fixed-step"}, "`backend` must be one that computes n_periods and n_impacts"),
    ],
)
def test_a_wrong_request_is_refused_in_one_sentence(model, axes, message):
    with pytest.raises(ValueError, match=message):
        vi.basins(model, **axes)
