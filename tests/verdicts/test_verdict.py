"""What a verdict says of a motion is true: against 50-digit values, closed forms, the witness, and other functions."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import vibroimpact as vi
from designs import RARE, random_oscillator
from differences import derivative
from systems import FORMS, THREE, TWINS, linear, one_mass, random_pair, sticking, two_sided
from texts import line, numbers, text_of
from vibroimpact.backends import get_backend
from vibroimpact.indices import INDICES
from witness import follow

PERIODIC = {f"two masses, seed {seed}": random_pair(seed) for seed in (0, 2, 6, 10, 17, 18, 19, 22)}
CYCLES = {
    "one mass": vi.ImpactOscillator(omega=2.0),
    "one mass beside another cycle": vi.ImpactOscillator(omega=1.45),
    **PERIODIC,
}


@pytest.fixture(scope="module")
def verdicts():
    return {name: vi.describe(model, parameters=[]) for name, model in CYCLES.items()}


@pytest.fixture(scope="module")
def fast():
    return vi.describe(vi.ImpactOscillator(omega=2.0))


@pytest.fixture(scope="module")
def chaotic():
    return vi.describe(vi.ImpactOscillator(omega=2.8))


# The motion from rest


def test_the_motion_at_w_2_is_named_with_its_50_digit_velocity_and_phase(fast, values):
    known = values["period_n_impact_1"]["w=2.0,n=1"]
    assert fast.motion.name == "period-1 impact-1"
    assert fast.motion.velocities == pytest.approx((float(known["v"]),), rel=1e-13)
    assert fast.motion.phases == pytest.approx((float(known["phase_frac"]),), rel=1e-13)
    assert "once per period: 6.226 m/s at phase 0.499" in str(fast)


def impacts_of(verdict):
    """Return impacts of a cycle from rest, and the stop of each."""
    number = verdict.motion.n_impacts
    hits = vi.impact_section(verdict.oscillator, transient_impacts=3000, sample_impacts=number)
    return hits, hits["stop"].values if "stop" in hits else np.repeat(verdict.oscillator.stop_names, number)


@pytest.mark.parametrize("name", CYCLES)
def test_energy_and_period_are_those_of_impacts_from_rest(verdicts, name):
    """E = I v (1 - r)/2 at each impact."""
    verdict, period = verdicts[name], CYCLES[name].period
    n, (hits, struck) = verdict.motion.n_periods, impacts_of(verdict)
    restitution = {stop.name: stop.restitution for stop in verdict.oscillator.stops}
    left = 1.0 - np.array([restitution[stop] for stop in struck])
    lost = float((0.5 * left * hits["velocity"] * hits["impulse"]).sum()) / n
    assert verdict.indices["dissipation"] == pytest.approx(lost, rel=1e-9)
    assert verdict.power == pytest.approx(lost / period, rel=1e-9)
    energy = line(verdict, "energy")
    assert numbers(energy, "", " J lost")[0] == pytest.approx(lost, rel=1e-3)
    assert numbers(energy, "period, ", " W")[0] == pytest.approx(lost / period, rel=1e-3)
    assert numbers(line(verdict, "motion"), "repeats every ", " s") == [float(f"{n * period:.4g}")]


@pytest.mark.parametrize("name", PERIODIC)
def test_hits_on_each_stop_are_those_of_impacts_from_rest(verdicts, name):
    verdict = verdicts[name]
    hits, names = impacts_of(verdict)
    speeds, phases = hits["velocity"].values, hits["phase"].values
    text = line(verdict, "hits")
    for stop in verdict.oscillator.stop_names:
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


def test_neighbours_approach_at_the_rate_of_the_50_digit_multiplier(fast, values):
    largest = float(values["period_n_impact_1"]["w=2.0,n=1"]["mult1"][0])
    halving = -math.log(2.0) / math.log(largest)
    assert abs(fast.orbit.multipliers[0]) == pytest.approx(largest, rel=1e-9)
    assert f"{halving:.2g} periods" in str(fast)


@pytest.mark.parametrize("name", CYCLES)
def test_multipliers_are_those_of_differences_of_the_witness(verdicts, name):
    verdict, model = verdicts[name], CYCLES[name]
    system = one_mass(model) if verdict.stops == () else model
    orbit, plain, n = verdict.orbit, linear(system), system.coordinates
    span, begun = verdict.motion.n_periods, orbit.start.time - 1e-3 * system.period
    before = vi.simulate(model, start=orbit.start, periods=span - 1e-3, samples_per_period=1000)
    state = np.concatenate([np.ravel(before[name].values[-1]) for name in ("displacement", "velocity")])

    def ended(x):
        end = follow(plain, x[:n], x[n:], begun, impacts=200, most_periods=span).end
        return np.concatenate([end.displacement, end.velocity])

    np.testing.assert_allclose(ended(state), state, rtol=0, atol=1e-7)
    radius = float(np.abs(np.linalg.eigvals(derivative(ended, state, 2e-6))).max())
    assert orbit.spectral_radius == pytest.approx(radius, rel=2e-3)
    half = -math.log(2.0) * span * system.period / math.log(radius)
    text = line(verdict, "stability")
    assert numbers(text, "halve every ", " s")[0] == pytest.approx(half, rel=2e-2)
    assert numbers(text, "exponent ", " 1/s")[0] == pytest.approx(-math.log(2.0) / half, rel=5e-3)
    told = [] if system is not model else [pytest.approx(radius, rel=2e-3)]
    assert numbers(text, "largest multiplier ") == told


def test_at_w_0_1_the_mass_rests_for_the_50_digit_share_of_the_time(values):
    known = values["sticking_w=0.1"]
    verdict = vi.describe(vi.ImpactOscillator(omega=0.1), parameters=[])
    assert verdict.kind == "sticking"
    share = float(known["stuck_duration"]) / float(known["T"])
    assert verdict.indices["stick_fraction"] == pytest.approx(share, abs=1e-9)
    assert verdict.max_velocity == pytest.approx(float(known["max_v"]), rel=1e-11)
    assert f"{100 * share:.3g} % of the time at rest" in text_of(verdict)
    assert "erases all memory" in text_of(verdict)


def test_a_motion_that_rests_says_so_and_needs_no_orbit():
    verdict = vi.describe(vi.family(vi.models.bouncing_ball), parameters=["frequency"])
    assert verdict.motion.name == "period-1 sticking"
    assert "followed by a complete chatter" in text_of(verdict)
    assert "not sought: only those of periodic motions" in text_of(verdict)
    assert verdict.worst.name == "period-1 impact-1"
    assert f"{100 * verdict.worst.share:.2g} % of the initial conditions" in text_of(verdict)
    assert numbers(str(verdict), "hits        hardest ", " m/s") == [float(f"{max(verdict.motion.velocities):.4g}")]


def test_a_motion_clear_of_the_stops_says_how_far():
    system = random_pair(5)
    verdict = vi.describe(system, parameters=[])
    settled = vi.simulate(system, start=vi.attractors(system)[0].start, periods=1, samples_per_period=4000)
    nearest = settled["clearance"].min("time")
    words, _, name = line(verdict, "motion").rpartition(" clear of ")
    assert words == f"from rest no impact, at least {float(nearest.min()):.3g} m"
    assert float(nearest.sel(stop=name)) == pytest.approx(float(nearest.min()), rel=1e-6)  # both, here
    assert verdict.max_velocity == 0.0


def test_a_mass_that_lies_on_its_stop_rests_there():
    still = vi.describe(vi.models.bouncing_ball(amplitude=1e-6), parameters=[])
    assert "from rest permanently in contact, at rest at the stop" in text_of(still)


@pytest.mark.long
def test_chaos_at_w_2_8_is_told_with_its_exponent_and_how_far_one_can_foresee(chaotic, values):
    known = float(values["lyapunov_w=2.8"]["lam_per_time_mean_se"][0])
    assert chaotic.kind == "chaotic"
    assert chaotic.indices["lyapunov"] == pytest.approx(known, rel=0.05)
    periods = math.log(1e6) / chaotic.indices["lyapunov"] / chaotic.oscillator.period
    assert f"predictable for about {periods:.2g} periods" in str(chaotic)
    assert str(chaotic).splitlines()[2].startswith("motion      from rest chaotic")


@pytest.mark.parametrize(
    "model", [vi.ImpactOscillator(omega=2.8), two_sided(1.5, 0.8, 0.2)], ids=["one mass", "one mass between stops"]
)
def test_chaos_says_what_is_only_about_so(model):
    verdict = vi.describe(model, parameters=[], progress=lambda *progress: False)  # that from rest
    hits = vi.impact_section(model, transient_impacts=3000, sample_impacts=60_000)
    text, span = line(verdict, "hits"), float(hits["time"][-1] - hits["time"][0])
    assert numbers(text, "about ", " times")[0] == pytest.approx(60_000 / (span / model.period), rel=0.06)
    assert numbers(text, "mean about ", " m/s")[0] == pytest.approx(float(hits["velocity"].mean()), rel=0.06)
    lost = 0.5 * (1 - 0.8**2) * float((hits["velocity"] ** 2).sum()) / span
    assert numbers(line(verdict, "energy"), "period, ", " W")[0] == pytest.approx(lost, rel=0.1)
    assert verdict.watched > 32_000


def test_every_index_of_chaos_is_that_of_parameter_map(chaotic):
    sweep = vi.parameter_map(chaotic.oscillator, indices=tuple(INDICES), omega=[chaotic.oscillator.omega])
    for index in INDICES:
        assert chaotic.indices[index] == float(sweep[index][0])


REPEATING = {**{name: CYCLES[name] for name in list(CYCLES)[:6]}, "it sticks": sticking()}


@pytest.mark.parametrize("model", REPEATING.values(), ids=REPEATING)
def test_every_index_of_a_cycle_is_that_of_parameter_map(model):
    """Over exactly one cycle, that is; a map averages over 5000 impacts, which may end within one."""
    verdict = vi.describe(model, parameters=[])
    sweep = vi.parameter_map(model, indices=tuple(INDICES), omega=[model.omega])
    for index in INDICES:
        assert verdict.indices[index] == pytest.approx(float(sweep[index][0]), rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_indices_of_impacts_are_those_of_exactly_one_cycle(form):
    rng, impacts = np.random.default_rng(78), set()
    while len(impacts) < 4:
        verdict = vi.describe(form(random_oscillator(rng)), parameters=[])
        if verdict.kind == "periodic":
            speeds, phases = np.array(verdict.orbit.velocities), np.array(verdict.orbit.phases)
            expected = {
                "std": speeds.std(),
                "mean_velocity": speeds.mean(),
                "max_velocity": speeds.max(),
                "impacts_per_period": len(speeds) / verdict.motion.n_periods,
                "impact_phase_spread": 1.0 - abs(np.exp(2j * np.pi * phases).mean()),
            }
            found = {name: verdict.indices[name] for name in expected}
            assert found == pytest.approx(expected, rel=1e-6, abs=1e-7)
            impacts.add(len(speeds))


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


# What coexists


@pytest.mark.parametrize(
    "model",
    [vi.ImpactOscillator(omega=3.0), vi.ImpactOscillator(omega=1.45), random_pair(4), random_pair(19)],
    ids=["one mass that sticks", "one mass", "two masses, seed 4", "two masses, seed 19"],
)
def test_shares_are_those_of_a_map_from_the_same_initial_conditions(model):
    verdict = vi.describe(model, parameters=[])
    sweep = vi.parameter_map(
        model, omega=[model.omega], start=257, indices=("max_velocity",), transient_impacts=3000, sample_impacts=200
    )
    hardest = np.nan_to_num(sweep["max_velocity"].values[0, 1:])
    shares = [float((np.abs(hardest - motion.max_velocity) < 1e-4).mean()) for motion in verdict.attractors]
    assert shares == [motion.share for motion in verdict.attractors]
    text = line(verdict, "coexisting").replace(" % of the initial conditions: ", " %: ")
    for motion in verdict.attractors:
        assert f"{100 * motion.share:.3g} %: {motion.name}" in text
    assert f"{verdict.motion.name} (this motion)" in text


@pytest.mark.parametrize(
    "model",
    [vi.ImpactOscillator(omega=3.0), vi.ImpactOscillator(omega=1.45), *(random_pair(100 + seed) for seed in range(4))],
    ids=["one mass that sticks", "one mass", *(f"two masses, seed {100 + seed}" for seed in range(4))],
)
def test_others_are_said_to_hit_harder_where_they_do(model):
    verdict = vi.describe(model, parameters=[])
    others = [motion for motion in verdict.attractors if motion.share and not motion.from_rest]
    hardest = max((motion.max_velocity for motion in others), default=0.0)
    assert ("hits hardest" in text_of(verdict)) == (hardest > verdict.max_velocity * (1 + 1e-9))
    here, *rest = verdict.attractors
    unknown = replace(verdict, kind="budget", attractors=(replace(here, max_velocity=math.nan), *rest))
    assert unknown.worst == max(others, key=lambda motion: motion.max_velocity, default=None) or hardest == 0.0


def test_a_verdict_on_twins_names_the_one_from_rest_and_the_other():
    verdict = vi.describe(TWINS, parameters=[])
    assert {motion.name for motion in verdict.attractors} == {"period-1 impact-2 a", "period-1 impact-2 b"}
    here, other = verdict.attractors
    assert here.from_rest
    assert "hits hardest" not in text_of(verdict)  # both hit as hard
    assert {here.stop, other.stop} == {"above", "below"}
    first = vi.impact_section(TWINS, transient_impacts=2000, sample_impacts=2)
    assert str(first["stop"].values[np.argmax(first["velocity"].values)]) == here.stop
    assert line(verdict, "advice") == "no parameter was varied"


# Hard cases


HARD = [
    ({"gap": 0.5}, "no_impact"),
    ({"amplitude": 0.0, "gap": 1.0}, "at_rest"),
    ({"gap": -2.0}, "stuck_forever"),
    ({"amplitude": 0.0}, "at_rest"),
    ({"amplitude": 0.0, "gap": -0.1}, "at_rest"),
    ({"restitution": 0.0}, "sticking"),
    ({"restitution": 0.0, "omega": 0.5, "gap": -0.3}, "sticking"),
    ({"restitution": 1.0}, "periodic"),
    ({"restitution": 1.0, "damping": 0.0}, "undecided"),
    ({"damping": 0.0, "omega": 1.0, "gap": 1.0}, "periodic"),
    ({"omega": 2.8, "gap": -0.2}, None),
]
HARD_CASES = {
    **{f"one mass, {numbers}": (vi.ImpactOscillator(**numbers), kind) for numbers, kind in HARD},
    **{f"as a system, {numbers}": (one_mass(vi.ImpactOscillator(**numbers)), kind) for numbers, kind in HARD},
}


@pytest.mark.long(but=2)
@pytest.mark.usefixtures("modal_engine")
@pytest.mark.parametrize(("model", "kind"), HARD_CASES.values(), ids=HARD_CASES)
def test_every_hard_case_has_a_verdict_that_can_be_read_and_stored(model, kind):
    parameters = ["gap", "amplitude"] if "amplitude" in model.values else ["stop_1_gap"]
    verdict = vi.describe(model, parameters=parameters)
    assert kind is None or verdict.kind == kind
    assert len(verdict.boundaries) == 2 * len(parameters)
    assert str(verdict).startswith(model.kind)
    assert "nan" not in str(verdict)
    stored = json.loads(json.dumps(verdict.to_dict(), allow_nan=False))
    assert stored["motion"]["name"] == verdict.motion.name


@pytest.mark.usefixtures("modal_engine")
@pytest.mark.parametrize(
    "model",
    [RARE, one_mass(RARE), two_sided(0.95, 0.8, 6.0)],
    ids=["one mass", "as a system", "one mass between stops"],
)
def test_a_motion_that_outlasts_its_budget_is_told_as_such(model):
    hasty = vi.Tolerances(flight_periods=1.0, steps_per_impact=1)
    verdict = vi.describe(model, parameters=["omega"], tolerances=hasty)
    assert verdict.kind == "budget"
    assert "raise `flight_periods` or `steps_per_impact`" in text_of(verdict)
    assert "none, as the motion from rest was not followed to its end" in text_of(verdict)


@pytest.mark.parametrize("model", [vi.ImpactOscillator(), random_pair(10)], ids=["one mass", "two masses"])
def test_progress_counts_parts_and_what_is_stopped_holds_what_was_found(model):
    news = []
    whole = vi.describe(model, parameters=["omega"], progress=lambda done, total, _: news.append((done, total)))
    assert whole.complete
    assert news == [(i, 4) for i in (1, 2, 3, 4)]
    for parts in (1, 2):
        partial = vi.describe(model, parameters=["omega"], progress=lambda done, total, _, parts=parts: done < parts)
        assert not partial.complete
        assert partial.motion.name == "period-1 impact-1"
        assert len(partial.attractors) == (parts - 1) * len(whole.attractors)
        assert partial.boundaries == ()
        assert "stopped     before the end" in str(partial)


def test_the_work_of_a_verdict_is_bounded(fast, chaotic):
    assert fast.cells <= 15_000
    assert chaotic.cells <= 20_000


def test_a_verdict_is_plain_data():
    content = json.loads(json.dumps(vi.describe(THREE, parameters=[]).to_dict()))
    assert vi.ImpactSystem(**vi.dataset.model_of(vi.simulate(THREE, periods=1)).arguments()) == THREE
    assert content["system"]["mass"] == THREE.mass.tolist()
    assert len(content["multipliers"]) == 4
