"""Free vibration without loss: orbits of a given energy, their families in energy, and what they are called."""

import math
import re

import numpy as np
import pytest

import vibroimpact as vi
from differences import derivative
from dop853 import later

ONE = vi.ImpactSystem(mass=1.0, stiffness=10.0, stops=[vi.Stop(direction=1, gap=0.01, stiffness=50.0, name="bar")])
TWO = vi.ImpactSystem(
    mass=np.eye(2),
    stiffness=[[2.0, -1.0], [-1.0, 1.0]],
    stops=[
        vi.Stop(direction=[1, 0], gap=1.0, stiffness=30.0, name="above"),
        vi.Stop(direction=[-1, 0], gap=1.0, stiffness=30.0, name="below"),
    ],
)


def design(seed):
    """Return a random system of 2 to 4 coordinates with one or two elastic or undamped stops, and a mode."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    a, b = rng.normal(size=(2, n, n))
    kinds = [{"restitution": 1.0}, {"stiffness": float(10.0 ** rng.uniform(0.0, 3.0))}]
    stops = [
        vi.Stop(direction=rng.normal(size=n), gap=float(rng.uniform(0.2, 1.0)), **kinds[int(rng.integers(2))])
        for _ in range(int(rng.integers(1, 3)))
    ]
    system = vi.ImpactSystem(mass=a @ a.T + 0.5 * n * np.eye(n), stiffness=b @ b.T + 0.3 * np.eye(n), stops=stops)
    return system, int(rng.integers(1, n + 1))


def first_contact(system, mode):
    """Return the energy at which a linear mode touches a stop, from the eigenvectors of (K, M)."""
    root = np.linalg.inv(np.linalg.cholesky(system.mass))
    squares, vectors = np.linalg.eigh(root @ system.stiffness @ root.T)
    shape = root.T @ vectors[:, mode - 1]
    return 0.5 * squares[mode - 1] * min((s.gap / (s.direction @ shape)) ** 2 for s in system.stops)


def moved(system, state, time):
    """Return the state after a time, by an integration from event to event."""
    q, _ = np.split(state, 2)
    pushing = [at for at, stop in enumerate(system.stops) if stop.compliant and stop.direction @ q > stop.gap]
    return later(system, state, 0.0, time, pushing)


def two_arcs(k, s, g, energy):
    """Return the period of a mass of 1 on a spring k before a spring s behind a gap; s infinite: a rigid stop."""
    # free: amplitude sqrt(2 E/k) at sqrt(k); in contact: sqrt(k + s), about the equilibrium s g/(k + s)
    free, away = math.sqrt(k), math.sqrt(2.0 * energy / k)
    period = (2.0 * math.pi - 2.0 * math.acos(g / away)) / free
    if math.isfinite(s):
        pressed, middle = math.sqrt(k + s), s * g / (k + s)
        period += 2.0 * math.atan2(math.sqrt(2.0 * energy - k * g * g) / pressed, g - middle) / pressed
    return period


def pair(kinds, sides=(1, 1), coupling=0.3):
    """Return two masses of 1 on springs of 1, coupled by a spring, each before a stop at its side."""
    springs = (1.0 + coupling) * np.eye(2) - coupling * np.eye(2)[::-1]
    stops = [
        vi.Stop(direction=side * row, gap=0.1, **kind) for row, side, kind in zip(np.eye(2), sides, kinds, strict=True)
    ]
    return vi.ImpactSystem(mass=np.eye(2), stiffness=springs, stops=stops)


def between_events(orbit):
    """Return displacement and velocity in the middle of the longest time without events."""
    turns = np.array([turn for turn, _, _ in orbit.events])
    gaps = np.diff(np.append(turns, turns[0] + 1.0))
    at = int(np.argmax(gaps))
    q, speed, _ = orbit.motion([(turns[at] + 0.5 * gaps[at]) * orbit.period])
    return q[0], speed[0]


@pytest.mark.parametrize(
    ("energy", "frequency"),
    [
        (0.00650108331626, 0.6466310406),
        (0.00658129654238, 0.6470147154),
        (0.00647656819016, 0.6465124272),
    ],
)
def test_a_mass_before_a_spring_has_the_published_frequencies(energy, frequency):
    (orbit,) = vi.find_orbit(ONE, energy=energy)
    assert orbit.frequency == pytest.approx(frequency, abs=6e-11)
    assert orbit.energy == pytest.approx(energy, rel=1e-14)


def test_the_frequency_of_a_mass_before_a_spring_is_that_of_its_two_arcs():
    for energy in (5.1e-4, 2e-3, 0.5):
        (orbit,) = vi.find_orbit(ONE, energy=energy)
        assert orbit.period == pytest.approx(two_arcs(10.0, 50.0, 0.01, energy), rel=1e-12)


@pytest.mark.parametrize("energy", [0.0101, 0.1, 6.0])
@pytest.mark.parametrize(("sides", "mode", "k"), [((1, 1), 1, 1.0), ((1, -1), 2, 1.6)])
@pytest.mark.parametrize("kind", [{"stiffness": 5.0}, {"restitution": 1.0}])
def test_two_equal_masses_that_reach_their_stops_together_move_like_one(sides, mode, k, kind, energy):
    """In phase the spring between them is at rest; as mirror images, its middle is."""
    (orbit,) = vi.find_orbit(pair([kind] * 2, sides), energy=k * energy, mode=mode)
    assert orbit.period == pytest.approx(two_arcs(k, kind.get("stiffness", math.inf), 0.1, 0.5 * k * energy), rel=1e-12)
    assert orbit.admissible
    assert sorted(orbit.stops) == ["stop_1", "stop_2"]
    assert orbit.velocities[0] == pytest.approx(orbit.velocities[1], rel=1e-12)


def test_stops_with_one_gap_push_a_mass_like_one_stop_with_the_sum_of_their_stiffnesses():
    stops = [vi.Stop(direction=1, gap=0.1, stiffness=k) for k in (1.0, 3.0, 7.0)]
    opposite = [vi.Stop(direction=-1, gap=0.1, stiffness=k) for k in (3.0, 7.0, 1.0)]
    for energy in (0.0051, 3.0):
        (orbit,) = vi.find_orbit(vi.ImpactSystem(mass=1.0, stiffness=1.0, stops=stops), energy=energy)
        assert orbit.period == pytest.approx(two_arcs(1.0, 11.0, 0.1, energy), rel=1e-12)
        (orbit,) = vi.find_orbit(vi.ImpactSystem(mass=1.0, stiffness=1.0, stops=stops + opposite), energy=energy)
        one_sided = two_arcs(1.0, 11.0, 0.1, energy)
        assert orbit.period == pytest.approx(2.0 * one_sided - 2.0 * math.pi, rel=1e-12)
        assert orbit.symmetric


@pytest.mark.parametrize("kinds", [[{"stiffness": 5.0}] * 2, [{"stiffness": 5.0}, {"stiffness": 9.0}]])
def test_stops_touched_together_at_first_leave_an_orbit_that_closes_with_its_multipliers(kinds):
    (orbit,) = vi.find_orbit(pair(kinds), energy=0.04)
    q, speed = between_events(orbit)
    start = np.append(q, speed)
    assert moved(orbit.system, start, orbit.period) == pytest.approx(start, abs=1e-10)
    jacobian = derivative(lambda state: moved(orbit.system, state, orbit.period), start, 1e-5)
    assert np.trace(jacobian) == pytest.approx(orbit.trace, rel=1e-4, abs=1e-4)


def test_rigid_stops_struck_together_are_named_if_their_order_matters():
    stops = [
        vi.Stop(direction=[1.0, side], gap=0.1, restitution=1.0, name=name)
        for side, name in ((0.7, "left"), (-0.7, "right"))
    ]
    found = vi.find_orbit(vi.ImpactSystem(mass=np.eye(2), stiffness=np.diag([1.0, 2.0]), stops=stops), energy=0.1)
    assert not found
    assert "'left' and 'right' are struck at the same instant" in found.message


@pytest.mark.parametrize("energy", [0.126, 0.5, 20.0])
def test_one_mass_before_a_rigid_elastic_stop_misses_an_arc_of_its_ellipse(energy):
    osc = vi.ImpactOscillator(amplitude=0.0, damping=0.0, restitution=1.0, gap=0.5)
    (orbit,) = vi.find_orbit(osc, energy=energy)
    assert orbit.period == pytest.approx(2.0 * math.pi - 2.0 * math.acos(0.5 / math.sqrt(2.0 * energy)), rel=1e-12)
    assert orbit.velocities[0] == pytest.approx(math.sqrt(2.0 * energy - 0.25), rel=1e-12)


def test_a_family_that_first_loses_energy_has_two_orbits_below_its_first_contact():
    low, high = sorted(orbit.frequency for orbit in vi.find_orbit(TWO, energy=0.68))
    assert low > float(TWO.natural_frequencies[0]) / (2.0 * math.pi)
    assert high > low
    with pytest.raises(ValueError, match=r"orbits with contact in its family have at least 0\.67482\d+ J"):
        vi.find_orbit(TWO, energy=0.6)


@pytest.mark.long(but=2)
@pytest.mark.parametrize("seed", range(1, 13))
def test_an_orbit_closes_after_its_period_and_has_the_energy_that_was_given(seed):
    system, mode = design(seed)
    energy = 1.7 * first_contact(system, mode)
    orbit, *_ = vi.find_orbit(system, energy=energy, mode=mode)
    assert orbit.admissible
    q, speed = between_events(orbit)
    state = moved(system, np.append(q, speed), orbit.period)
    assert np.abs(state - np.append(q, speed)).max() < 1e-8 * np.abs(np.append(q, speed)).max() * orbit.spectral_radius
    pressed = np.array(
        [max(stop.direction @ q - stop.gap, 0.0) ** 2 * (stop.stiffness or 0.0) for stop in system.stops]
    )
    total = 0.5 * (speed @ system.mass @ speed + q @ system.stiffness @ q + pressed.sum())
    assert total == pytest.approx(energy, rel=1e-12)
    assert orbit.energy == pytest.approx(energy, rel=1e-13)


@pytest.mark.long(but=1)
@pytest.mark.parametrize(("seed", "factor"), [(1, 6.84), (55, 11.41), (47, 5.81)])
def test_a_family_is_followed_beyond_grazes_at_which_contacts_vanish(seed, factor):
    """Two contacts vanish at once, since the motion is its own reversal in time; with one, it is of another family."""
    system, mode = design(seed)
    energy = factor * first_contact(system, mode)
    (orbit,) = vi.find_orbit(system, energy=energy, mode=mode)
    assert orbit.admissible
    assert orbit.energy == pytest.approx(energy, rel=1e-12)
    q, speed = between_events(orbit)
    motion = vi.simulate(orbit.system, start=vi.State(list(q), list(speed)), duration=orbit.period)
    assert motion.sizes["impact"] == orbit.n_impacts
    end = np.append(motion["displacement"].values[-1], motion["velocity"].values[-1])
    assert end == pytest.approx(np.append(q, speed), rel=0.0, abs=1e-11 * orbit.spectral_radius)


@pytest.mark.long
def test_a_family_is_followed_through_a_resonance_of_order_nine():
    """Orbits that are not their own reversals in time lie so close that double precision does not tell them apart."""
    stops = [vi.Stop(direction=[-0.53, -0.466], gap=0.328, stiffness=0.978)]
    mass, springs = [[1.523, -0.748], [-0.748, 2.141]], [[6.159, 4.422], [4.422, 3.642]]
    system = vi.ImpactSystem(mass=mass, stiffness=springs, stops=stops)
    assert system.natural_frequencies[1] / system.natural_frequencies[0] == pytest.approx(9.0, abs=0.02)
    (orbit,) = vi.find_orbit(system, energy=2.0 * first_contact(system, 1))
    q, speed = between_events(orbit)
    assert moved(system, np.append(q, speed), orbit.period) == pytest.approx(np.append(q, speed), abs=1e-9)


def test_a_family_that_meets_orbits_of_half_its_period_ends_there_and_the_message_says_so():
    springs = [[3.5, -1.9, 0.0], [-1.9, 2.22, -0.32], [0.0, -0.32, 0.32]]
    stops = [vi.Stop(direction=[-1, 1, 0], gap=0.46, stiffness=5.4)]
    system = vi.ImpactSystem(mass=np.diag([1.4, 1.5, 0.85]), stiffness=springs, stops=stops)
    contact = first_contact(system, 1)
    found = vi.find_orbit(system, energy=1.33 * contact, mode=1)
    assert not found
    assert "with energies from 0.4363558 to 0.9598041 J" in found.message
    assert "half its cycle is an orbit" in found.message
    (orbit, *_) = vi.find_orbit(system, energy=0.999 * contact, mode=1)
    branch = vi.continue_orbit(orbit, "energy", (0.1 * contact, 1.33 * contact), step=0.1)
    assert branch.outcome == ("period_doubling", "grazing")
    assert branch.values.max() == pytest.approx(0.9598041, abs=1e-7)
    q, speed = between_events(branch.orbits[0])
    half = moved(system, np.append(q, speed), 0.5 * branch.orbits[0].period)
    assert half == pytest.approx(np.append(q, speed), abs=1e-9)


def test_a_search_for_an_energy_shows_how_many_orbits_it_has_followed(monkeypatch):
    seen = []
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    monkeypatch.setattr("vibroimpact.progress.Passing.__call__", lambda self, done, *_: seen.append(done))
    vi.find_orbit(TWO, energy=3.0)
    assert seen == list(range(1, len(seen) + 1))
    assert len(seen) > 3


@pytest.mark.parametrize("seed", [1, 2])
def test_two_multipliers_are_1_and_the_others_those_of_the_integrated_motion(seed):
    system, mode = design(seed)
    orbit, *_ = vi.find_orbit(system, energy=1.7 * first_contact(system, mode), mode=mode)
    assert sorted(orbit.multipliers, key=lambda value: abs(value - 1.0))[:2] == [1.0, 1.0]
    assert math.prod(orbit.multipliers) == pytest.approx(1.0, abs=1e-9)
    q, speed = between_events(orbit)
    jacobian = derivative(lambda state: moved(system, state, orbit.period), np.append(q, speed), 1e-5)
    assert np.trace(jacobian) == pytest.approx(orbit.trace, rel=1e-4, abs=1e-4)


def test_free_vibration_is_called_one_of_a_continuum_and_never_stable():
    (orbit,) = vi.find_orbit(TWO, energy=3.0, mode=2)
    assert not orbit.stable
    assert "one of a continuum" in orbit._repr_html_()


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"damping": 0.1}, "the system is damped"),
        ({"force": vi.Force(omega=2.0, harmonics={1: 1.0})}, "it has a load"),
        ({"stops": [vi.Stop(direction=1, gap=0.1, restitution=0.9, name="wall")]}, "'wall' is not elastic"),
        ({"stops": [vi.Stop(direction=1, gap=0.1, stiffness=9.0, damping=0.1, name="wall")]}, "'wall' is not elastic"),
        (
            {
                "force": vi.Force(omega=1.0),
                "stops": [vi.Stop(direction=1, gap=0.1, stiffness=9.0, motion={1: 0.01}, name="wall")],
            },
            "'wall' moves",
        ),
    ],
)
def test_an_energy_is_refused_where_the_energy_is_not_constant(changes, why):
    system = vi.ImpactSystem(**(ONE.arguments() | changes))
    with pytest.raises(ValueError, match=f"not constant: {why}"):
        vi.find_orbit(system, energy=1.0)


APART = vi.ImpactSystem(  # no stop is touched in its second mode
    mass=np.eye(2), stiffness=np.diag([1.0, 4.0]), stops=[vi.Stop(direction=[1, 0], gap=1.0, stiffness=5.0)]
)


@pytest.mark.parametrize(
    ("model", "arguments", "message"),
    [
        (ONE, {"energy": -1.0}, "`energy` must be a number > 0, in J"),
        (ONE, {"energy": math.nan}, "`energy` must be a number > 0, in J"),
        (ONE, {"energy": 1.0, "mode": 2}, "`mode` must be at most 1"),
        (ONE, {"energy": 1.0, "n_impacts": 2}, "give either `energy`"),
        (ONE, {"mode": 1}, "`mode` must be omitted without `energy`"),
        (TWO, {"energy": 1.19768, "mode": 2}, "linear, with 0.2575181 Hz, up to its first contact at 1.809017 J"),
        (APART, {"energy": 9.0, "mode": 2}, "mode 2 is linear, with 0.3183099 Hz at every energy"),
    ],
)
def test_arguments_that_do_not_fit_an_energy_are_refused(model, arguments, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        vi.find_orbit(model, **arguments)


def test_a_branch_along_the_energy_begins_at_the_linear_mode_and_its_frequency_rises():
    (orbit,) = vi.find_orbit(ONE, energy=0.01)
    branch = vi.continue_orbit(orbit, "energy", (1e-4, 0.1), step=0.1)
    assert branch.outcome == ("grazing", "range")
    assert branch.values[[0, -1]] == pytest.approx([0.5e-3, 0.1], rel=1e-8)
    assert branch.frequencies[0] == pytest.approx(math.sqrt(10.0) / (2.0 * math.pi), rel=1e-6)
    assert (np.diff(branch.frequencies) > -1e-14).all()
    assert branch.dataset["cycle_frequency"].values == pytest.approx(branch.frequencies)
    assert branch.dataset["energy"].attrs["units"] == "J"
    (again,) = vi.find_orbit(ONE, energy=float(branch.values[40]))
    assert branch.frequencies[40] == pytest.approx(again.frequency, rel=1e-10)


def test_a_branch_along_the_energy_turns_at_folds_and_its_orbits_are_those_of_find_orbit():
    orbit = vi.find_orbit(TWO, energy=0.68)[-1]
    branch = vi.continue_orbit(orbit, "energy", (0.6, 2.0), step=0.1)
    folds = [point for point in branch.special if point.kind == "fold"]
    assert len(folds) == 2
    turning = min(folds, key=lambda point: point.value)
    assert turning.value == pytest.approx(branch.values.min(), rel=1e-12)
    assert len(vi.find_orbit(TWO, energy=turning.value * (1.0 + 1e-6))) == 2
    with pytest.raises(ValueError, match="must be larger than"):
        vi.find_orbit(TWO, energy=turning.value * (1.0 - 1e-6))
    assert any(orbit.spectral_radius > 1.1 for orbit in branch.orbits)
    assert sorted(set(branch.dataset["stable"].values.tolist())) == [0, 1]


def test_near_its_birth_a_family_has_the_multipliers_of_the_other_linear_modes():
    energy = first_contact(TWO, 2) * (1.0 + 1e-9)
    (orbit,) = vi.find_orbit(TWO, energy=energy, mode=2)
    other = np.exp(2j * np.pi * TWO.natural_frequencies[0] / TWO.natural_frequencies[1])
    assert min(abs(value - other) for value in orbit.multipliers) < 2e-3


def test_the_energy_is_followed_only_where_it_is_constant():
    (free,) = vi.find_orbit(ONE, energy=0.01)
    with pytest.raises(ValueError, match="`parameter` must be 'energy' for this orbit, got 'omega'"):
        vi.continue_orbit(free, "omega", (1.0, 9.0))
    with pytest.raises(ValueError, match="one that contains the orbit's energy = 0.01 J"):
        vi.continue_orbit(free, "energy", (0.02, 0.1))
    (forced,) = vi.find_orbit(vi.ImpactOscillator())
    with pytest.raises(
        ValueError, match="must not be 'energy', since the energy is not constant: the system is damped"
    ):
        vi.continue_orbit(forced, "energy", (0.02, 0.1))


@pytest.mark.long
@pytest.mark.parametrize("design", [ONE, vi.ImpactOscillator(amplitude=0.0, damping=0.0, restitution=1.0, gap=0.5)])
def test_a_verdict_calls_motions_without_load_and_loss_one_of_a_continuum_and_no_attractor(design):
    words = " ".join(str(vi.describe(design)).split())
    assert (
        "100 % of the initial conditions: motions of constant energy, periodic or not, each one of a continuum" in words
    )
    assert "undecided" not in words
    assert vi.attractors(design) == []


@pytest.mark.parametrize("energy", [2.0, 3.0, 10.0, 40.0])
def test_the_exponent_of_a_free_vibration_is_zero_and_not_rounding(energy):
    for mode in (1, 2):
        for orbit in vi.find_orbit(TWO, energy=energy, mode=mode):
            assert max(map(abs, orbit.multipliers)) == pytest.approx(1.0, abs=1e-9)
            assert orbit.lyapunov == 0.0
