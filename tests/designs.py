"""Random designs in SI units, for tests of what must hold for any."""

import math

import vibroimpact as vi


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
