"""Random designs in SI units, for tests of what must hold for any."""

import math

import mpmath as mp

import vibroimpact as vi
from oracles.cycles import one_impact
from oracles.motion import Oscillator

# Chaotic over 5,100 impacts, before they end in the motion named.
TRANSIENTS = {
    "period-16 impact-48": vi.ImpactOscillator(
        mass=2.7100628669094715,
        damping=0.005375363235924331,
        omega=0.454113487303927,
        restitution=0.930387431116233,
        gap=-0.16381753326560708,
    ),
    "period-16 impact-7": vi.ImpactOscillator(
        mass=2.329070381187245, damping=0.01597319150637318, omega=4.720499149104183, restitution=0.8209103043174075
    ),
}
# Hits once in several periods: a leap is no impact.
RARE = vi.ImpactOscillator(omega=0.95, gap=6.0, damping=0.02)
# Rests that only rounding repeats, and the hardest hit (m/s) of the period-1 impact-1 motion that they end in.
RESTS = {
    5.411: vi.ImpactOscillator(mass=0.2649, damping=0.00462, omega=4.9795, restitution=0.91, gap=-0.7844),
    1.381: vi.ImpactOscillator(mass=1.531, damping=0.0265, omega=2.4113, restitution=0.899, gap=-0.80236),
    2.114: vi.ImpactOscillator(mass=2.069, damping=0.0193, omega=1.741, restitution=0.908, gap=-0.77096),
}


@vi.family(units={"rpm": "1/min", "clearance_mm": "mm"})
def shaker(unbalance=0.002, rpm=1500.0, clearance_mm=0.5):
    """Return a mass shaken by an unbalance."""
    omega = rpm * 2 * math.pi / 60
    force, gap = unbalance * omega**2, clearance_mm / 1e3
    return vi.ImpactOscillator(mass=2.0, stiffness=3e4, damping=5.0, amplitude=force, omega=omega, gap=gap)


def random_designs(rng, number):
    """Yield oscillators of 1 g to 1 t, driven at 1 Hz to 2 kHz, that swing by 1 um to 1 cm, with gaps of both signs.

    From rest some 550 of a thousand settle to periodic impacts, 150 stick, 110 are chaotic, 150 do not hit, and 35 stay
    pressed against the stop.
    """
    for _ in range(number):
        mass = 10.0 ** rng.uniform(-3.0, 3.0)
        omega = 2.0 * math.pi * 10.0 ** rng.uniform(0.0, math.log10(2000.0))
        stiffness = mass * (omega / 10.0 ** rng.uniform(-0.5, 0.8)) ** 2
        deflection = 10.0 ** rng.uniform(-6.0, -2.0)
        plain = vi.ImpactOscillator(
            mass=mass,
            damping_ratio=10.0 ** rng.uniform(-3.5, -0.7),
            stiffness=stiffness,
            amplitude=stiffness * deflection,
            omega=omega,
            restitution=0.98 - 0.68 * rng.random() ** 2,
        )
        swing = min(plain.steady_amplitude, 4.0 * deflection)
        gaps = [0.0, rng.uniform(-1.1, 0.0) * deflection, rng.uniform(0.0, 1.0) * swing, rng.uniform(1.0, 3.0) * swing]
        yield plain.replace(gap=gaps[rng.choice(4, p=[0.15, 0.35, 0.25, 0.25])])


def random_oscillator(random, damped=(-3.0, -0.5), omega=(0.3, 5.0), restitution=(0.6, 0.98), gap=(-0.9, 2.5)):
    """Return a dimensionless oscillator, one in eleven of which is irregular from rest."""
    return vi.ImpactOscillator(
        mass=10 ** random.uniform(-0.5, 0.5),
        damping=10 ** random.uniform(*damped),
        omega=random.uniform(*omega),
        restitution=random.uniform(*restitution),
        gap=random.uniform(*gap),
    )


def orbit_of_one_impact(osc, n=1):
    """Return the state just before the impact of the period-n impact-1 orbit at gap 0, stable or not."""
    numbers = osc.mass, osc.damping, osc.stiffness, osc.amplitude, osc.omega, osc.restitution
    v, phase = one_impact(Oscillator(*map(mp.mpf, numbers)), n)
    return vi.State(0.0, float(v), float(phase) * osc.period)


def any_oscillator(rng):
    """Return an oscillator of any proportions, lightly or heavily damped, with a gap of either sign."""
    return vi.ImpactOscillator(
        mass=10 ** rng.uniform(-1, 1),
        damping=10 ** rng.uniform(-2, 1),
        stiffness=10 ** rng.uniform(-1, 1),
        amplitude=rng.uniform(0.1, 3),
        omega=10 ** rng.uniform(-0.5, 0.5),
        restitution=rng.uniform(0.1, 0.95),
        gap=rng.uniform(-0.5, 0.5),
    )
