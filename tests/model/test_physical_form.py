"""One mass in front of a stop is a system of one coordinate, and both say the same."""

import numpy as np
import pytest
from scipy.optimize import linprog, nnls

import vibroimpact as vi
from vibroimpact.coexistence.losses import attracts, driven, lasting_stops, rest_is_contact
from vibroimpact.matrices import nearest

pytestmark = pytest.mark.usefixtures("modal_engine")


def random_oscillator(seed):
    """One of any size and stiffness, with and without damping, loss, force and preload."""
    rng = np.random.default_rng([40, seed])
    mass, stiffness = 10.0 ** rng.uniform(-3.0, 3.0, 2)
    amplitude = rng.choice([0.0, 10.0 ** rng.uniform(-3.0, 3.0)])
    return vi.ImpactOscillator(
        mass=mass,
        stiffness=stiffness,
        damping_ratio=rng.choice([0.0, 1e-6, 0.01, 1.5]),
        amplitude=amplitude,
        omega=np.sqrt(stiffness / mass) * rng.uniform(0.1, 5.0),
        restitution=rng.choice([0.0, 0.5, 1.0]),
        gap=rng.choice([0.0, -1.0, 1.0]) * 10.0 ** rng.uniform(-3.0, 1.0),
    )


@pytest.mark.parametrize("seed", range(60))
def test_losses_loads_and_scale_of_one_mass_are_those_of_its_physical_form(seed):
    osc = random_oscillator(seed)
    form = osc.modal()
    assert driven(form) == (osc.amplitude > 0.0)
    assert rest_is_contact(form) == (osc.gap <= 0.0)
    assert attracts(osc) == (osc.damping > 0.0 or osc.restitution < 1.0)
    assert lasting_stops(osc).tolist() == lasting_stops(osc.system).tolist()
    assert np.sqrt(form.squares) == pytest.approx([osc.natural_frequency])
    if osc.amplitude or osc.gap:  # without either any speed is alike
        assert osc.system.velocity_scale == pytest.approx(osc.velocity_scale)


@pytest.mark.parametrize("seed", range(60))
def test_its_first_impacts_are_those_of_its_physical_form(seed):
    """Both engines make six from rest; rounding has not grown by then, unless one of them is hardly an impact."""
    osc = random_oscillator(seed)
    mine, theirs = (vi.impact_section(model, transient_impacts=0, sample_impacts=6) for model in (osc, osc.system))
    hard = mine.velocity.values > 1e-4 * osc.velocity_scale
    first = len(hard) if hard.all() else int(hard.argmin())
    for name in ("time", "velocity"):
        assert theirs[name].values[:first] == pytest.approx(mine[name].values[:first], rel=1e-8)


@pytest.mark.parametrize("seed", range(60))
def test_the_nearest_point_before_many_stops_is_pushed_by_those_that_it_touches_and_there_is_none_without_room(seed):
    """It is in front of all, M q = -D' p with p >= 0 on those that it touches; a linear program tells if none is."""
    rng = np.random.default_rng([99, seed])
    n, number = int(rng.integers(1, 7)), int(rng.choice([3, 9, 64]))
    root = rng.normal(size=(n, n))
    mass = root @ root.T + 0.1 * np.eye(n)
    directions = rng.normal(size=(number, n)) * 10.0 ** rng.uniform(-2.0, 2.0, (number, 1))
    bounds = np.abs(directions).max(axis=1) * rng.uniform(-0.2, 1.0, number)
    if seed % 3 == 0:
        bounds = directions @ rng.normal(size=n) + rng.uniform(0.0, 0.3, number)
    room = linprog(np.zeros(n), directions, bounds, bounds=(None, None)).status == 0
    q = nearest(mass, directions, bounds)
    assert (q is not None) == room
    if q is not None:
        size = np.abs(directions) @ np.abs(q) + np.abs(bounds)
        depth = directions @ q - bounds
        assert (depth <= 1e-10 * size).all()
        touched = depth >= -1e-10 * size
        _, left = nnls(-directions[touched].T, mass @ q) if touched.any() else (0.0, np.abs(q).max())
        assert left <= 1e-8 * np.abs(mass @ q).max()
