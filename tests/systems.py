"""Systems for tests, and the same in other units and coordinates."""

import numpy as np

import vibroimpact as vi
from vibroimpact.backends.reference.phases import LinearSystem
from vibroimpact.backends.reference.stops import CompliantStop, RigidStop
from vibroimpact.coexistence import Attractor
from vibroimpact.orbits import same_orbit
from witness import follow

CONTACT = ("impulse", "energy_lost", "peak_force", "contact_time", "penetration")

M = [[2.0, 0.5], [0.5, 1.0]]
C = [[0.3, -0.1], [-0.1, 0.2]]
K = [[300.0, -100.0], [-100.0, 100.0]]


def two_masses(**changes):
    """Return two coupled masses, the second one between two stops, one of which moves."""
    arguments = {
        "mass": M,
        "damping": C,
        "stiffness": K,
        "force": vi.Force(omega=8.0, harmonics={1: [5.0, 0.0], 3: [0.0, 0.5 + 0.25j]}, constant=[0.0, -2.0]),
        "stops": [
            vi.Stop(direction=[0, 1], gap=0.05, restitution=0.7, name="bar", motion={1: 0.01}),
            vi.Stop(direction=[0.5, -1], gap=0.02, name="baffle"),
        ],
    }
    return vi.ImpactSystem(**arguments | changes)


def one_mass(osc, **changes):
    """Return the system of one coordinate that an oscillator is."""
    arguments = {
        "mass": osc.mass,
        "damping": osc.damping,
        "stiffness": osc.stiffness,
        "force": vi.Force(omega=osc.omega, harmonics={1: osc.amplitude}),
        "stops": [vi.Stop(direction=1, gap=osc.gap, restitution=osc.restitution)],
    }
    return vi.ImpactSystem(**arguments | changes)


def cabinet(force, damping_ratio):
    """Return the system of a contact of 0.5 kg in a cabinet of 50 kg on soft isolators; its motions settle slowly."""
    stiffness, isolators = 0.5 * (2 * np.pi * 40) ** 2, 50.0 * (2 * np.pi * 2) ** 2
    damping, outer = 0.06 * np.sqrt(stiffness * 0.5), 2 * damping_ratio * np.sqrt(isolators * 50.0)
    return vi.ImpactSystem(
        mass=np.diag([50.0, 0.5]),
        damping=[[outer + damping, -damping], [-damping, damping]],
        stiffness=[[isolators + stiffness, -stiffness], [-stiffness, stiffness]],
        force=vi.Force(frequency=50.0, harmonics={1: [0.0, force]}),
        stops=[vi.Stop(direction=[-1.0, 1.0], gap=0.3e-3, restitution=0.6, name="stop")],
    )


FORMS = {"one mass": lambda osc: osc, "one mass as a system": one_mass}


def a_random_system(rng, n, s=2, damping=None):
    """Return a system with general matrices; its damping is gyroscopic, too. The stops of one mass are on one side."""
    mass, stiffness, spread = (rng.standard_normal((n, n)) for _ in range(3))
    skew = rng.standard_normal((n, n))
    stops = []
    for _ in range(s):
        direction, gap = rng.standard_normal(n), rng.uniform(0.1, 1.0)
        motion = {2: complex(*rng.standard_normal(2))}
        stops.append(vi.Stop(direction=abs(direction) if n == 1 else direction, gap=gap, motion=motion))
    return vi.ImpactSystem(
        mass=mass @ mass.T + np.eye(n),
        damping=0.1 * spread @ spread.T + skew - skew.T if damping is None else damping,
        stiffness=stiffness @ stiffness.T,
        force=vi.Force(
            omega=rng.uniform(0.5, 2.0),
            harmonics={1: rng.standard_normal(n) + 1j * rng.standard_normal(n), 3: rng.standard_normal(n)},
            constant=rng.standard_normal(n),
        ),
        stops=stops,
    )


def on_springs(rng):
    """Return one mass or two on springs, at one stop or between two, rigid or not, with and without gaps."""
    n = int(rng.integers(1, 3))
    springs = rng.uniform(0.5, 2.0, n + 1)
    stiffness = np.diag(springs[:-1] + springs[1:]) - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    stops = []
    for sign in (1.0, -1.0)[: int(rng.integers(1, 3))]:
        gives = {"stiffness": rng.uniform(5.0, 50.0), "damping": rng.choice([0.0, rng.uniform(0.0, 1.0)])}
        law = gives if rng.random() < 0.5 else {"restitution": rng.choice([0.0, rng.uniform(0.3, 0.9)])}
        gap = rng.choice([0.0, rng.uniform(0.05, 0.8)])
        stops.append(vi.Stop(direction=sign * np.eye(n)[-1], gap=gap, **law))
    return vi.ImpactSystem(
        mass=np.diag(rng.uniform(0.5, 2.0, n)),
        damping=rng.uniform(0.02, 0.1) * stiffness,
        stiffness=stiffness,
        force=vi.Force(omega=rng.uniform(0.5, 3.0), harmonics={1: np.eye(n)[0]}),
        stops=stops,
    )


def changed(system, mass=1.0, force=1.0, length=1.0, time=1.0, basis=None):
    """Return the system in other units and coordinates, q = `basis` q'."""
    arguments, basis = system.arguments(), np.eye(len(system.mass)) if basis is None else basis
    load = mass * length / time**2 * force
    stiff = load / length
    units = {"stiffness": stiff, "damping": stiff * time}

    def of(matrix, unit):
        return unit * (basis.T @ matrix @ basis)

    harmonics = {h: load * (basis.T @ p) for h, p in system.force.harmonics.items()}
    constant = None if system.force.constant is None else load * (basis.T @ system.force.constant)
    return vi.ImpactSystem(
        mass=of(arguments["mass"], stiff * time**2),
        damping=of(arguments["damping"], stiff * time),
        stiffness=of(arguments["stiffness"], stiff),
        force=vi.Force(omega=system.omega / time, harmonics=harmonics, constant=constant),
        stops=[
            stop.replace(
                direction=stop.direction @ basis,
                gap=length * stop.gap,
                motion={h: length * by for h, by in stop.motion.items()},
                **{kind: unit * getattr(stop, kind) for kind, unit in units.items() if stop.compliant},
            )
            for stop in system.stops
        ],
    )


def system(mass, damping, stiffness, omega, stops, force=None, constant=None):
    """Return a system under harmonics and a constant load."""
    load = vi.Force(omega=omega, harmonics=force or {}, constant=constant)
    return vi.ImpactSystem(mass=mass, damping=damping, stiffness=stiffness, force=load, stops=stops)


def impacts(model, sample, transient=0, **how):
    """Return its impacts from the first on, or after a transient."""
    return vi.impact_section(model, transient_impacts=transient, sample_impacts=sample, **how)


def drawn(rng, of_any_kind=False, number=None):
    """Return a random system of one to four coordinates and one to three stops, and a state in front of the rigid ones.

    Stops are rigid, and all but the first may move; or of any kind, and the first one is compliant. A `number` of them
    leaves more room.
    """
    n, s = int(rng.integers(1, 5)), int(rng.integers(1, 4)) if number is None else number
    nearest = 0.0 if number is None else 0.2

    def positive(least):
        root = rng.normal(size=(n, n))
        return root @ root.T / n + least * np.eye(n)

    mass, stiffness = positive(0.5), positive(0.2)
    if rng.random() < 0.25:
        free = rng.normal(size=n)
        keeps = np.eye(n) - np.outer(free, free) / (free @ free)
        stiffness = keeps @ stiffness @ keeps
    damping = 0.05 * positive(0.1) if rng.random() < 0.5 else 0.03 * mass + 0.02 * stiffness
    stops = [(a_random_stop if of_any_kind else a_rigid_stop)(rng, j, mass, nearest) for j in range(s)]
    force = {1: rng.normal(size=n) + 1j * rng.normal(size=n), 3: 0.5 * rng.normal(size=n)}
    model = system(mass, damping, (stiffness + stiffness.T) / 2, rng.uniform(0.3, 2.0), stops, force)
    rigid = [j for j, stop in enumerate(stops) if not stop.compliant]
    for _ in range(1000):
        q = 0.3 * rng.normal(size=n)
        if model.clearances(q)[rigid].min(initial=1.0) > 0.05:
            return model, q, rng.normal(size=n)
    return drawn(rng, of_any_kind, number)  # its stops leave too little room


def a_rigid_stop(rng, number, mass, nearest=0.0):
    """Return a rigid stop in any direction; every second one moves, but for that of number 0."""
    direction, gap = rng.normal(size=len(mass)), rng.uniform(nearest, nearest + 0.5)
    ratio = rng.choice([0.0, rng.uniform(0.1, 0.9)])
    moves = {2: 0.1 * complex(*rng.normal(size=2))} if number and rng.random() < 0.5 else {}
    return vi.Stop(direction=direction, gap=gap, restitution=ratio, motion=moves)


def a_random_stop(rng, number, mass, nearest=0.0):
    """Return a stop in any direction, rigid or, as that of number 0 is, from soft to stiff for what strikes it."""
    direction = rng.normal(size=len(mass))
    struck = 1.0 / (direction @ np.linalg.solve(mass, direction))
    k = struck * 10 ** rng.uniform(0, 5)
    soft = {"stiffness": k, "damping": rng.choice([0.0, 2.0 * rng.uniform(0, 1.2)]) * np.sqrt(k * struck)}
    rigid = {"restitution": rng.choice([0.0, rng.uniform(0.1, 0.9)])}
    moves = {2: 0.1 * complex(*rng.normal(size=2))} if rng.random() < 0.3 else {}
    kind = soft if number == 0 or rng.random() < 0.5 else rigid
    gap = rng.uniform(-0.1 if k < 100 * struck and kind is soft else nearest, nearest + 0.5)
    return vi.Stop(direction=direction, gap=gap, motion=moves, **kind)


def linear(model):
    """Return a system as the witness takes it."""
    load = np.zeros(len(model.mass)) if model.force.constant is None else model.force.constant
    stops = tuple(
        CompliantStop(stop.direction, stop.gap, stop.stiffness, stop.damping, motion=dict(stop.motion))
        if stop.compliant
        else RigidStop(stop.direction, stop.gap, stop.restitution, motion=dict(stop.motion))
        for stop in model.stops
    )
    matrices = model.mass, model.damping, model.stiffness
    return LinearSystem(*matrices, model.omega, load, dict(model.force.harmonics), stops)


def outcome(model, sample=100, **how):
    """Return how its motion ends."""
    return vi.Status(int(impacts(model, sample, **how)["status"]))


def difference(seed, model, q, speed, most=20):
    """Return how many impacts were compared, and the largest difference over the growth of errors up to it, with what.

    Errors are those of the start and, on the way, of clearances relative to the farthest that the system goes and of
    rates of contacts. A contact that is not over has no known impulse.
    """
    trajectory = follow(linear(model), q, speed, impacts=most, most_periods=30, cut=1e-9 * model.velocity_scale)
    number = min(len(trajectory.impacts), most)  # several at one instant may be more
    if not number:
        return 0, 0.0, ""
    near = q + 1e-9 * np.random.default_rng(seed).normal(size=len(q))
    farthest = max(1.0, *(np.abs(x[: len(q)]).max() for _, _, x in trajectory.pieces))
    changes = {f"{stop.name}_gap": stop.gap + 1e-9 * farthest for stop in model.stops}
    changes |= {f"{s.name}_stiffness": s.stiffness * (1 + 1e-9) for s in model.stops if s.compliant}
    moved = model.replace(**changes)
    own, other = (
        impacts(one, number, start=vi.State(at.tolist(), speed.tolist())) for one, at in ((model, q), (moved, near))
    )
    both = min(own.sizes["impact"], other.sizes["impact"])
    top = {name: np.nanmax(np.abs(own[name].values), initial=1e-3) for name in ("velocity", *CONTACT) if name in own}
    scales = top | {"time": model.period, "contact_time": model.period, "energy_lost": top["impulse"] * top["velocity"]}
    scales = {name: size for name, size in scales.items() if name in own}
    apart = [np.abs(other[name].values[:both] - own[name].values[:both]) / size for name, size in scales.items()]
    growth = np.maximum(np.maximum.accumulate(np.nanmax(apart, axis=0) / 1e-9), 1.0)
    sure, worst = np.flatnonzero(growth < 1e6), (0.0, "")
    pushing = {
        j: max((i for i in range(number) if trajectory.impacts[i].stop == j), default=-1) for j in trajectory.pushing
    }
    for at in sure:
        event = trajectory.impacts[at]
        if model.stop_names[event.stop] != own["stop"].values[at]:
            return len(sure), np.inf, f"stop of impact {at}"
        over = model.stops[event.stop].compliant and at not in pushing.values()
        over = over and event.time + event.exit_time <= trajectory.impacts[number - 1].time  # by impacts compared
        for name in scales if over else ("time", "velocity"):
            wrong = abs(getattr(event, name) - own[name].values[at]) / scales[name] / growth[at]
            worst = max(worst, (wrong if wrong == wrong else np.inf, f"{name} of impact {at}"))
    return len(sure), *worst


def a_random_machine(rng):
    """Return a chain of one to three masses, some of them free, between stops that are rigid or compliant.

    Gaps are 0 to 1.2 times what the steady motion closes, or preloads; in a fifth the stops move with their housing.
    """
    n = int(rng.integers(1, 4))
    mass, springs = np.diag(10.0 ** rng.uniform(-0.5, 0.5, n)), 10.0 ** rng.uniform(-0.7, 0.7, n + 1)
    springs[-1] *= rng.random() < 0.5
    if n > 1 and rng.random() < 0.25:
        springs[rng.integers(1, n)] = 0.0
    along = np.diff(np.eye(n + 1), axis=0, prepend=0.0)[:, :n]
    stiffness = along.T @ np.diag(springs) @ along
    damping = 10.0 ** rng.uniform(-2.5, -1.0) * stiffness + 10.0 ** rng.uniform(-2.5, -1.0) * mass
    force, omega = rng.standard_normal(n) + 1j * rng.standard_normal(n), rng.uniform(0.4, 3.0)
    direction = np.eye(n)[rng.integers(n)]
    if n > 1 and rng.random() < 0.4:
        direction = direction - np.roll(direction, 1)
    steady = np.linalg.solve(stiffness - omega**2 * mass + 1j * omega * damping, force)
    reach, two_sided = abs(direction @ steady), rng.random() < 0.6
    contact = (
        {"stiffness": 10.0 ** rng.uniform(0.3, 3.0) * springs[0], "damping": rng.choice([0.0, 0.3])}
        if rng.random() < 0.4
        else {"restitution": rng.uniform(0.1, 0.95)}
    )
    housing = 0.2 * reach * np.exp(1j * rng.uniform(0.0, 6.0)) * (rng.random() < 0.2)
    gaps = reach * rng.uniform([0.0 if two_sided else -0.2, 0.1], 1.2)
    sides = zip((1, -1), gaps, strict=True) if two_sided else [(1, gaps[0])]
    return vi.ImpactSystem(
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        force=vi.Force(omega=omega, harmonics={1: force}, constant=0.3 * rng.standard_normal(n) * (rng.random() < 0.3)),
        stops=[
            vi.Stop(direction=side * direction, gap=gap, motion={1: side * housing} if housing else {}, **contact)
            for side, gap in sides
        ],
    )


def free_masses(seed):
    """Return two or three masses without a spring to the ground between stops on one another, rigid or compliant ones,
    under loads that move their centre, too, some with drag in proportion to their masses.
    """
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 4))
    mass, between, damping = np.diag(rng.uniform(0.3, 2.0, n)), np.zeros((n, n)), np.zeros((n, n))
    if seed % 3 == 0:
        shape = rng.standard_normal((n, n))
        mass = shape @ shape.T + np.eye(n)
    for i, j in zip(*np.triu_indices(n, 1), strict=True):
        apart = np.eye(n)[i] - np.eye(n)[j]
        between += rng.uniform(0.2, 3.0) * (n == 3 and rng.random() < 0.5) * np.outer(apart, apart)
    stops = []
    for _ in range(int(rng.integers(1, 3))):
        i, j = rng.choice(n, 2, replace=False)
        contact = {"stiffness": rng.uniform(50.0, 300.0), "damping": rng.uniform(0.1, 2.0)}
        contact = contact if seed % 4 == 1 else {"restitution": rng.uniform(0.3, 0.9)}
        apart = np.eye(n)[i] - np.eye(n)[j]
        damping += rng.uniform(0.02, 0.3) * (rng.random() < 0.6) * np.outer(apart, apart)
        stops += [vi.Stop(direction=sign * apart, gap=rng.uniform(0.1, 0.8), **contact) for sign in (1, -1)]
    damping += 0.1 * between + 0.05 * (seed % 2) * mass
    load, constant = rng.standard_normal(n), rng.choice([0.0, 0.2]) * rng.standard_normal(n)
    return system(mass, damping, between, rng.uniform(0.7, 2.0), stops, {1: load}, constant)


def beside_its_centre(model):
    """Return a system in coordinates without the rigid-body motions that no stop feels, and how many those are."""
    felt = np.vstack([model.stiffness, [stop.direction for stop in model.stops]])
    _, sizes, rows = np.linalg.svd(felt)
    rank = int((sizes > 1e-10 * sizes[0]).sum())
    basis = np.linalg.svd(rows[rank:] @ model.mass)[2][len(rows) - rank :].T
    assert np.abs(rows[rank:] @ model.damping @ basis).max(initial=0.0) < 1e-12
    mass, damping, between = (basis.T @ part @ basis for part in (model.mass, model.damping, model.stiffness))
    between[np.abs(between) < 1e-13] = damping[np.abs(damping) < 1e-14] = 0.0
    constant = None if model.force.constant is None else model.force.constant @ basis
    stops = [stop.replace(direction=stop.direction @ basis) for stop in model.stops]
    load = {order: force @ basis for order, force in model.force.harmonics.items()}
    return system(mass, damping, between, model.omega, stops, load, constant), len(rows) - rank


def springs_of(n):
    """Return the stiffness of a chain of unit springs, whose last mass is free on one side."""
    stiffness = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    stiffness[-1, -1] = 1.0
    return stiffness


CHAIN = springs_of(3)


def chain(restitution=0.7, **changes):
    """Return three masses on springs, driven at one end, the other one before a stop."""
    arguments = {
        "mass": np.eye(3),
        "damping": 0.02 * CHAIN,
        "stiffness": CHAIN,
        "force": vi.Force(omega=0.9, harmonics={1: [1.0, 0.0, 0.0]}),
        "stops": [vi.Stop(direction=[0, 0, 1], gap=0.5, restitution=restitution, name="bar")],
    }
    return vi.ImpactSystem(**arguments | changes)


def facing(direction, gap, restitution):
    """Return two stops that are mirror images of each other."""
    return [
        vi.Stop(direction=sign * np.array(direction), gap=gap, restitution=restitution, name=name)
        for sign, name in ((1, "above"), (-1, "below"))
    ]


def two_sided(omega=2.0, restitution=0.6, gap=0.5, **changes):
    """Return a driven mass on a spring between two stops."""
    arguments = {
        "mass": 1.0,
        "damping": 0.05,
        "stiffness": 1.0,
        "force": vi.Force(omega=omega, harmonics={1: 1.0}),
        "stops": facing([1.0], gap, restitution),
    }
    return vi.ImpactSystem(**arguments | changes)


def symmetric_orbit(model, stops="above", **how):
    """Return a stable symmetric orbit that strikes those stops in each half of its period."""
    return next(orbit for orbit in vi.find_orbit(model, stops=stops, symmetric=True, **how) if orbit.stable)


STEEL = vi.ImpactSystem(  # in SI units; swept up from gap 0 it hits until its fold at 0.672389 mm
    mass=2,
    damping=4,
    stiffness=2e4,
    force=vi.Force(omega=150, harmonics={1: 5}),
    stops=[vi.Stop(direction=1, gap=0, stiffness=2e5)],
)
TWINS = two_sided(5.0, 0.8, 0.05)  # a motion of two impacts, its mirror image, and one clear of the stops


def impact_damper(**changes):
    """Return a driven mass on a spring with a free one between two stops on it."""
    arguments = {
        "mass": np.diag([1.0, 0.1]),
        "damping": np.diag([0.02, 0.0]),
        "stiffness": np.diag([1.0, 0.0]),
        "force": vi.Force(omega=1.0, harmonics={1: [1.0, 0.0]}),
        "stops": facing([-1.0, 1.0], 10.0, 0.8),
    }
    return vi.ImpactSystem(**arguments | changes)


def free_pair(gap=3.0, **changes):
    """Return two free masses between two stops on each other, with a load on either."""
    arguments = {
        "mass": np.eye(2),
        "damping": 0.0,
        "stiffness": 0.0,
        "force": vi.Force(omega=1.0, harmonics={1: [1.0, -1.0]}),
        "stops": [vi.Stop(direction=[sign, -sign], gap=gap, restitution=0.5) for sign in (1, -1)],
    }
    return vi.ImpactSystem(**arguments | changes)


def uncoupled(damping, stiffness, stops, load=(1.0, 0.0), omega=2.0, constant=None):
    """Return two masses, each on a spring and a damper of its own."""
    return vi.ImpactSystem(
        mass=np.eye(2),
        damping=np.diag(damping),
        stiffness=np.diag(stiffness),
        force=vi.Force(omega=omega, harmonics={1: [*load]}, constant=constant),
        stops=stops,
    )


def random_pair(seed):
    """Return two masses on springs between walls, the second one between two stops."""
    rng = np.random.default_rng(seed)
    k, m, c = rng.uniform(0.5, 2, 3), rng.uniform(0.5, 2, 2), rng.uniform(0.02, 0.1)
    stiffness = np.array([[k[0] + k[1], -k[1]], [-k[1], k[1] + k[2]]])
    gaps, symmetric = [rng.uniform(0.1, 0.8)], rng.random() < 0.5
    bounces = [rng.uniform(0.3, 0.9)]
    gaps += gaps if symmetric else [rng.uniform(0.1, 0.8)]
    bounces += bounces if symmetric else [rng.uniform(0.3, 0.9)]
    stops = [vi.Stop(direction=[0, sign], gap=gap, restitution=bounce, name=name) for sign, gap, bounce, name in
             zip((1, -1), gaps, bounces, ("right", "left"), strict=True)]  # fmt: skip
    return system(np.diag(m), c * stiffness, stiffness, rng.uniform(0.5, 3), stops, {1: [1.0, 0.0]})


THREE = random_pair(19)  # period-2 impact-6, period-3 impact-8, no impact


def bouncing_ball(gamma, restitution=0.5, omega=3.0, gravity=9.81):
    """Return a ball on a table whose acceleration is at most gamma g."""
    moves = {1: -gamma * gravity / omega**2}
    table = vi.Stop(direction=-1, gap=0.0, restitution=restitution, name="table", motion=moves)
    return system(0.3, 0.0, 0.0, omega, [table], constant=-0.3 * gravity)


def between_stops(omega):
    """Return two masses, the second one between two stops; their symmetric motion loses its stability below 0.967."""
    K = np.array([[2.9, -1.6], [-1.6, 1.6]])
    return vi.ImpactSystem(
        mass=np.diag([1.1, 0.8]),
        damping=0.017 * K,
        stiffness=K,
        force=vi.Force(omega=omega, harmonics={1: [1.0, 0.0]}),
        stops=[vi.Stop(direction=[0.0, side], gap=0.7, restitution=0.81) for side in (1.0, -1.0)],
    )


def sticking():
    """Return two coupled masses, one of which comes to rest at a stop: the other remembers."""
    return vi.ImpactSystem(
        mass=np.eye(2),
        damping=[[0.05, -0.02], [-0.02, 0.05]],
        stiffness=[[2.0, -1.0], [-1.0, 2.0]],
        force=vi.Force(omega=0.4, harmonics={1: [1.0, -0.8j]}),
        stops=[
            vi.Stop(direction=[1, 0], gap=0.0, restitution=0.0),
            vi.Stop(direction=[0, 1], gap=0.3, restitution=0.6),
        ],
    )


def cantilever(elements, length=1.0):
    """Return the matrices of a clamped beam of unit mass per length and rigidity: Petyt's of its elements, M and K."""
    k = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]], float) / length**3
    m = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]], float) * length / 420.0
    scale = np.outer([1.0, length, 1.0, length], [1.0, length, 1.0, length])
    whole = np.zeros((2, 2 * elements + 2, 2 * elements + 2))
    for at in range(0, 2 * elements, 2):
        whole[:, at : at + 4, at : at + 4] += np.array([m, k]) * scale
    return whole[:, 2:, 2:]


def a_symmetric_system(rng, n):
    """Return a random system of n coordinates between two stops that move and are mirror images of each other."""
    system = a_random_system(rng, n, s=1)
    (stop,), force = system.stops, system.force
    motion = {1: 0.1 + 0.2j, 2: 0.05}
    stops = [
        stop.replace(motion=motion, name="above"),
        stop.replace(
            direction=-2.0 * stop.direction, gap=2.0 * stop.gap, motion={1: -0.2 - 0.4j, 2: 0.1}, name="below"
        ),
    ]
    load = vi.Force(omega=force.omega, harmonics=dict(force.harmonics))
    return vi.ImpactSystem(**system.arguments() | {"force": load, "stops": stops})


@vi.family
def pushed(force=1.0):
    """Return one mass on a spring before a stop without a gap: the force only changes the size of its motions."""
    return one_mass(vi.ImpactOscillator(omega=2.0, amplitude=force))


@vi.family
def pushed_pair(force=1.0):
    """Return two masses on springs, the second one before a stop without a gap."""
    pair = random_pair(4)
    return system(
        pair.mass, pair.damping, pair.stiffness, pair.omega, [pair.stops[0].replace(gap=0.0)], {1: [force, 0.0]}
    )


def mirrored(one, other):
    """Return whether a cycle of a two-sided oscillator is another one, mirrored and half a period later."""
    swapped = tuple({"above": "below", "below": "above"}[stop] for stop in other.stops)
    later = Attractor("periodic", velocities=other.velocities, phases=tuple((p + 0.5) % 1 for p in other.phases))
    turns = [tuple(np.roll(swapped, shift).tolist()) for shift in range(len(swapped))]
    return one.stops in turns and same_orbit(one, later, tolerance=1e-9)
