"""One mass in front of a stop is a system of one coordinate, and both say the same."""

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact.coexistence.losses import attracts, driven, lasting_stops, rest_is_contact

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
