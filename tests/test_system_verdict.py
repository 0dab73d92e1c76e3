"""Verdicts on systems: each printed number is derived again by other means."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

import vibroimpact as vi
from differences import derivative
from systems import THREE, TWINS, linear, one_mass, random_pair, two_sided
from vibroimpact.backends.reference.systems import follow
from vibroimpact.report import sentences_of

pytestmark = pytest.mark.usefixtures("modal_engine")

PERIODIC = [0, 2, 6, 10, 17, 18, 19, 22]  # random designs that are periodic from rest


@pytest.fixture(scope="module")
def verdicts():
    return {seed: vi.describe(random_pair(seed), parameters=[]) for seed in PERIODIC}


def numbers(text, before, after=""):
    return [float(found) for found in re.findall(rf"{before}([-\d.e]+){after}", text)]


def line(verdict, title):
    """Return what stands under a title, without breaks."""
    found, here = [], False
    for row in str(verdict).splitlines():
        here = row.startswith(title) or (here and row.startswith(" " * 12))
        found += [row[12:].strip()] * here
    return " ".join(found)


@pytest.mark.parametrize("seed", PERIODIC)
def test_hits_energy_and_period_are_those_of_impacts_from_rest(verdicts, seed):
    verdict, system = verdicts[seed], random_pair(seed)
    n, p = verdict.motion.n_periods, verdict.motion.n_impacts
    hits = vi.impact_section(system, transient_impacts=3000, sample_impacts=p)
    names, speeds, phases = hits["stop"].values, hits["velocity"].values, hits["phase"].values
    assert numbers(line(verdict, "motion"), "repeats every ", " s") == [float(f"{n * system.period:.4g}")]
    text = line(verdict, "hits")
    for stop in system.stop_names:
        own = text.partition(f"{stop}: ")[2]
        struck = names == stop
        if not struck.any():
            assert own.startswith("none")
            continue
        assert int(own.split()[0]) == struck.sum()
        for v, phase in zip(speeds[struck], phases[struck], strict=True):
            if struck.sum() <= 4:
                assert f"{v:.4g} m/s at phase {phase:.3g}" in own
        assert f"{speeds[struck].max():.4g} m/s" in own
    (impulse,) = numbers(text, "largest impulse ", " N s")
    assert impulse == pytest.approx(float(hits["impulse"].max()), rel=1e-3)
    restitution = {stop.name: stop.restitution for stop in system.stops}
    lost = sum(0.5 * (1 - restitution[stop]) * v * kick
               for stop, v, kick in zip(names, speeds, hits["impulse"].values, strict=True)) / n  # fmt: skip
    energy = line(verdict, "energy")
    assert numbers(energy, "", " J lost")[0] == pytest.approx(lost, rel=1e-3)
    assert numbers(energy, "period, ", " W")[0] == pytest.approx(lost / system.period, rel=1e-3)


@pytest.mark.parametrize("seed", PERIODIC)
def test_multipliers_are_those_of_differences_of_the_witness(verdicts, seed):
    verdict, system = verdicts[seed], random_pair(seed)
    orbit, plain = verdict.orbit, linear(system)
    span, begun = verdict.motion.n_periods, orbit.start.time - 1e-3 * system.period
    before = vi.simulate(system, start=orbit.start, periods=span - 1e-3, samples_per_period=1000)
    state = np.concatenate([before[name].values[-1] for name in ("displacement", "velocity")])

    def ended(x):
        end = follow(plain, x[:2], x[2:], begun, impacts=200, most_periods=span).end
        return np.concatenate([end.displacement, end.velocity])

    np.testing.assert_allclose(ended(state), state, rtol=0, atol=1e-7)
    radius = float(np.abs(np.linalg.eigvals(derivative(ended, state, 2e-6))).max())
    text = line(verdict, "stability")
    assert numbers(text, "largest multiplier ")[0] == pytest.approx(radius, rel=2e-3)
    half = -math.log(2.0) * span * system.period / math.log(radius)
    assert numbers(text, "halve every ", " s")[0] == pytest.approx(half, rel=2e-2)
    assert numbers(text, "exponent ", " 1/s")[0] == pytest.approx(-math.log(2.0) / half, rel=5e-3)


@pytest.mark.parametrize("seed", [4, 19])
def test_shares_are_those_of_a_map_from_the_same_initial_conditions(seed):
    verdict, system = vi.describe(random_pair(seed), parameters=[]), random_pair(seed)
    sweep = vi.parameter_map(
        system, omega=[system.omega], start=257, indices=("max_velocity",), transient_impacts=3000, sample_impacts=200
    )
    hardest = np.nan_to_num(sweep["max_velocity"].values[0, 1:])
    shares = [float((np.abs(hardest - motion.max_velocity) < 1e-4).mean()) for motion in verdict.attractors]
    assert shares == [motion.share for motion in verdict.attractors]
    text = line(verdict, "coexisting")
    for motion in verdict.attractors:
        assert f"{100 * motion.share:.3g} %: {motion.name}" in text


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


def test_a_verdict_on_twins_names_the_one_from_rest_and_the_other():
    verdict = vi.describe(TWINS, parameters=[])
    assert {motion.name for motion in verdict.attractors} == {"period-1 impact-2 a", "period-1 impact-2 b"}
    here, other = verdict.attractors
    assert here.from_rest
    assert "hits hardest" not in " ".join(str(verdict).split())  # both hit as hard
    assert {here.stop, other.stop} == {"above", "below"}
    first = vi.impact_section(TWINS, transient_impacts=2000, sample_impacts=2)
    assert str(first["stop"].values[np.argmax(first["velocity"].values)]) == here.stop
    assert line(verdict, "advice") == "no parameter was varied"


def test_a_motion_clear_of_the_stops_says_how_far():
    system = random_pair(5)
    verdict = vi.describe(system, parameters=[])
    settled = vi.simulate(system, start=vi.attractors(system)[0].start, periods=1, samples_per_period=4000)
    nearest = settled["clearance"].min("time")
    words, _, name = line(verdict, "motion").rpartition(" clear of ")
    assert words == f"from rest no impact, at least {float(nearest.min()):.3g} m"
    assert float(nearest.sel(stop=name)) == pytest.approx(float(nearest.min()), rel=1e-6)  # both, here
    assert verdict.max_velocity == 0.0


def test_a_motion_that_rests_says_so_and_needs_no_orbit():
    verdict = vi.describe(vi.family(vi.models.bouncing_ball), parameters=["frequency"])
    assert verdict.motion.name == "period-1 sticking"
    assert "followed by a complete chatter" in " ".join(str(verdict).split())
    assert "not sought: only those of periodic motions" in " ".join(str(verdict).split())
    assert verdict.worst.name == "period-1 impact-1"
    assert f"{100 * verdict.worst.share:.2g} % of the initial conditions" in " ".join(str(verdict).split())
    assert numbers(str(verdict), "hits        hardest ", " m/s") == [float(f"{max(verdict.motion.velocities):.4g}")]


def test_chaos_says_what_is_only_about_so():
    verdict = vi.describe(two_sided(1.5, 0.8, 0.2), parameters=[], progress=lambda *progress: False)  # that from rest
    hits = vi.impact_section(two_sided(1.5, 0.8, 0.2), transient_impacts=3000, sample_impacts=60_000)
    text = line(verdict, "hits")
    assert numbers(text, "about ", " times")[0] == pytest.approx(
        60_000 / (float(hits["time"][-1] - hits["time"][0]) * 1.5 / (2 * math.pi)), rel=0.06
    )
    assert numbers(text, "mean about ", " m/s")[0] == pytest.approx(float(hits["velocity"].mean()), rel=0.06)
    lost = 0.5 * (1 - 0.8**2) * float((hits["velocity"] ** 2).sum()) / float(hits["time"][-1] - hits["time"][0])
    assert numbers(line(verdict, "energy"), "period, ", " W")[0] == pytest.approx(lost, rel=0.1)
    assert verdict.watched > 32_000


@pytest.mark.parametrize(
    ("name", "together"),
    [("chaotic", False), ("period-40 impact-81", False), ("quasi-periodic", True), ("intermittent sticking", True)],
)
def test_only_motions_that_are_not_told_apart_are_said_to_count_as_one(name, together):
    verdict = vi.describe(two_sided(), parameters=[])
    motion = replace(verdict.attractors[0], name=name, share=1.0)
    words = line(replace(verdict, attractors=(motion,)), "coexisting")
    assert "settle to this motion" in words
    assert (f"but all {name} motions count as one" in words) == together


def test_a_mass_that_lies_on_its_stop_rests_there():
    still = vi.models.bouncing_ball(amplitude=1e-6)
    assert "from rest permanently in contact, at rest at table" in " ".join(
        str(vi.describe(still, parameters=[])).split()
    )


def test_a_verdict_is_plain_data_and_two_are_a_table():
    content = json.loads(json.dumps(vi.describe(THREE, parameters=[]).to_dict()))
    assert vi.ImpactSystem(**vi.dataset.model_of(vi.simulate(THREE, periods=1)).arguments()) == THREE
    assert content["system"]["mass"] == THREE.mass.tolist()
    assert len(content["multipliers"]) == 4
    both = vi.compare(TWINS, TWINS.replace(omega=4.6), parameters=[])
    assert "angular driving frequency [rad/s] *" in str(both)
    assert both.dataset["omega"].values.tolist() == [5.0, 4.6]
    assert sentences_of(both.dataset)
    for designs in (both.dataset, [verdict.oscillator for verdict in both.verdicts]):
        axes = np.reshape(vi.plotting.comparison_figure(designs, periods=2).axes, (3, 2))
        assert [ax.get_title().split("\n")[0] for ax in axes[0]] == [
            f"{name}: {verdict.motion.name} from rest" for name, verdict in zip("AB", both.verdicts, strict=True)
        ]
        assert ["5 rad/s" in axes[0, 0].get_title(), "4.6 rad/s" in axes[0, 1].get_title()] == [True, True]
        assert all(TWINS.stop_names[0] in {text.get_text() for text in ax.texts} for ax in axes[:2].flat)


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


@pytest.mark.parametrize("seed", range(4))
def test_others_are_said_to_hit_harder_where_they_do(seed):
    verdict = vi.describe(random_pair(100 + seed), parameters=[])
    others = [motion for motion in verdict.attractors if motion.share and not motion.from_rest]
    hardest = max((motion.max_velocity for motion in others), default=0.0)
    assert ("hits hardest" in " ".join(str(verdict).split())) == (hardest > verdict.max_velocity * (1 + 1e-9))
    here, *rest = verdict.attractors
    unknown = replace(verdict, kind="budget", attractors=(replace(here, max_velocity=math.nan), *rest))
    assert unknown.worst == max(others, key=lambda motion: motion.max_velocity, default=None) or hardest == 0.0


def test_one_mass_and_the_same_as_a_system_are_told_in_the_same_words():
    for osc in (vi.ImpactOscillator(omega=2.6), vi.ImpactOscillator(omega=2.0, gap=0.3)):
        one, same = (vi.describe(model, parameters=[]) for model in (osc, one_mass(osc)))
        for title in ("motion", "energy", "stability", "coexisting"):
            assert line(one, title) == line(same, title)
        impulse = f" largest impulse {same.orbit.impulses[0]:.4g} N s"
        assert line(one, "hits") + impulse == line(same, "hits")


def test_a_verdict_that_is_stopped_holds_what_was_found():
    verdict = vi.describe(THREE, parameters=["omega", "right_gap"], progress=lambda done, total, found: done < 2)
    assert not verdict.complete
    assert verdict.boundaries == ()
    assert "stopped" in str(verdict)


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
