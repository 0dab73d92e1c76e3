"""The motions with one impact in a cycle in closed form, in double precision: of one mass, and of linear systems."""

import cmath
import math

import numpy as np
from scipy.linalg import expm


def transition(osc, time):
    """Return E, cos(wd t) (cosh when overdamped) and the entry of the free transition matrix by which y' enters y."""
    half = osc.damping / (2 * osc.mass)
    rate = cmath.sqrt(osc.stiffness / osc.mass - half**2)
    decay = math.exp(-half * time)
    return decay, cmath.cos(rate * time).real, decay * (cmath.sin(rate * time) / rate).real


def response(osc, time):
    """Return alpha and beta: after an impact at v, the free part of a cycle of this length has y = -alpha v.

    Just before it y' is v, of which the steady motion has beta v.
    """
    decay, cosine, q = transition(osc, time)
    p = decay * cosine + osc.damping / (2 * osc.mass) * q
    delta = 1 - 2 * decay * cosine + decay**2
    return (1 + osc.restitution) * q / delta, -osc.restitution - (1 + osc.restitution) * (p - 1) / delta


def velocities(alpha, beta, omega, gap, reach):
    """Return the roots > 0 of (alpha^2 + beta^2/w^2) v^2 + 2 alpha g v + g^2 - R^2 = 0."""
    roots = np.roots([alpha**2 + (beta / omega) ** 2, 2 * alpha * gap, gap**2 - reach**2])
    return sorted(root.real for root in roots if root.imag == 0 and root.real > 0)


def trace(osc, time, phase, velocity):
    """Return the trace of the cycle's Jacobian."""
    decay, cosine, q = transition(osc, time)
    force = (osc.amplitude * math.sin(2 * math.pi * phase) - osc.stiffness * osc.gap) / osc.mass
    return -2 * osc.restitution * decay * cosine + (1 + osc.restitution) * q * force / velocity


def motions(model):
    """Return velocity, phase of contact and the state after it, of all motions with one impact in T, or in T/2.

    With two stops, that are mirror images, each is struck once in T; they may move as a sine.
    """
    hit, n, w, half = model.stops[0], len(model.mass), model.omega, len(model.stops) == 2
    a = hit.direction
    kappa = np.linalg.solve(model.mass, a) / (a @ np.linalg.solve(model.mass, a))
    flow = np.linalg.solve(model.mass, np.column_stack([-model.stiffness, -model.damping]))
    flight = expm(np.block([[np.zeros((n, n)), np.eye(n)], [flow]]) * 2 * math.pi / w / (1 + half))
    jump = (1 + hit.restitution) * np.concatenate([np.zeros(n), kappa])
    z = np.linalg.solve(-flight - np.eye(2 * n) if half else flight - np.eye(2 * n), jump)
    alpha, beta = -a @ z[:n], -hit.restitution - a @ z[n:]
    steady = np.linalg.solve(model.stiffness + 1j * w * model.damping - w**2 * model.mass, model.force.harmonics[1])
    reach, found = a @ steady - hit.motion.get(1, 0.0), []
    for v in velocities(alpha, beta, w, hit.gap, abs(reach)):
        wave = complex(beta * v / w, hit.gap + alpha * v) / reach  # exp(i w t)
        q, dq = (steady * wave).imag + z[:n] * v, w * (steady * wave).real + z[n:] * v
        found.append((v, cmath.phase(wave) / (2 * math.pi) % 1.0, q, dq))
    return found
