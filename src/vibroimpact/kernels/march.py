"""The fixed-step scheme of the paper: classical fourth-order Runge-Kutta, contact seen at step ends only."""

from __future__ import annotations

import math

from vibroimpact.kernels.shared.machine import compiled


@compiled("a march", 1)
def march(law, y, v, step, last, impact_step, impact_velocity):
    """March from `step` to `last`, or until the arrays are full; return y, y', the step and the number of impacts.

    Time is origin + step h, not a sum over steps, which would gather rounding.
    """
    damp, stiff, drive, omega, gap, restitution, origin, h = law
    number = 0
    push = drive * math.sin(omega * (origin + step * h))
    while step < last and number < len(impact_step):
        push_mid = drive * math.sin(omega * (origin + (step + 0.5) * h))
        push_end = drive * math.sin(omega * (origin + (step + 1) * h))
        a1 = push - damp * v - stiff * y
        v2 = v + 0.5 * h * a1
        a2 = push_mid - damp * v2 - stiff * (y + 0.5 * h * v)
        v3 = v + 0.5 * h * a2
        a3 = push_mid - damp * v3 - stiff * (y + 0.5 * h * v2)
        v4 = v + h * a3
        a4 = push_end - damp * v4 - stiff * (y + h * v3)
        y += h / 6.0 * (v + 2.0 * (v2 + v3) + v4)
        v += h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
        push = push_end
        step += 1
        if y >= gap and v > 0.0:
            impact_step[number] = step
            impact_velocity[number] = v
            number += 1
            y, v = gap, -restitution * v
    return y, v, step, number
