"""Pictures of motions show the coordinate or stop asked for, with walls, corners, impacts and rests where they are."""

import numpy as np
import pytest

import vibroimpact as vi
from systems import two_masses

pytestmark = pytest.mark.usefixtures("modal_engine")

SHORT = {"transient_impacts": 20, "sample_impacts": 30}
GAPS = [0.02, 0.04, 0.06]


def _points(ax, label):
    (line,) = (line for line in ax.get_lines() if str(line.get_label()).endswith(label))
    return line.get_xydata()


def test_one_coordinate_between_two_stops_is_drawn_with_both_walls_and_impacts_on_each(shown):
    motion = vi.simulate(vi.models.two_sided_oscillator(), periods=6)
    ax = shown.time_history(motion)
    for name, place in (("left", -1e-3), ("right", 1e-3)):
        marks = _points(ax, f"on {name}")
        assert len(marks) == (motion["impact_stop"] == name).sum()
        assert marks[:, 1] == pytest.approx(place, rel=1e-12)
    low, high = ax.get_ylim()
    assert low < -1e-3 < 1e-3 < high
    assert {"left", "right"} <= {text.get_text() for text in ax.texts}


def test_the_clearance_of_a_stop_reaches_zero_at_its_impacts_and_its_rate_turns(shown):
    motion = vi.simulate(two_masses(), periods=6)
    ax = shown.phase_portrait(motion, stop="baffle")
    bars = next(entry for entry in ax.collections if "on baffle" in str(entry.get_label())).get_segments()
    speed = motion["impact_velocity"].values[motion["impact_stop"].values == "baffle"]
    np.testing.assert_allclose([bar[0] for bar in bars], np.column_stack([0 * speed, -speed]), atol=1e-12)
    np.testing.assert_allclose([bar[1] for bar in bars], np.column_stack([0 * speed, 0.8 * speed]), atol=1e-12)
    assert "u_" in ax.get_xlabel()
    assert "dot u" in ax.get_ylabel()


@pytest.mark.parametrize("stop", [None, "table"])
def test_a_moving_stop_is_drawn_where_it_is_at_every_impact(shown, stop):
    """The state drawn just after an impact is that of a sample taken there."""
    motion = vi.simulate(vi.models.bouncing_ball(restitution=0.8), periods=4, samples_per_period=500)
    ax = shown.time_history(motion, stop=stop)
    marks = _points(ax, "on table")
    place = motion["clearance"].sel(stop="table") if stop else motion["displacement"].isel(coordinate=0)
    near = np.interp(marks[:, 0], motion["time"], place)
    np.testing.assert_allclose(marks[:, 1], near, atol=4e-6)


def test_a_coordinate_shows_only_the_stops_that_act_on_it_alone(shown):
    ax = shown.time_history(vi.simulate(two_masses(), periods=6), coordinate=1)
    assert [text.get_text() for text in ax.texts] == ["bar"]
    assert ax.get_ylabel() == "coordinate 1 $q_\\mathrm{1}$ [m]"


@pytest.mark.parametrize("seed", range(4))
def test_the_line_of_a_coordinate_has_the_corner_of_every_impact_whichever_stop_is_struck(shown, seed):
    """Two modes that every stop strikes together; a chord from sample to sample would cut a corner by up to 1e-2."""
    random = np.random.default_rng(seed)
    mass, along = random.uniform(0.5, 2.0, 2), random.uniform(0.3, 1.0, 2)
    stops = [
        vi.Stop(direction=along, gap=0.2, restitution=0.7, name="far"),
        vi.Stop(direction=[-along[0], along[1]], gap=0.3, restitution=0.5, motion={1: 0.05}, name="near"),
        vi.Stop(direction=-along, gap=0.4, stiffness=50.0, name="soft"),
    ]
    force = vi.Force(omega=1.3, harmonics={1: random.uniform(0.3, 1.0, 2)})
    pair = vi.ImpactSystem(
        mass=np.diag(mass), damping=0.1 * np.eye(2), stiffness=np.diag([1.0, 7.0]), force=force, stops=stops
    )
    motion, truth = (vi.simulate(pair, periods=6, samples_per_period=number) for number in (100, 10_000))
    assert set(motion["impact_stop"].values) == {"far", "near", "soft"}
    for shows in ({"coordinate": 0}, {"coordinate": 1}, {"stop": "far"}):
        time, place = shown.time_history(motion, **shows).lines[0].get_data()
        assert np.isin(motion["impact_time"].values, time).all()
        values = truth["clearance"].sel(stop="far") if "stop" in shows else truth["displacement"].isel(**shows)
        assert float(np.abs(np.interp(truth["time"], time, place) - values).max()) < 1e-4 * np.ptp(place)


def test_the_bar_of_a_rest_moves_with_its_stop(shown):
    """The mass lies on the table: a sample taken during a rest is on the bar, and so is its rate in the portrait."""
    ball = vi.models.bouncing_ball()
    motion = vi.simulate(ball, periods=6)
    along = {}
    for picture in (shown.time_history, shown.phase_portrait):
        (bars,) = (entry for entry in picture(motion).collections if "table is closed" in str(entry.get_label()))
        along[picture] = np.concatenate(bars.get_segments())
    time, place = along[shown.time_history].T
    rate = along[shown.phase_portrait][:, 1]
    rests = zip(motion["stick_time"].values, motion["release_time"].fillna(motion["time"][-1]).values, strict=True)
    resting = np.any([(motion["time"] >= begin) & (motion["time"] <= end) for begin, end in rests], axis=0)
    assert resting.sum() > 100
    samples = motion.isel(time=np.flatnonzero(resting), coordinate=0)
    size = np.ptp(motion["displacement"].values)
    np.testing.assert_allclose(
        np.interp(samples["time"], time, place), samples["displacement"], rtol=0, atol=1e-4 * size
    )
    size = np.ptp(motion["velocity"].values)
    np.testing.assert_allclose(np.interp(samples["time"], time, rate), samples["velocity"], rtol=0, atol=1e-3 * size)
    assert np.ptp(place) > 0.5 * 2 * abs(ball.stops[0].motion[1])


def test_rests_are_drawn_at_the_stop_that_is_closed(shown):
    ax = shown.time_history(vi.simulate(vi.models.bouncing_ball(), periods=6), stop="table")
    (bars,) = (entry for entry in ax.collections if "table is closed" in str(entry.get_label()))
    assert all((bar[:, 1] == 0.0).all() for bar in bars.get_segments())


def test_the_impact_map_names_the_stops(shown):
    ax = shown.impact_map(vi.impact_section(vi.models.tube_in_supports(), sample_impacts=200))
    names = [text.get_text().partition(" on ")[2] for text in ax.get_legend().get_texts()]
    assert names == list(vi.models.tube_in_supports().stop_names)


def test_the_stroboscopic_map_shows_the_coordinate_asked_for(shown):
    looks = vi.stroboscopic_section(two_masses(), sample_periods=300)
    for at in (0, 1):
        points = _points(shown.stroboscopic_map(looks, coordinate=at), "periods")
        assert np.array_equal(points[:, 0], looks["displacement"].isel(coordinate=at))


def test_maps_and_diagrams_of_systems_carry_symbols_and_units(shown):
    how = {"omega": [7.0, 8.0], "bar_gap": [0.04, 0.05], "sample_impacts": 20}
    ax = shown.index_contour(vi.parameter_map(two_masses(), **how))
    assert ax.get_ylabel() == "gap of bar $g_\\mathrm{bar}$ [m]"
    ax = shown.bifurcation_diagram(vi.bifurcation_diagram(two_masses(), bar_gap=GAPS, **SHORT))
    assert ax.get_xlabel() == "gap of bar $g_\\mathrm{bar}$ [m]"
    assert "$g_\\mathrm{baffle}$ = 0.02 m" in ax.get_title()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"stop": "wall"}, "`stop` must be one of|unknown stop 'wall'|'wall'"),
        ({"coordinate": 2}, "`coordinate` must be less than the number of coordinates"),
        ({"coordinate": 0, "stop": "bar"}, "give either `coordinate` or `stop`, not both"),
    ],
)
def test_a_picture_refuses_what_the_system_has_not(shown, more, words):
    with pytest.raises(ValueError, match=words):
        shown.phase_portrait(vi.simulate(two_masses(), periods=1), **more)


def test_a_picture_of_one_mass_may_show_the_clearance_of_its_one_stop(shown):
    motion = vi.simulate(vi.ImpactOscillator(), periods=1)
    with pytest.raises(ValueError, match="unknown `stop` 'bar'; choose from stop"):
        shown.phase_portrait(motion, stop="bar")
    assert shown.time_history(motion, stop="stop").get_ylabel() == "clearance of stop $u_\\mathrm{stop}$ [m]"
