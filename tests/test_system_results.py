"""What a user does with motions of systems: diagrams, files, stores and pictures."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest
import xarray as xr

import systems as make
import vibroimpact as vi
from contents import differing
from systems import one_mass, random_pair, two_masses
from vibroimpact import models
from vibroimpact.dataset import model_of
from vibroimpact.kernels.shared.series import SIZE
from vibroimpact.kernels.shared.trough import trough
from vibroimpact.motion import motion_name
from vibroimpact.report import sentences_of

pytestmark = pytest.mark.usefixtures("modal_engine")

OSC = vi.ImpactOscillator(damping=0.1, restitution=0.5, gap=0.5)
SHORT = {"transient_impacts": 20, "sample_impacts": 30}
GAPS = [0.02, 0.04, 0.06]


def test_a_simulation_holds_the_impacts_up_to_its_last_sample():
    motion = vi.simulate(vi.models.bouncing_ball(restitution=0.8), periods=4)
    for name in ("impact_time", "stick_time", "release_time"):
        assert not (motion[name] > motion["time"][-1]).any()


# Diagrams


@pytest.mark.parametrize("direction", ["fresh", "up", "down"])
@pytest.mark.parametrize("section", ["impact", "stroboscopic"])
def test_the_diagram_of_one_coordinate_is_that_of_the_oscillator(section, direction):
    how = {"section": section, "direction": direction, "omega": [1.5, 1.6, 1.7], "sample_impacts": 5}
    how |= {"transient_impacts": 300, "transient_periods": 100, "sample_periods": 5}
    one, system = (vi.bifurcation_diagram(model, **how) for model in (OSC, one_mass(OSC)))
    for name in one.data_vars:
        if name != "status":
            np.testing.assert_allclose(system[name], one[name], rtol=1e-9, atol=1e-11)


def test_a_motion_carried_to_the_same_value_goes_on():
    """The next value of an axis that changes nothing starts where the one before ended."""
    whole = vi.impact_section(two_masses(), transient_impacts=0, sample_impacts=12)

    @vi.family
    def unchanged(nothing=0.0):
        return two_masses()

    diagram = vi.bifurcation_diagram(
        unchanged, direction="up", nothing=[0, 1, 2], transient_impacts=0, sample_impacts=4
    )
    for name in ("velocity", "phase"):
        np.testing.assert_allclose(diagram[name].values.ravel(), whole[name], rtol=1e-9)


def test_a_motion_carried_into_stops_starts_before_them():
    wide, narrow = 0.06, -0.019  # the slot is almost closed
    diagram = vi.bifurcation_diagram(two_masses(), direction="down", bar_gap=[narrow, wide], **SHORT)
    assert (diagram["count"] == 30).all()


def test_a_motion_is_carried_to_every_kind_of_end():
    """A free mass that drifts away ends its window early; what follows it is computed."""
    drifting = vi.ImpactSystem(
        mass=1.0, stiffness=0.0, force=vi.Force(omega=1.0, harmonics={1: 1.0}), stops=[vi.Stop(direction=-1, gap=0.1)]
    )
    diagram = vi.bifurcation_diagram(drifting, direction="up", stop_1_gap=[0.1, 0.2], sample_impacts=5)
    assert [vi.Status(int(code)).has_indices for code in diagram["status"]] == [False, False]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"coordinate": 2}, "`coordinate` must be less than the number of coordinates, 2, got 2"),
        ({"coordinate": -1}, "`coordinate` must be a whole number >= 0"),
        ({"backend": "fixed-step"}, "`backend` 'fixed-step' takes only one mass"),
    ],
)
def test_a_diagram_refuses_what_systems_have_not(more, words):
    with pytest.raises(ValueError, match=words):
        vi.bifurcation_diagram(two_masses(), bar_gap=GAPS, **SHORT, **more)


def test_a_diagram_of_a_system_is_summed_up_in_words():
    diagram = vi.bifurcation_diagram(vi.family(vi.models.impact_damper), frequency=[29.0, 30.0], **SHORT)
    assert sentences_of(diagram)[0].startswith("2 values of driving frequency 29 to 30 Hz, each from rest at q = 0")


# Pictures


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


# Files and stores


def test_a_table_of_impacts_names_the_stop_of_each(tmp_path):
    pandas = pytest.importorskip("pandas")
    hits = vi.impact_section(two_masses(), **SHORT)
    table = pandas.read_csv(vi.save(hits, tmp_path / "hits.csv"))
    rows = table[table["stop"].isin(two_masses().stop_names)]
    assert rows["stop"].tolist() == hits["stop"].values.tolist()


MAPS = [
    (two_masses(), {"bar_gap": np.linspace(0.02, 0.06, 100), "omega": [7.0, 8.0]}),
    (vi.family(vi.models.impact_damper), {"clearance": np.linspace(4e-3, 6e-3, 100), "frequency": [29.0, 30.0]}),
]


@pytest.mark.parametrize(("model", "axes"), MAPS, ids=["system", "family"])
def test_a_store_of_systems_goes_on_where_it_stopped_and_ends_with_the_bits_of_memory(run, tmp_path, model, axes):
    how = {**axes, "transient_impacts": 20, "sample_impacts": 200}
    stored = {"store": tmp_path / "map.zarr", "tile": 20, "workers": 1}
    vi.parameter_map(model, **how, **stored, progress=lambda *_: False)
    lines = run("info map.zarr")[1]
    assert "continue with: the same parameter_map(..., store=...) call" in lines
    assert not any(line.startswith("10 of 10") for line in lines)
    vi.parameter_map(model, **how, **stored)
    assert any(line.startswith("10 of 10 tiles done") for line in run("info map.zarr")[1])
    memory, loaded = vi.parameter_map(model, **how), vi.load(tmp_path / "map.zarr")
    assert not differing(memory, loaded, memory.data_vars)


@pytest.mark.parametrize("changed", [{"mass": [[2.0, 0.5], [0.5, 1.1]]}, {"damping": [[0.3, 0.0], [0.0, 0.2]]}])
def test_a_changed_matrix_is_another_study(tmp_path, changed):
    axes = {"bar_gap": GAPS, "store": tmp_path / "map.zarr", **SHORT}
    vi.parameter_map(two_masses(), **axes)
    with pytest.raises(ValueError, match="holds another study"):
        vi.parameter_map(two_masses(**changed), **axes)


@pytest.mark.parametrize(
    "text",
    ["", "7", "{}", '{"mass": 1}', "nothing", '{"mass": [[1.0, 2.0]], "force": 3, "stops": [{}]}', '{"mass": 1e999}'],
)
def test_a_damaged_system_is_refused(tmp_path, text):
    result = vi.impact_section(two_masses(), **SHORT)
    result.attrs["system"] = text
    with pytest.raises(OSError, match="its attribute 'system' is damaged"):
        vi.load(vi.save(result, tmp_path / "result.nc"))


def test_a_result_knows_its_system():
    for system in (two_masses(), vi.models.bouncing_ball(), vi.models.tube_in_supports()):
        assert model_of(vi.simulate(system, periods=1)) == system


def test_indices_by_stop_are_those_of_the_impacts_on_each_stop():
    tube = models.tube_in_supports()
    how = {"sample_impacts": 300, "transient_impacts": 40}
    names = ("std", "mean_velocity", "max_velocity", "impacts_per_period", "dissipation", "impact_phase_spread")
    omega = np.linspace(0.9, 1.1, 3) * tube.omega
    sweep = vi.parameter_map(tube, omega=omega, by_stop=True, indices=(*names, "n_impacts"), **how)
    together = vi.parameter_map(tube, omega=omega, indices=names, **how)
    assert sweep["std"].dims == ("omega", "stop")
    assert sweep["n_impacts"].dims == ("omega",)
    assert sweep["stop"].values.tolist() == list(tube.stop_names)
    for name in ("impacts_per_period", "dissipation"):
        np.testing.assert_allclose(sweep[name].sum("stop"), together[name], rtol=1e-12)
    np.testing.assert_allclose(sweep["max_velocity"].max("stop"), together["max_velocity"], rtol=0)
    for at, value in enumerate(omega):
        section = vi.impact_section(tube.replace(omega=value), **how)
        for stop in tube.stop_names:
            velocity = section["velocity"].values[section["stop"].values == stop]
            found = sweep.isel(omega=at).sel(stop=stop)
            if not velocity.size:
                assert np.isnan(found["std"])
                assert found["impacts_per_period"] == 0.0
                continue
            np.testing.assert_allclose(found["mean_velocity"], velocity.mean(), rtol=1e-9)
            np.testing.assert_allclose(found["std"], velocity.std(), rtol=1e-9, atol=1e-9 * velocity.max())
            np.testing.assert_allclose(found["max_velocity"], velocity.max(), rtol=1e-9)


def test_a_map_of_one_stop_says_in_which_cells_it_is_not_struck(shown):
    """Counted by another index, which is 0 there: impacts per period on that stop."""
    plane = {"omega": np.linspace(0.8, 2.2, 8), "left_gap": np.linspace(0.1, 1.2, 6)}
    names = ("max_velocity", "impact_phase_spread", "impacts_per_period")
    how = {"by_stop": True, "indices": names, "transient_impacts": 300, "sample_impacts": 50}
    sweep = vi.parameter_map(random_pair(4), **plane, **how)
    for stop in ("left", "right"):
        part = sweep.sel(stop=stop)
        count = int((part["impacts_per_period"] == 0.0).sum())
        assert 0 < count < part["status"].size
        for name in names[:2]:
            texts = [text.get_text() for text in shown.index_contour(part, index=name).get_legend().get_texts()]
            assert f"{stop} is not struck ({count} cells)" in texts
            assert "no value" not in " ".join(texts)


def test_the_summary_of_a_map_by_stop_says_which_stops_are_never_struck():
    """Right is out of reach at every speed; where both are struck, the hardest impact has its stop."""
    slot = vi.family(models.two_sided_oscillator)
    how = {"by_stop": True, "indices": ["max_velocity", "impacts_per_period"], "sample_impacts": 50}
    far, near = (
        vi.parameter_map(slot.replace(left_gap=1e-3, right_gap=gap), frequency=[15.0, 20.0], **how)
        for gap in (1.0, 2e-3)
    )
    assert np.isnan(far["max_velocity"].sel(stop="right")).all()
    never = "right is never struck in the impacts kept"
    velocity, rate = (line for line in sentences_of(far) if "(max_velocity)" in line or "(impacts_per" in line)
    assert velocity.endswith(f", on left; {never}")
    assert never not in rate  # 0 is a value
    hardest = near["max_velocity"].max("frequency")
    (line,) = (line for line in sentences_of(near) if "(max_velocity)" in line)
    assert line.endswith(f", on {hardest.idxmax('stop').item()}")


def test_indices_by_stop_are_stored_with_their_stops(tmp_path):
    tube = models.tube_in_supports()
    how = {"omega": np.linspace(0.9, 1.1, 7) * tube.omega, "by_stop": True, "sample_impacts": 50}
    plain = vi.parameter_map(tube, **how)
    stored = vi.parameter_map(tube, **how, store=tmp_path / "run.zarr", tile=3)
    xr.testing.assert_equal(plain["std"], stored["std"].load())
    with xr.open_zarr(tmp_path / "run.zarr", consolidated=False) as opened:
        assert opened["std"].dims == ("omega", "stop")
    vi.save(plain, tmp_path / "run.nc")
    xr.testing.assert_equal(vi.load(tmp_path / "run.nc")["std"], plain["std"])


def test_indices_by_stop_are_not_refined():
    with pytest.raises(ValueError, match="`refine`"):
        vi.parameter_map(models.tube_in_supports(), omega=[1.0, 2.0], by_stop=True, refine=1)


def test_the_share_of_time_at_rest_is_that_of_the_rests():
    """Of the oscillator's cycle, and of a coupled system's rests between a cycle's impacts, stop by stop."""
    stop = [vi.Stop(direction=[1, 0], gap=0.0, restitution=0.4), vi.Stop(direction=[0, 1], gap=0.3, restitution=0.0)]
    pair = make.system(np.eye(2), 0.1 * np.eye(2), [[2, -1], [-1, 2]], 0.3, stop, {1: [1.0, 0.7]})
    how = {"transient_impacts": 300, "sample_impacts": 212}  # the last one is number 2^9
    sweep = vi.parameter_map(pair, omega=[0.3], by_stop=True, indices=("stick_fraction", "n_periods"), **how).isel(
        omega=0
    )
    hits = vi.impact_section(pair, **how)
    periods = int(sweep["n_periods"])
    assert periods > 0
    time = hits["time"].values
    for number, name in enumerate(pair.stop_names):
        rests = hits["stick_stop"].values == name
        begun, ended = hits["stick_time"].values[rests], hits["release_time"].values[rests]
        within = (begun >= time[0]) & (begun < time[0] + periods * pair.period * (1 - 1e-9))
        share = (ended - begun)[within].sum() / (periods * pair.period)
        assert float(sweep["stick_fraction"][number]) == pytest.approx(share, rel=1e-9, abs=1e-12)
    assert float(sweep["stick_fraction"].max()) > 0.1
    for osc in (vi.ImpactOscillator(omega=0.3), vi.ImpactOscillator(omega=2.0)):
        settings = {"omega": [osc.omega], "indices": ("stick_fraction",), "sample_impacts": 400}
        one, system = vi.parameter_map(osc, **settings), vi.parameter_map(one_mass(osc), **settings)
        np.testing.assert_allclose(system["stick_fraction"], one["stick_fraction"], atol=1e-9)


@pytest.mark.parametrize("closing", [True, False])
def test_impacts_per_period_of_a_known_cycle_are_its_own_impacts_over_its_periods(closing):
    """To the last bit, whatever the window; and those of each stop are as many as it has in the cycle."""
    model = two_masses()
    settings = {"omega": np.linspace(1.4, 3, 33) * model.omega, "transient_impacts": 400, "early_closing": closing}
    names = ("impacts_per_period", "n_periods", "n_impacts")
    whole = vi.parameter_map(model, indices=names, sample_impacts=213, **settings)
    apart = vi.parameter_map(model, indices=names, sample_impacts=213, by_stop=True, **settings)
    known = (whole["n_impacts"] > 0).values
    assert known.sum() > 5
    impacts, periods = whole["n_impacts"].values[known], whole["n_periods"].values[known]
    np.testing.assert_array_equal(whole["impacts_per_period"].values[known], impacts / periods)
    each = apart["impacts_per_period"].transpose("omega", "stop").values[known] * periods[:, None]
    np.testing.assert_allclose(each, np.round(each), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(np.round(each).sum(axis=1), impacts)


def test_a_dip_between_two_looks_is_seen():
    """Of a polynomial whose rate rises through zero only within a quarter of the way: near-misses of a step."""
    for low, high in ((0.3, 0.45), (0.55, 0.7), (0.76, 0.99)):
        for sign in (1.0, -1.0):
            rate = np.polynomial.Polynomial.fromroots([low, high]) * sign  # it rises through zero at one of them
            found = rate.integ(k=[1.0])
            a = tuple(np.pad(found.coef, (0, SIZE - len(found.coef))))
            place = high if sign > 0.0 else low
            assert trough(a, 1.0, True, np.inf, 0.0) == pytest.approx((found(place), place), abs=1e-9)


def test_the_closest_miss_is_the_least_clearance_between_impacts():
    """That of the oscillator, and of densely sampled motions of a system, stop by stop."""
    omega = np.linspace(0.4, 2.9, 60)
    settings = {
        "omega": omega,
        "indices": ("grazing_margin", "n_periods"),
        "transient_impacts": 1000,
        "sample_impacts": 99,
    }
    osc = vi.ImpactOscillator(damping=0.1, gap=0.3)
    one, cells = vi.parameter_map(osc, **settings), vi.parameter_map(one_mass(osc), **settings)
    cycles = (one["n_periods"] > 0).values
    assert cycles.sum() > 20
    finite = np.isfinite(one["grazing_margin"].values[cycles])
    assert 3 < finite.sum() < cycles.sum()
    np.testing.assert_allclose(cells["grazing_margin"].values[cycles], one["grazing_margin"].values[cycles], atol=1e-9)

    pair = two_masses()
    how = {"transient_impacts": 500, "sample_impacts": 60}
    names = ("grazing_margin", "n_periods")
    sweep = vi.parameter_map(pair, omega=np.linspace(1.4, 3, 17) * pair.omega, by_stop=True, indices=names, **how)
    compared = 0
    for at in np.flatnonzero(sweep["n_periods"].values > 0):
        cell, periods = sweep.isel(omega=at), int(sweep["n_periods"][at])
        model = pair.replace(omega=float(cell["omega"]))
        motion = vi.simulate(model, periods=300 + periods, samples_per_period=400).isel(
            time=slice(-400 * periods - 2, None)
        )
        clear = motion["clearance"].values
        hits = np.searchsorted(motion["time"].values, motion["impact_time"].values)
        for number in range(len(pair.stops)):
            a, b, c = clear[:-2, number], clear[1:-1, number], clear[2:, number]
            lows = np.flatnonzero((b < a) & (b < c) & (b > 1e-9))
            lows = lows[[np.abs(hits - low - 1).min(initial=9) > 2 for low in lows]]
            vertex = (b - (a - c) ** 2 / (8.0 * (a - 2.0 * b + c)))[lows]  # of the parabola through the three
            assert float(cell["grazing_margin"][number]) == pytest.approx(
                vertex.min(initial=np.inf), abs=1e-6 * np.ptp(clear)
            )
            compared += lows.size > 0
    assert compared > 2


def test_a_map_stop_by_stop_of_a_family_is_drawn_of_one_stop_and_else_asks_for_one():
    machine, index = vi.family(vi.models.idle_gear), "max_velocity"
    axes = {"rpm": [600.0, 850.0], "backlash": [5e-5, 1e-4]}
    sweep = vi.parameter_map(machine, **axes, indices=[index], by_stop=True, transient_impacts=10, sample_impacts=10)
    vi.plotting.index_contour(sweep.sel(stop="drive"), index)
    with pytest.raises(ValueError, match=r"sweep\.sel\(stop='drive'\)"):
        vi.plotting.index_contour(sweep, index)


def test_a_motion_of_a_system_has_the_name_that_a_map_gives_it():
    """Also from an initial condition, which the section holds; periodic, sticking, chaotic ones and none."""
    window, names = {"transient_impacts": 1000, "sample_impacts": 3000}, set()
    needed = ("lyapunov_per_impact", "n_periods", "n_impacts")
    driven = [two_masses(force=vi.Force(omega=omega, harmonics={1: [5.0, 0.0]})) for omega in np.linspace(4.0, 14.0, 8)]
    for model in [*driven, vi.models.bouncing_ball()]:
        start = None if model in driven[::2] else vi.State([0.01] * len(model.mass), [0.2] * len(model.mass), 0.3)
        motion = vi.recognise(vi.impact_section(model, start=start, **window))
        sweep = vi.parameter_map(model, omega=[model.omega], start=start, indices=needed, **window)
        named = vi.classify(sweep)
        name = motion_name(*(int(named[part][0]) for part in ("motion", "n_periods", "n_impacts")))
        assert name in (motion.name, motion.motion_class.stored.label)
        assert not motion.n_impacts > 0 or len(motion.velocities) == len(motion.phases) == motion.n_impacts
        names.add(motion.kind)
    assert {"periodic", "sticking", "chaotic"} <= names


def results_of(design, kind):
    """Yield what the questions about a design return: orbits, a branch, an attractor, a verdict."""
    for n_impacts in (1, -1):
        yield (orbits := vi.find_orbit(design, n_impacts=n_impacts))
        yield from orbits
    yield vi.continue_orbit(
        next(iter(vi.find_orbit(design, **kind))), "omega", (0.9 * design.omega, 1.1 * design.omega)
    )
    yield from vi.attractors(design)
    yield vi.describe(design, parameters=())


@pytest.mark.parametrize(
    "design",
    [
        vi.ImpactOscillator(omega=0.1, gap=0.0),  # it chatters
        vi.ImpactOscillator(omega=0.9),  # its one orbit is inadmissible
        one_mass(vi.ImpactOscillator(omega=0.1), force=vi.Force(omega=0.1, harmonics={1: 1.0})),
        make.two_sided(),
    ],
    ids=lambda design: type(design).__name__,
)
def test_a_result_is_shown_in_some_lines_and_in_a_notebook_as_a_table_with_units(design):
    shown = set()
    for result in results_of(
        design, {} if design.forgets else {"stops": design.stop_names[0], "symmetric": len(design.stops) == 2}
    ):
        assert len(repr(result)) < 4000
        page = ElementTree.fromstring(f"<div>{result._repr_html_().replace('<br>', '<br/>')}</div>")
        assert page.find("p/b").text
        rows = page.findall("table/tr")
        assert len({len(row) for row in rows}) <= 1, "each row has a cell for each head"
        assert len(rows) <= 14
        shown |= {unit for cell in page.iter() for unit in re.findall(r"\[.*?\]", cell.text or "")}
    assert {"[m/s]", "[J]"} <= shown


def test_a_table_says_of_an_inadmissible_orbit_that_it_is_none_and_why():
    (orbit,) = vi.find_orbit(vi.ImpactOscillator(omega=0.9))
    assert "period-1 impact-1, inadmissible" in orbit._repr_html_()
    assert orbit.message.partition("'")[0] in orbit._repr_html_()
