"""What impacts do to supports: sums of momentum and energy, groups of stops, round obstacles as facets."""

import math
import re

import numpy as np
import pytest

import vibroimpact as vi
from systems import drawn, impacts, two_sided
from vibroimpact.report import sentences_of


def test_one_mass_gives_the_same_statistics_as_an_oscillator_and_as_a_system():
    osc = vi.ImpactOscillator(omega=2.8, gap=0.1)
    hits = vi.impact_section(osc, sample_impacts=400)
    one, other = vi.impact_statistics(osc, sample_impacts=400), vi.impact_statistics(osc.system, sample_impacts=400)
    for name in set(one) - {"number", "status"}:
        np.testing.assert_allclose(one[name].values, other[name].values, rtol=1e-6, err_msg=name)
    speeds = hits["velocity"].values[1:]
    duration = float(hits["time"][-1] - hits["time"][0])
    assert one["mean_force"].item() == pytest.approx(osc.mass * 1.8 * speeds.sum() / duration, rel=1e-12)
    assert one["power"].item() == pytest.approx(0.5 * osc.mass * (1 - 0.8**2) * (speeds**2).sum() / duration, rel=1e-12)
    assert one["number"].values.sum() == len(speeds) == one["impacts"].item()


@pytest.mark.parametrize("seed", range(6))
def test_the_energy_that_enters_a_settled_motion_is_what_dampers_and_stops_take(seed):
    """The stops' power is that of the force less that of the damper, both from the motion over time."""
    rng = np.random.default_rng([42, seed])
    model = two_sided(rng.uniform(2.0, 4.0), rng.uniform(0.5, 0.8), rng.uniform(0.1, 0.5))
    motion = vi.simulate(model, skip_periods=2000, periods=400, samples_per_period=2000)
    v, t = motion["velocity"].values[:, 0], motion["time"].values
    supplied = np.trapezoid(v * np.sin(model.omega * t), t) / (t[-1] - t[0])
    damped = 0.05 * np.trapezoid(v * v, t) / (t[-1] - t[0])
    statistics = vi.impact_statistics(motion)
    assert statistics["power"].values.sum() == pytest.approx(supplied - damped, rel=0.01)


def test_a_cycle_is_counted_exactly_however_many_impacts_are_kept():
    damper = vi.models.impact_damper(particles=1)
    counts = vi.impact_statistics(vi.impact_section(damper, transient_impacts=4000, sample_impacts=401))
    assert counts["impacts_per_period"].values.tolist() == pytest.approx([1.0, 1.0], rel=1e-6)
    assert counts["impacts"].values.tolist() == [200, 200]


def test_rebounds_within_the_rest_time_are_one_burst():
    """A ball thrown up from its table: flights get shorter by r, so only the first ones begin bursts."""
    stop = vi.Stop(direction=-1.0, gap=0.0, restitution=0.5, name="table")
    ball = vi.ImpactSystem(mass=1.0, stiffness=0.0, force=vi.Force(omega=1.0, constant=-10.0), stops=[stop])
    hits = impacts(ball, 12, start=vi.State(0.0, 4.0))
    flights = np.diff(hits["time"].values)
    for rest_time in (0.0, 0.15, 0.3, 1.0):
        found = vi.impact_statistics(hits, rest_time=rest_time)
        assert found["impacts"].item() == 11
        assert found["bursts"].item() == 1 + int((flights[1:] >= rest_time).sum())


@pytest.mark.parametrize("frequency", [3.0, 3.5, 4.0])
def test_a_table_carries_the_weight_of_a_ball_in_impacts_and_rests_together(frequency):
    """The table throws a ball of 2 kg up once per period and catches it, by an inelastic impact or after a chatter."""
    table = vi.Stop(direction=-1.0, gap=0.0, restitution=0.2, motion={1: 0.03}, name="table")
    weight = vi.Force(frequency=frequency, constant=-2.0 * 9.81)
    ball = vi.ImpactSystem(mass=2.0, stiffness=0.0, force=weight, stops=[table])
    for motion in (vi.simulate(ball, skip_periods=20, periods=30), vi.impact_section(ball)):
        found = vi.impact_statistics(motion)
        assert 0.0 < found["rest_fraction"].item() < 1.0
        carried = found["rest_force"].item() + found["mean_force"].item()
        assert carried == pytest.approx(2.0 * 9.81, rel=1e-5)
    names = "rest_force", "mean_force"
    assert {found[name].attrs["units"] for name in names} == {"N"}


def test_contacts_with_compliant_stops_give_their_impulse_force_and_time():
    """Undamped: each contact turns the momentum round, lasts pi sqrt(m/k) and reaches v sqrt(k m)."""
    pair = [vi.Stop(direction=a, gap=0.5, stiffness=4e4, name=name) for a, name in ((1.0, "right"), (-1.0, "left"))]
    model = vi.ImpactSystem(mass=2.0, stiffness=0.0, force=vi.Force(omega=1.0), stops=pair)
    found = vi.impact_statistics(impacts(model, 41, start=vi.State(0.0, 3.0)))
    half = math.pi * math.sqrt(5e-5)
    known = {"mean_impulse": 12.0, "peak_force": 3.0 * math.sqrt(8e4), "mean_contact_time": half, "power": 0.0}
    for name, value in known.items():
        assert found[name].values == pytest.approx([value, value], rel=1e-9, abs=1e-12)
    wait = 1.0 / 3.0 + half
    assert found["rate"].values == pytest.approx([1.0 / (2.0 * wait)] * 2, rel=1e-9)


def grouped(model):
    """Return a system whose stops are all of one support."""
    return vi.ImpactSystem(**model.arguments() | {"stops": [stop.replace(group="all") for stop in model.stops]})


@pytest.mark.parametrize("seed", range(8))
def test_a_group_has_the_sum_of_its_stops_and_changes_no_motion(seed):
    model, _, _ = drawn(np.random.default_rng([43, seed]), of_any_kind=bool(seed % 2), number=4)
    if seed % 2 == 0:
        model = vi.ImpactSystem(**model.arguments() | {"damping": model.damping + 0.02 * model.stiffness})
    one, other = (vi.impact_section(each, sample_impacts=60) for each in (model, grouped(model)))
    np.testing.assert_array_equal(one["time"].values, other["time"].values)
    if len(one["time"]) < 2:
        return
    together, apart = vi.impact_statistics(other), vi.impact_statistics(one)
    assert together["stop"].values.tolist() == ["all"]
    assert vi.impact_statistics(other, by="stop")["stop"].values.tolist() == list(model.stop_names)
    for name in ("impacts", "rate", "mean_force", "power"):
        assert together[name].item() == pytest.approx(apart[name].sum().item(), rel=1e-12)
    assert together["max_velocity"].item() == pytest.approx(apart["max_velocity"].max().item(), rel=1e-15)
    assert (together["number"].sum("stop") == apart["number"].sum("stop")).all()
    assert len(sentences_of(together)) == 2


def test_groups_survive_files_and_new_numbers(tmp_path):
    model = grouped(two_sided())
    hits = vi.impact_section(model, sample_impacts=20)
    vi.save(hits, tmp_path / "hits.nc")
    again = vi.dataset.model_of(vi.load(tmp_path / "hits.nc"))
    assert again == model != two_sided()
    assert again.replace(above_gap=0.4).groups == ("all", "all")


def test_a_verdict_tells_the_impacts_of_a_support_together_and_those_that_are_not_struck_in_one_line():
    far = [vi.Stop(direction=side, gap=99.0, name=name) for side, name in ((1.0, "wall"), (-1.0, "fence"))]
    near = [stop.replace(group="support") for stop in two_sided(5.0, 0.8, 0.05).stops]
    model = vi.ImpactSystem(**two_sided(5.0, 0.8, 0.05).arguments() | {"stops": [*near, *far]})
    words = str(vi.describe(model, parameters=[]))
    assert "support: 2 impacts per cycle" in words
    assert "wall and fence: none" in words


def billiard(sides, q, v, r, count):
    """Return the first impacts of a free point in a polygon: times, sides, places."""
    t, found = 0.0, []
    normals, gaps = (np.array([stop.direction for stop in sides]), np.array([stop.gap for stop in sides]))
    for _ in range(count):
        rates = normals @ v
        waits = np.where(rates > 1e-12, (gaps - normals @ q) / np.where(rates > 1e-12, rates, 1.0), np.inf)
        at = int(waits.argmin())
        t, q = t + waits[at], q + waits[at] * v
        v = v - (1.0 + r) * rates[at] * normals[at]
        found.append((t, sides[at].name, q))
    return found


@pytest.mark.parametrize("facets", [3, 8, 16, 61])
def test_a_point_in_a_ring_of_facets_moves_as_in_a_polygon_and_stays_within_the_error_of_the_circle(facets):
    rng = np.random.default_rng(facets)
    ring = vi.round_obstacle([1.0, 0.0], [0.0, 1.0], clearance=0.7, facets=facets, restitution=0.9, name="casing")
    model = vi.ImpactSystem(mass=2.0 * np.eye(2), stiffness=np.zeros((2, 2)), force=vi.Force(omega=1.0), stops=ring)
    q, v = rng.uniform(-0.2, 0.2, 2), rng.normal(size=2)
    known = billiard(ring, q, v, 0.9, 12)
    hits = impacts(model, 12, start=vi.State(q, v))
    np.testing.assert_allclose(hits["time"].values, [time for time, _, _ in known], rtol=1e-11)
    assert hits["stop"].values.tolist() == [name for _, name, _ in known]
    for angle, (_, _, place) in zip(hits["angle"].values, known, strict=True):
        radius, where = math.hypot(*place), math.degrees(math.atan2(place[1], place[0]))
        assert 0.7 * (1.0 - 1e-12) <= radius <= 0.7 * (1.0 + vi.facet_error(facets)) * (1.0 + 1e-12)
        assert abs((angle - where + 180.0) % 360.0 - 180.0) <= 180.0 / facets + 1e-9
    assert vi.impact_statistics(hits)["stop"].values.tolist() == ["casing"]


def test_a_round_obstacle_of_named_points_is_that_of_their_directions():
    shapes = np.array([[0.4, 0.0], [0.0, 0.5]])
    ring = vi.round_obstacle({"x": 1.0}, {"y": 1.0}, clearance=1e-3, facets=6, first_at=30.0)
    force = vi.Force(frequency=19.0, harmonics={1: {"x": 1.0, "y": 1j}})
    rotor = vi.ImpactSystem.from_modes([20.0, 20.0], 0.01, shapes, points=["x", "y"], force=force, stops=ring)
    assert rotor.groups == ("ring",) * 6
    for stop in rotor.stops:
        angle = math.radians(stop.angle)
        np.testing.assert_allclose(stop.direction, [0.4 * math.cos(angle), 0.5 * math.sin(angle)], atol=1e-15)


def stopped(*stops):
    return vi.ImpactSystem(mass=1.0, stiffness=1.0, force=vi.Force(omega=1.0), stops=stops)


def sides(group):
    return [vi.Stop(direction=a, gap=1.0, name=name, group=group) for a, name in ((1.0, "a"), (-1.0, "b"))]


BAD = [
    (lambda: vi.round_obstacle([1, 0], [0, 1], clearance=1e-3, facets=2), "`facets` must be a whole number >= 3"),
    (lambda: vi.round_obstacle([1, 0], [2, 0], clearance=1e-3), "`x` and `y` must be two different directions"),
    (lambda: vi.round_obstacle([1, 0], [0, 1, 0], clearance=1e-3), "the same length, got 2 and 3 numbers"),
    (lambda: vi.round_obstacle([1, 0], [0, 1], clearance=0.0), "`clearance` must be > 0"),
    (lambda: vi.round_obstacle([1, 0], {"y": 1.0}, clearance=1.0), "both sequences of numbers, or both mappings"),
    (lambda: vi.facet_error(2), "`facets` must be a whole number >= 3"),
    (lambda: stopped(vi.Stop(direction=1.0, gap=1.0, group="one")), "`group` 'one' has only one stop, 'stop_1'"),
    (lambda: stopped(*[vi.Stop(direction=1.0, gap=1.0)] * 2), "'stop_1' and 'stop_2' are at the same place"),
    (lambda: stopped(*sides("c"), vi.Stop(direction=2.0, gap=1.0, name="c")), "'c' is also the name of a stop"),
    (lambda: vi.Stop(direction=1.0, gap=1.0, group="two words"), "`group` must be a word"),
    (lambda: stopped(*(vi.Stop(direction=1.0, gap=0.1 * at) for at in range(65))), "at most 64"),
    (lambda: vi.impact_statistics(vi.simulate(two_sided(), periods=1), by="side"), "`by`"),
    (lambda: vi.impact_statistics(two_sided(), classes=[2.0, 1.0]), "ascending edges"),
    (lambda: vi.impact_statistics(two_sided(), rest_time=-1.0), "`rest_time`"),
    (lambda: vi.impact_statistics(two_sided(gap=99.0)), "at least two impacts, got 0"),
    (lambda: vi.impact_statistics(vi.stroboscopic_section(two_sided())), "`source` must be a model, or a result of"),
]


@pytest.mark.parametrize(("call", "words"), BAD)
def test_what_makes_no_sense_is_refused_in_words(call, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        call()
