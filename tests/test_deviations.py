"""How deviations are carried: over mixed stops, past a free centre, and by what rounding decides."""

import numpy as np
import pytest

import vibroimpact as vi
from codes import index_of
from designs import RESTS
from systems import beside_its_centre, free_masses, free_pair, one_mass
from vibroimpact.backends.modal.carry import Carrier

pytestmark = pytest.mark.usefixtures("modal_engine")

NAMED = ("n_periods", "n_impacts", "lyapunov_per_impact")


def mixed(rng):
    """Return a random system of two or three coordinates before a rigid stop and one that gives."""
    n = int(rng.integers(2, 4))
    spread, stiffness = rng.standard_normal((2, n, n))
    stops = [
        vi.Stop(direction=rng.standard_normal(n), gap=rng.uniform(0.0, 0.5), restitution=rng.choice([0.0, 0.3, 0.7])),
        vi.Stop(direction=rng.standard_normal(n), gap=rng.uniform(0.0, 0.5), stiffness=rng.uniform(3.0, 300.0)),
    ]
    return vi.ImpactSystem(
        mass=np.eye(n),
        damping=0.2 * spread @ spread.T,
        stiffness=stiffness @ stiffness.T + 0.5 * np.eye(n),
        force=vi.Force(omega=rng.uniform(0.3, 2.0), harmonics={1: 2.0 * rng.standard_normal(n)}),
        stops=stops,
    )


def test_neighbours_of_a_motion_between_rigid_stops_and_such_that_give_move_as_other_motions_do():
    rng, compared = np.random.default_rng(3), 0
    while compared < 40:
        system, phase, periods = mixed(rng), rng.uniform(0.0, 1.0), rng.uniform(0.5, 2.0)
        carrier = Carrier(system.cells({}), vi.Tolerances())
        x, _ = carrier.over(np.zeros(2 * len(system.mass)), 0.0, 6.0 + phase)
        place, _ = carrier.coordinates(x)
        if min(abs(stop.gap - stop.direction @ place) for stop in system.stops) < 1e-3:
            continue  # a neighbour of what rests lies beyond the stop
        _, derivative = carrier.over(x, phase, periods)
        steps = 1e-6 * np.abs(x).max() * np.array([1.0, 0.1])
        numbers = [
            np.column_stack([carrier.over(x + h * u, phase, periods)[0] - carrier.over(x - h * u, phase, periods)[0]
                             for u in np.eye(len(x))]) / (2.0 * h) for h in steps
        ]  # fmt: skip
        if np.abs(numbers[0] - numbers[1]).max() > 1e-5:
            continue  # nearly a graze
        compared += 1
        assert numbers[1] == pytest.approx(derivative, abs=1e-4 * max(1.0, np.abs(derivative).max()))


@pytest.mark.parametrize("early", [True, False])
@pytest.mark.parametrize("hardest", [5.411, 1.381])
def test_a_rest_whose_time_rounding_decides_ends_no_cycle(hardest, early):
    """As of one mass: neighbours part by more than 1e13 from one rest to the next, so no rest repeats another."""
    osc = RESTS[hardest]
    far = vi.Stop(direction=-1, gap=50.0 * osc.velocity_scale, restitution=0.5)
    for one in (one_mass(osc), one_mass(osc, stops=[*one_mass(osc).stops, far])):
        for model in (osc, one):
            cell = vi.parameter_map(model, omega=[osc.omega], indices=NAMED, early_closing=early).isel(omega=0)
            assert np.isneginf(cell["lyapunov_per_impact"])
            assert (int(cell["n_periods"]), int(cell["n_impacts"])) == (0, -1)


# Masses whose centre is free


def test_two_free_masses_have_the_exponent_of_the_one_mass_that_moves_as_one_does_from_the_other():
    pair = free_pair(0.5)
    one, _ = beside_its_centre(pair)
    (found, periods), (alone, _) = (index_of(model, "lyapunov", "n_periods") for model in (pair, one))
    assert periods == 0
    assert found == pytest.approx(alone, abs=0.02)  # of 3000 impacts of chaos
    assert alone == pytest.approx(0.196, abs=0.02)
    section = vi.impact_section(pair, transient_impacts=0, sample_impacts=100)
    assert section.sizes["stick"]  # in the transient, which took all of the deviation but the drift


def test_drag_and_loads_on_the_centre_alone_change_no_exponent():
    mass = np.diag([1.0, 3.0])
    load = vi.Force(omega=1.0, harmonics={1: [1.0, -1.0]})
    pushed = vi.Force(omega=1.0, harmonics={1: [2.0, 2.0]}, constant=[0.1, 0.3])
    plain, moved = (free_pair(mass=mass, force=force) for force in (load, pushed))
    named = [index_of(model, *NAMED, transient_impacts=500) for model in (plain, moved)]
    assert named[0][:2] == named[1][:2] == [1, 2]
    assert named[0][2] == pytest.approx(named[1][2], rel=1e-9)
    braked = free_pair(mass=mass, damping=1e-3 * mass, force=pushed)
    alone = index_of(beside_its_centre(braked)[0], *NAMED, transient_impacts=500)
    assert index_of(braked, *NAMED, transient_impacts=500) == pytest.approx(alone, abs=1e-3)  # a complex pair: 1/N


@pytest.mark.long
def test_free_masses_have_the_names_and_exponents_of_their_relative_motion():
    named = 0
    for seed in range(24):
        model = free_masses(seed)
        own, centres = beside_its_centre(model)
        indices = [
            index_of(
                one, "n_periods", "n_impacts", "max_velocity", "lyapunov", sample_impacts=500, transient_impacts=1500
            )
            for one in (model, own)
        ]
        assert centres > 0
        if any(0 < one[0] <= 8 for one in indices):
            assert indices[0][:2] == indices[1][:2], seed
            assert indices[0][2] == pytest.approx(indices[1][2], rel=1e-6)
            assert indices[0][3] == pytest.approx(indices[1][3], abs=0.02), seed  # a complex pair: 1/N
            named += 1
    assert named > 8
