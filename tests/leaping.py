"""Systems in the rows of the engine's kernels, and where matrix exponentials take them."""

import numpy as np
from scipy.linalg import expm

import vibroimpact as vi
from vibroimpact.backends.modal.rows import in_steps, steps_of
from vibroimpact.backends.modal.sweep import layout_for
from vibroimpact.kernels.systems.leap import FAR, WHOLE, leap, leap_far, look

PARTS = 100


def remade(model, **changes):
    return vi.ImpactSystem(**model.arguments() | changes)


class Leaping:
    """A system in the engine's rows, and the matrix of (q, v, 1, sin hwt, cos hwt)' of its equations."""

    def __init__(self, model):
        far = remade(model, stops=[stop.replace(gap=1e3) for stop in model.stops])  # there is room for a start
        cells, n = far.cells({}), len(model.mass)
        self.k, self.cells, self.step = layout_for(cells), cells, float(steps_of(cells)[0])
        self.table, self.mass = in_steps(cells, 1e-9, self.k), model.mass
        inverse, constant = np.linalg.inv(model.mass), model.force.constant
        orders = sorted(model.force.harmonics | {h: 0 for stop in model.stops for h in stop.motion})
        self.matrix = np.zeros((2 * n + 1 + 2 * len(orders),) * 2)
        self.matrix[:n, n : 2 * n] = np.eye(n)
        self.matrix[n : 2 * n, : 2 * n + 1] = inverse @ np.column_stack(
            [-model.stiffness, -model.damping, np.zeros(n) if constant is None else constant]
        )
        self.waves, self.rounding = np.array(orders), 1e-13 * max(1.0, 1.0 / self.step)
        self.seen = np.zeros((len(model.stops), len(self.matrix)))
        self.seen[:, :n] = [-stop.direction for stop in model.stops]
        for place, order in enumerate(orders):
            at, push = 2 * n + 1 + 2 * place, inverse @ model.force.harmonics.get(order, np.zeros(n))
            self.matrix[n : 2 * n, at], self.matrix[n : 2 * n, at + 1] = push.real, push.imag
            self.matrix[at, at + 1], self.matrix[at + 1, at] = order * model.omega, -order * model.omega
            moved = np.array([stop.motion.get(order, 0.0) for stop in model.stops], complex)
            self.seen[:, at], self.seen[:, at + 1] = moved.real, moved.imag

    def state(self, rng):
        """Return a random state of some size, at a random phase."""
        n, angle = self.k.modes, rng.uniform(0.0, 2.0 * np.pi)
        waves = np.column_stack([np.sin(self.waves * angle), np.cos(self.waves * angle)]).ravel()
        free = rng.standard_normal(2 * n) * 10.0 ** rng.uniform(-2, 1)
        free[n:] *= 10.0 ** rng.uniform(-1, 1)
        return np.concatenate([free, [1.0], waves]), angle

    def course(self, state, length, points=PARTS):
        """Return the states on the way, and what the clearances are but for the gaps."""
        step, states = expm(self.matrix * self.step * length / points), [state]
        for _ in range(points):
            states.append(step @ states[-1])
        return np.array(states), np.array(states) @ self.seen.T

    def leap(self, state, angle, gaps, kinds, length, deviation=None):
        """Return whether a leap is made from there, and coordinates and velocities after it, or a neighbour's."""
        k, form, rows = self.k, self.cells.shapes[0], np.zeros(self.k.rows)
        rows[: k.constants], rows[k.pace] = self.table[0], 1.0
        inverse, n = np.linalg.inv(form), k.modes
        rows[k.eta : k.eta + n] = inverse @ state[:n]
        rows[k.rate : k.rate + n] = inverse @ state[n : 2 * n] * self.step
        if deviation is not None:
            k = k._replace(thorough=True)
            rows[k.deta : k.deta + n], rows[k.drate : k.drate + n] = (
                inverse @ deviation[:n],
                (inverse @ deviation[n : 2 * n] * self.step),
            )
        rows[k.turn : k.turn + 2] = np.sin(angle), np.cos(angle)
        rows[k.gap : k.gap + k.stops], rows[k.kind : k.kind + k.stops] = gaps, kinds
        rows[k.calm] = np.inf  # all stops are looked at
        before = rows.copy()
        look(rows, k, None)
        if length == FAR:
            leap_far.part(rows, k, None, True)
            made = round(rows[k.age] / FAR)
        else:
            made = leap(rows, k, None, length == WHOLE, True)
        if not made:
            np.testing.assert_array_equal(rows[: k.reference], before[: k.reference])
        y, p = (k.eta, k.rate) if deviation is None else (k.deta, k.drate)
        return made, np.concatenate([form @ rows[y : y + n], form @ rows[p : p + n] / self.step])
