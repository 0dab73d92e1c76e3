"""A system that is one mass in front of one fixed rigid stop moves as its oscillator does, by whichever code."""

import math

import mpmath
import numpy as np
import pytest

import vibroimpact as vi
from codes import Witness
from systems import impacts, one_mass
from vibroimpact.backends import one_mass as engine
from vibroimpact.indices import DISPLACEMENTS, INDICES
from vibroimpact.kernels.shared.contact import root_at_least


def a_machine(seed, settled=False):
    """Return a system of one mass, its stop on either side, loaded and driven at any phase, and the same oscillator.

    The oscillator moves about the equilibrium under the constant load, towards its stop, with its own phase.
    """
    rng = np.random.default_rng([4001, seed])
    mass, stiffness, force = rng.uniform(0.5, 3.0, 3)
    omega = rng.uniform(0.3, 4.0) * math.sqrt(stiffness / mass)
    damping = rng.uniform(0.1, 0.4) if settled else rng.choice([0.0, 0.02, 0.2])
    bounce = rng.uniform(0.2, 0.6 if settled else 0.95)
    side, load = rng.choice([-1.0, 1.0, 2.5]), rng.choice([0.0, rng.uniform(-0.3, 0.3)])
    phase, gap = rng.choice([0.0, rng.uniform(0.0, 2.0 * math.pi)]), rng.uniform(-0.2, 0.6)
    system = vi.ImpactSystem(
        mass=mass,
        damping=damping * math.sqrt(stiffness * mass),
        stiffness=stiffness,
        force=vi.Force(omega=omega, harmonics={1: force * np.exp(1j * phase)}, constant=load),
        stops=[vi.Stop(direction=side, gap=gap, restitution=bounce)],
    )
    offset = side * load / stiffness
    turn = phase + (math.pi if side < 0.0 else 0.0)
    oscillator = vi.ImpactOscillator(
        mass=mass / side**2,
        damping=system.damping.item() / side**2,
        stiffness=stiffness / side**2,
        amplitude=force / abs(side),
        omega=omega,
        restitution=bounce,
        gap=gap - offset,
    )
    start = vi.State(min(0.0, gap) - offset, 0.0, (turn / omega) % oscillator.period)
    return system, oscillator, start


@pytest.mark.parametrize("engine", ["engine of one mass", "engine of systems"])
@pytest.mark.parametrize("block", range(4))
def test_its_indices_are_those_of_the_oscillator_that_it_is(request, engine, block):
    if systems := engine == "engine of systems":
        request.getfixturevalue("modal_engine")
    how = {"indices": [*INDICES, *DISPLACEMENTS], "transient_impacts": 3000, "sample_impacts": 500, "workers": 1}
    settled = 0
    for seed in range(10 * block, 10 * block + 10):
        system, oscillator, start = a_machine(seed)
        for omega in system.omega * np.linspace(0.9, 1.1, 5):
            there = vi.State(start.displacement, 0.0, start.time * system.omega / omega)
            ours = vi.parameter_map(system, omega=[omega], of=system.stop_names[0], **how)
            theirs = vi.parameter_map(oscillator, omega=[omega], of=oscillator.stop_names[0], start=there, **how)
            if not 0 < theirs["n_periods"] < 20 or theirs["lyapunov"] > -0.02 * system.omega:
                continue  # chaos, or hardly attracting: rounding grows
            settled += 1
            assert ours["status"] == theirs["status"]
            turned = theirs["harmonic_phase"].item() + start.time * system.omega
            phasors = (
                np.exp(1j * np.array([ours["harmonic_phase"].item(), turned])) * theirs["harmonic_amplitude"].item()
            )
            assert phasors[0] == pytest.approx(phasors[1], rel=1e-10)
            # That engine averages over its window.
            loose = set() if theirs["n_impacts"] == 1 else {"impacts_per_period", "dissipation"}
            for name in set(how["indices"]) - {"harmonic_phase"} - (loose if systems else set()):
                near = 1e-8 if systems and "lyapunov" in name else 1e-10
                near = {"rel": near, "abs": near * float(theirs["max_velocity"].fillna(1.0)[0])}
                assert ours[name].item() == pytest.approx(theirs[name].item(), **near, nan_ok=True), (seed, name)
    assert settled > 10


@pytest.mark.parametrize("seed", range(20))
def test_its_motions_are_those_of_the_engine_of_systems(seed, request):
    """Rounding has not grown by then: the motions are strongly damped, and few impacts long."""
    system, _, _ = a_machine(seed, settled=True)
    looks = {"transient_periods": 3, "sample_periods": 6, "phase": 0.3 * (seed % 2)}

    def motions():
        return [
            vi.simulate(system, periods=3),
            vi.simulate(system, periods=3, skip_periods=5, samples_per_period=7),
            vi.impact_section(system, transient_impacts=2, sample_impacts=9),
            vi.stroboscopic_section(system, **looks),
        ]

    ours = motions()
    request.getfixturevalue("modal_engine")
    for mine, theirs in zip(ours, motions(), strict=True):
        assert mine.sizes == theirs.sizes
        for name in mine.variables:
            assert mine[name].dims == theirs[name].dims
            assert str(mine[name].attrs) == str(theirs[name].attrs)
            if mine[name].dtype.kind == "f":
                assert mine[name].values == pytest.approx(theirs[name].values, rel=1e-7, abs=1e-8, nan_ok=True), name
            else:
                assert mine[name].values.tolist() == theirs[name].values.tolist()


@pytest.mark.parametrize("block", range(4))
def test_its_attractors_are_those_of_the_oscillator(block):
    compared = 0
    for seed in range(8 * block, 8 * block + 8):
        system, oscillator, start = a_machine(seed)
        (stop,) = system.stops
        side, rng = float(stop.direction[0]), np.random.default_rng([4002, seed])
        offset = min(0.0, stop.gap) - start.displacement
        ours, theirs = [], []
        for clearance, velocity, time in rng.uniform([0.0, -2.0, 0.0], [2.0, 2.0, system.period], (24, 3)):
            towards = stop.gap - clearance
            ours.append(vi.State(towards / side, velocity / side, time))
            theirs.append(vi.State(towards - offset, velocity, (time + start.time) % system.period))
        found, expected = vi.attractors(system, ours), vi.attractors(oscillator, theirs)
        if any(one.kind in ("chaotic", "sticking") and not one.n_periods for one in expected):
            continue  # which initial conditions are irregular for how long is a matter of the window
        compared += 1
        assert [(one.name, one.share) for one in found] == [(one.name, one.share) for one in expected], seed
        for one, other in zip(found, expected, strict=True):
            for name in ("max_velocity", "mean_velocity", "dissipation", "lyapunov"):
                near = pytest.approx(getattr(other, name), rel=1e-5, nan_ok=True)
                assert getattr(one, name) == near, (seed, one.name, name)
    assert compared > 4


UNFORCED = {  # c, r, g: what every initial condition leads to, however long it takes
    (1e-6, 1.0, 0.1): ["at rest"],
    (1e-6, 1.0, -0.1): ["at rest"],
    (1e-7, 1.0 - 1e-7, 0.0): ["at rest"],
    (0.0, 1.0 - 1e-6, 0.1): ["no impact"],  # swings, undamped, just clear of the stop
    (0.0, 1.0 - 1e-6, -0.1): ["at rest"],
    (0.0, 1.0, 0.1): [],  # nothing is attracted
}


@pytest.mark.parametrize("form", ["oscillator", "system"])
@pytest.mark.parametrize(("numbers", "names"), UNFORCED.items())
def test_without_a_force_it_comes_to_rest_or_swings_clear(numbers, names, form):
    osc = vi.ImpactOscillator(amplitude=0.0, **dict(zip(("damping", "restitution", "gap"), numbers, strict=True)))
    found = vi.attractors(osc if form == "oscillator" else one_mass(osc))
    assert [(attractor.name, attractor.share) for attractor in found] == [(name, 1.0) for name in names]


def test_chaos_has_the_same_statistics_by_both_engines(request):
    system = one_mass(vi.ImpactOscillator(omega=2.8))
    names = "std", "mean_velocity", "impacts_per_period", "lyapunov", "dissipation"
    ours, theirs = [], []
    for found in ours, theirs:
        found += [
            vi.parameter_map(system, omega=[2.8], indices=names, sample_impacts=100_000, start=vi.State(-x))
            for x in (0.1, 0.2, 0.3, 0.4)
        ]
        if found is ours:
            request.getfixturevalue("modal_engine")
    for name in names:
        mine, other = ([float(one[name][0]) for one in found] for found in (ours, theirs))
        spread = np.std(mine + other)
        assert abs(np.mean(mine) - np.mean(other)) < 3.0 * spread, name


@pytest.mark.parametrize(
    ("change", "is_one"),
    [
        ({}, True),
        ({"force": vi.Force(omega=2.0)}, True),
        ({"force": vi.Force(omega=2.0, harmonics={1: 1.0, 3: 0.1})}, False),
        ({"stiffness": 0.0, "damping": 0.1}, False),
        ({"stops": [vi.Stop(direction=-2.0, gap=0.1, restitution=0.5)]}, True),
        ({"stops": [vi.Stop(direction=1.0, gap=0.1, stiffness=100.0)]}, False),
        ({"stops": [vi.Stop(direction=1.0, gap=0.1, restitution=lambda speed: 0.5)]}, False),
        ({"stops": [vi.Stop(direction=1.0, gap=0.1, restitution=0.5, motion={1: 0.01})]}, False),
        ({"stops": [vi.Stop(direction=1.0, gap=0.1), vi.Stop(direction=-1.0, gap=0.1)]}, False),
    ],
)
def test_what_counts_as_one_mass(change, is_one):
    assert engine.is_one_mass(one_mass(vi.ImpactOscillator(gap=0.3), **change).cells({})).all() == is_one


def test_in_one_table_each_cell_has_the_engine_that_it_has_alone():
    """A stiffness of zero is for the engine of systems: what a cell hangs on is its own numbers, not its neighbours."""
    osc = vi.ImpactOscillator(omega=2.8, gap=0.1)
    designs = [one_mass(osc, stiffness=stiffness, damping=0.1) for stiffness in (1.0, 0.0, 2.0, 0.0)]
    cells = type(designs[0]).cells_of(designs)
    assert engine.is_one_mass(cells).tolist() == [True, False, True, False]
    wanted = vi.backends.Measurement(vi.backends.ImpactWindow(10, 50), indices=("std", "n_periods"), by_stop=True)
    together = vi.backends.get_backend("cpu").indices(cells, wanted)
    for row in range(4):
        alone = vi.backends.get_backend("cpu").indices(cells[row : row + 1], wanted)
        for name in ("std", "n_periods", "status"):
            assert np.array_equal(together[name][row], alone[name][0], equal_nan=True)


SLOW, STEEP = vi.State(-1.0, 0.1, 0.3), vi.State(-1.3, 0.1, 0.3)
MOTIONS = {  # an oscillator, where it begins, and how often it rests at least
    "w=2": (vi.ImpactOscillator(omega=2.0), SLOW, 0),
    "gap": (vi.ImpactOscillator(omega=1.4, gap=0.4, damping=0.1), SLOW, 0),
    "slow": (vi.ImpactOscillator(omega=0.2, restitution=0.2, damping=0.05), SLOW, 3),
    "preloaded": (vi.ImpactOscillator(omega=0.6, restitution=0.3, gap=-0.3, damping=0.1), STEEP, 3),
    "r=0": (vi.ImpactOscillator(omega=0.3, restitution=0.0, gap=0.2), SLOW, 3),
    "overdamped": (
        vi.ImpactOscillator(omega=0.25, restitution=0.4, gap=-0.2, damping=3.0), vi.State(-1.2, 0.1, 0.3), 2,
    ),
    "r=0, from rest": (
        vi.ImpactOscillator(mass=1.0, damping=0.11, stiffness=1.47, amplitude=0.63, omega=0.32, restitution=0.0),
        vi.State(0.0), 1,
    ),
    "pressed": (vi.ImpactOscillator(amplitude=0.4, omega=0.8, gap=-1.0, restitution=0.6), vi.State(-1.5, 0.0), 0),
    "clear": (vi.ImpactOscillator(damping=0.34, amplitude=1.0, gap=1.1, omega=0.2), vi.State(1.0, 3.0), 0),
    "r=0.03": (
        vi.ImpactOscillator(damping=0.4, stiffness=2.5, omega=1.1, restitution=0.03, gap=-0.4), vi.State(-1.0, 0.0), 1,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", MOTIONS)
def test_it_has_the_impacts_and_the_rests_of_the_oscillator(code, name):
    osc, start, rests = MOTIONS[name]
    if isinstance(code, Witness) and osc.stiffness * osc.gap == -osc.amplitude:
        pytest.skip("the witness does not get past an instant at which the force of a closed stop just falls to zero")
    hits, model = impacts(osc, 60, start=start), one_mass(osc)
    state = [start.displacement], [start.velocity], start.time
    seen = code.impacts(model, *state, number=hits.sizes["impact"])
    late, fast = seen["time"] - hits["time"].values, seen["velocity"] - hits["velocity"].values
    assert np.abs(late).max() * osc.natural_frequency < 1e-12
    assert np.abs(fast).max() < 1e-12 * osc.velocity_scale
    begun, last = hits["time"].values[[0, -1]]
    until = last if hits.sizes["impact"] == 60 else math.inf  # it may stay at the stop
    events = code.motion(model, *state, periods=math.ceil((last - start.time) / osc.period) + 1).events
    sticks, releases = (
        [at for at, kind, _ in events if kind == one and begun <= at < until] for one in ("stick", "release")
    )
    theirs = hits["stick_time"].values, hits["release_time"].values
    assert len(sticks) == len(theirs[0]) >= rests
    for mine, other in zip((sticks, releases), theirs, strict=True):
        assert mine == pytest.approx(other[other < until], abs=1e-12 / osc.natural_frequency)


@pytest.mark.parametrize("transient", [0, 2])
@pytest.mark.parametrize("name", MOTIONS)
def test_sticks_and_status_are_those_between_the_first_and_the_last_impact(name, transient, modal_engine):
    osc, start, _ = MOTIONS[name]
    there = vi.State([start.displacement], [start.velocity], start.time)
    one, system = impacts(osc, 15, transient, start=start), impacts(one_mass(osc), 15, transient, start=there)
    assert int(one["status"]) == int(system["status"])
    for part in ("stick_time", "release_time", "time", "velocity"):
        np.testing.assert_allclose(system[part].values, one[part].values, rtol=1e-12, err_msg=part)


def test_random_oscillators_make_the_same_first_20_impacts(code):
    """As far as errors of their start have not grown."""
    rng = np.random.default_rng(1)
    for _ in range(25):
        osc = vi.ImpactOscillator(
            mass=10 ** rng.uniform(-1, 1), stiffness=10 ** rng.uniform(-1, 1), damping=10 ** rng.uniform(-2, 0),
            amplitude=1.0, omega=10 ** rng.uniform(-0.7, 0.7), restitution=rng.uniform(0, 0.8),
            gap=rng.uniform(-0.5, 0.5),
        )  # fmt: skip
        behind = rng.uniform(0, 1)
        known, near = (impacts(osc, 20, start=vi.State(osc.gap - back)) for back in (behind, behind * (1 + 1e-9)))
        hits = code.impacts(one_mass(osc), [osc.gap - behind], [0.0], number=max(known.sizes["impact"], 1))
        assert len(hits["time"]) == known.sizes["impact"]
        for part in ("time", "velocity") if near.sizes == known.sizes else ():
            growth = np.maximum.accumulate(np.abs(near[part].values - known[part].values)) / 1e-9
            wrong = np.abs(hits[part] - known[part].values)
            assert (wrong <= 1e-12 * (1 + known[part].values) + 1e-13 * growth).all()


@pytest.mark.parametrize("omega", [1.4, 0.4])
def test_the_witness_finds_the_attractors_and_basins_of_one_mass_written_as_a_system(omega):
    """The load has a phase and a constant part; at 0.4 rad/s the mass rests at the stop."""
    wall = vi.Stop(direction=-1, gap=0.05, restitution=0.3, name="wall")
    load = vi.Force(omega=omega, harmonics={1: 1.0 + 0.5j}, constant=0.1)
    model = vi.ImpactSystem(mass=2.0, damping=0.5, stiffness=3.0, force=load, stops=[wall])
    few = {"transient_impacts": 7, "sample_impacts": 20, "workers": 1}
    starts = [vi.State(0.0), vi.State(0.3, -1.0, 0.4)]
    (one,), (other,) = (vi.attractors(model, starts, backend=name, **few) for name in ("cpu", "reference"))
    assert (one.name, one.share, one.stops) == (other.name, other.share, other.stops)
    np.testing.assert_allclose(one.velocities, other.velocities, rtol=1e-9)
    np.testing.assert_allclose(one.phases, other.phases, rtol=1e-9)
    plane = {"phase": [0.1, 0.6], "velocity": [1.0]}
    ours, witnessed = (vi.basins(model, **plane, **few, backend=name) for name in ("cpu", "reference"))
    assert ours["attractor"].equals(witnessed["attractor"])


@pytest.mark.parametrize("engine", ["engine of one mass", "engine of systems"])
def test_a_mass_that_leaves_its_stop_from_a_rounding_away_comes_back_to_it(request, engine):
    """Its first contact is that of the mass which leaves the stop itself."""
    if engine == "engine of systems":
        request.getfixturevalue("modal_engine")
    rng = np.random.default_rng(4003)
    for _ in range(40):
        osc = vi.ImpactOscillator(
            amplitude=rng.uniform(0.5, 2.0), omega=rng.uniform(0.3, 3.0), gap=rng.uniform(-0.2, 0.6)
        )
        speed, time = rng.uniform(0.05, 2.0), rng.uniform(0.0, osc.period)
        firsts = []
        for away in (0.0, 1e-17, 3e-17, 1e-16, 1e-15, 1e-13, 1e-10):
            motion = vi.simulate(osc, start=vi.State(osc.gap - away, -speed, time), periods=2, samples_per_period=50)
            assert motion["displacement"].max() <= osc.gap + 1e-12
            firsts.append(float(motion["impact_time"][0]))
        assert firsts == pytest.approx([firsts[0]] * len(firsts), rel=1e-9, abs=1e-7)


def test_no_root_is_passed_however_small_the_beginning_of_a_polynomial_is():
    """A bound of the smallest positive root, sharp for a quadratic."""
    rng = np.random.default_rng(4004)
    for _ in range(3000):
        q0, q1, q2 = 10.0 ** rng.uniform(-20.0, 0.0), rng.uniform(-3.0, 3.0), rng.uniform(-8.0, 3.0)
        first = float(min((x for x in _roots(q0, q1, q2) if 0.0 < x <= 1.0), default=1.0))
        assert root_at_least(q0, q1, q2, 0.0, 1.0) == pytest.approx(first, rel=1e-11)


def _roots(q0, q1, q2):
    """Return the real roots of a quadratic, with 50 digits."""
    with mpmath.workdps(50):
        inside = mpmath.mpf(q1) ** 2 - 4 * mpmath.mpf(q0) * q2
        return [] if inside < 0 else [(-q1 + sign * mpmath.sqrt(inside)) / (2 * mpmath.mpf(q2)) for sign in (1, -1)]
