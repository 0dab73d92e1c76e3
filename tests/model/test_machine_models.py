"""Ready-made models: natural frequencies, rest positions, clearances and struck masses are those of the machine."""

import inspect
import math
import pickle

import numpy as np
import pytest
from scipy.special import zeta

import vibroimpact as vi
from oracles.one_impact import motions
from systems import linear, two_sided
from vibroimpact import models
from vibroimpact.models.arguments import TABLE
from vibroimpact.models.beam_modes import beam_modes
from vibroimpact.verdict.ranges import check_parameters
from witness import follow

MODELS = {name: getattr(models, name) for name in models.__all__}
SYSTEMS = {name: model for name, model in MODELS.items() if isinstance(model(), vi.ImpactSystem)}
BEAMS = {
    "clamped-free": models.cantilever_with_stop,
    "clamped-clamped": models.clamped_beam_with_stop,
    "clamped-pinned": models.clamped_pinned_beam_with_stop,
    "pinned-pinned": models.pinned_beam_with_stop,
}
TUBES = {"pinned-pinned": models.tube_in_supports, "clamped-clamped": models.clamped_tube_in_supports}
HERTZ = 2.0 * math.pi


def rest(system):
    """Return where the constant load holds a system without stops."""
    return np.linalg.solve(system.stiffness, system.force.constant)


def receptance(system, omega):
    """Return the complex steady response of all coordinates to the first harmonic, without stops."""
    dynamic = system.stiffness - omega**2 * system.mass + 1j * omega * system.damping
    return np.linalg.solve(dynamic, system.force.harmonics[1])


def opposite(stop, other):
    """Return whether two stops face each other."""
    return np.array_equal(stop.direction, -other.direction)


# What all have in common


@pytest.mark.parametrize("name", MODELS)
def test_a_model_takes_numbers_by_name_and_needs_none(name):
    for argument, parameter in inspect.signature(MODELS[name]).parameters.items():
        assert parameter.kind is inspect.Parameter.KEYWORD_ONLY
        if TABLE[argument].follows:
            assert parameter.default is None, argument
            continue
        assert isinstance(parameter.default, (int, float)), argument
        assert TABLE[argument].check(parameter.default) == parameter.default


@pytest.mark.parametrize("name", [name for name, model in MODELS.items() if "_restitution" in str(model.parameters)])
def test_each_side_may_have_a_restitution_of_its_own_and_has_the_common_one_else(name):
    own = [side for side, parameter in MODELS[name].parameters.items() if parameter.follows == "restitution"]
    assert own
    assert {stop.restitution for stop in MODELS[name](restitution=0.3).stops} == {0.3}
    for side in own:
        stop = side.removesuffix("_restitution")
        changed = {at.name: at.restitution for at in MODELS[name](restitution=0.3, **{side: 0.9}).stops}
        assert changed.pop(stop) == 0.9
        assert set(changed.values()) == {0.3}
        family = vi.family(MODELS[name])
        assert getattr(family.replace(restitution=0.2), side) == 0.2
        assert family.replace(**{side: 0.9}).at(restitution=0.3) == MODELS[name](restitution=0.3, **{side: 0.9})


def test_every_number_in_the_table_is_one_of_a_model():
    assert {name for model in MODELS.values() for name in model.parameters} == set(TABLE)


@pytest.mark.parametrize("name", MODELS)
def test_a_family_of_a_model_makes_the_same_and_knows_units_and_ranges(name):
    model, machine = vi.family(MODELS[name]), MODELS[name]()
    assert model() == machine
    assert pickle.loads(pickle.dumps(model)) == model
    counts = ("modes", "particles", "supports")
    changed = {argument: 0.99 * value for argument, value in model.values.items() if argument not in counts}
    assert model.replace(**changed)() == MODELS[name](**changed) != machine
    assert dict(model.parameters) == MODELS[name].parameters
    if "restitution" in model.parameters:
        with pytest.raises(ValueError, match="`restitution` must be between 0 and 1"):
            model(restitution=1.5)


def test_units_of_a_ready_made_model_may_be_overruled():
    table = vi.family(units={"rpm": "rev/min"})(models.idle_gear).parameters
    assert (table["rpm"].unit, table["backlash"].unit, table["rpm"].low) == ("rev/min", "m", 0.0)


@pytest.mark.parametrize("name", MODELS)
def test_a_docstring_has_a_sketch_its_sources_and_what_is_left_out(name):
    text = MODELS[name].__doc__
    for part in ("Sketch: ", ".. math::", "Parameters\n", "References\n", "eft out", "Examples\n"):
        assert part in text
    for argument in MODELS[name].parameters:
        assert argument in text


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_machine_starts_clear_of_its_stops(name):
    system = SYSTEMS[name]()
    assert (system.clearances(np.zeros(len(system.mass))) >= 0.0).all()


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_machine_knocks_from_rest_on_with_its_defaults(name):
    system = SYSTEMS[name]()
    at, speed, _ = system.initial()
    motion = follow(linear(system), at, speed, impacts=40, most_periods=120)
    assert motion.ended == "impacts"


# Exponents of kg, m and s
UNITS = {
    "1": (0, 0, 0), "deg": (0, 0, 0), "kg": (1, 0, 0), "m": (0, 1, 0), "Hz": (0, 0, -1), "1/min": (0, 0, -1),
    "N": (1, 1, -2), "N/m": (1, 0, -2), "Pa": (1, -1, -2), "m/s^2": (0, 1, -2), "kg m": (1, 1, 0), "kg/m^3": (1, -3, 0),
    "kg m^2": (1, 2, 0), "rad/s^2": (0, 0, -2), "N m": (1, 2, -2), "N m s/rad": (1, 2, -1),
    "N s/m": (1, 0, -1),
}  # fmt: skip


@pytest.mark.parametrize("name", MODELS)
def test_in_other_units_the_machine_is_the_same(name):
    mass, length, time = 8.0, 4.0, 0.5
    model, one = vi.family(MODELS[name]), MODELS[name]()
    other = {}
    for argument, value in model.values.items():
        kg, m, s = UNITS[model.parameters[argument].unit]
        other[argument] = value * mass**kg * length**m * time**s
    two = MODELS[name](**other)
    assert two.period == pytest.approx(time * one.period, rel=1e-14)
    assert two.velocity_scale == pytest.approx(length / time * one.velocity_scale, rel=1e-13)
    if name not in SYSTEMS:
        assert (two.mass, two.gap) == pytest.approx((mass * one.mass, length * one.gap), rel=1e-15)
        assert two.natural_frequency == pytest.approx(one.natural_frequency / time, rel=1e-14)
        return
    assert two.natural_frequencies == pytest.approx(one.natural_frequencies / time, rel=1e-13)
    assert two.modal().mobility == pytest.approx(one.modal().mobility / mass, rel=1e-13, abs=1e-15)
    assert two.clearances(np.zeros(len(two.mass)), 0.2 * two.period) == pytest.approx(
        length * one.clearances(np.zeros(len(one.mass)), 0.2 * one.period), rel=1e-13
    )


# One mass


def test_a_two_sided_oscillator_has_its_frequency_and_its_clearances():
    system = models.two_sided_oscillator(mass=3.0, stiffness=1200.0, left_gap=0.2, right_gap=0.1)
    assert system.natural_frequencies[0] == pytest.approx(20.0, rel=1e-15)
    assert system.clearances([-0.2]).tolist() == pytest.approx([0.0, 0.3], abs=1e-16)
    assert system.clearances([0.1]).tolist() == pytest.approx([0.3, 0.0], abs=1e-16)
    assert opposite(*system.stops)
    with pytest.raises(ValueError, match="`stops` 'left' and 'right' overlap by 0.1 m"):
        models.two_sided_oscillator(left_gap=-0.3, right_gap=0.2)


def test_a_bilinear_oscillator_swings_with_one_spring_and_with_both():
    """Free and undamped it takes half a period of each; the push at its static deflection is that of the spring."""
    rig = models.bilinear_oscillator(
        mass=2.0, stiffness=800.0, stop_stiffness=4200.0, gap=0.0, force=0.0, damping_ratio=0.0, stop_damping=0.0
    )
    hits = vi.impact_section(rig, start=vi.State(-0.01, 0.0), transient_impacts=0, sample_impacts=5)
    assert np.diff(hits["time"]) == pytest.approx(math.pi / 20.0 + math.pi / 50.0, rel=1e-13)
    assert hits["peak_force"].values[:-1] == pytest.approx(4200.0 * 0.01 * 20.0 / 50.0, rel=1e-12)


def symmetric(system):
    """Return the velocity of the symmetric motion with an impact on each side per period."""
    assert opposite(*system.stops)
    return max(velocity for velocity, *_ in motions(system))


def test_the_symmetric_motion_of_a_two_sided_oscillator_has_its_known_velocity():
    system = models.two_sided_oscillator(
        mass=1.0, stiffness=1.0, damping_ratio=0.025, force=1.0, frequency=2.0 / HERTZ, left_gap=0.5, right_gap=0.5,
        restitution=0.6,
    )  # fmt: skip
    assert symmetric(system) == pytest.approx(1.01091975000998629752895, rel=1e-12)


def test_the_symmetric_motion_of_an_impact_damper_has_its_known_velocity():
    system = models.impact_damper(
        mass=1.0, natural_frequency=1.0 / HERTZ, damping_ratio=0.01, force=1.0, frequency=1.0 / HERTZ,
        particle_mass=0.1, clearance=20.0, restitution=0.8,
    )  # fmt: skip
    assert symmetric(system) == pytest.approx(9.407221992561745893002965, rel=1e-12)


def test_the_symmetric_motion_of_an_impact_pair_is_that_of_free_flights():
    amplitude, frequency, clearance, r = 1e-3, 30.0, 1.5e-3, 0.6
    system = models.impact_pair(amplitude=amplitude, frequency=frequency, clearance=clearance, restitution=r)
    system = vi.ImpactSystem(**{**system.arguments(), "force": vi.Force(frequency=frequency, harmonics={1: 0.0})})
    closing = symmetric(system)
    # The mass flies at +W before an impact and at -W after it, while the wall moves at w: W - w = v, W + w = r v.
    flight, wall = 0.5 * (1.0 + r) * closing, -0.5 * (1.0 - r) * closing
    place = flight * system.period / 4.0 - 0.5 * clearance  # of the frame, A sin(wt) at the impact
    assert math.hypot(place, wall / system.omega) == pytest.approx(amplitude, rel=1e-12)


def test_a_base_s_acceleration_pushes_with_the_mass():
    osc = models.base_excited_oscillator(mass=0.5, base_acceleration=20.0, frequency=40.0)
    # y = z - Y sin(wt) with z the absolute displacement obeys m z'' + c y' + k y = 0.
    amplitude, omega = 20.0 / (HERTZ * 40.0) ** 2, HERTZ * 40.0
    y = osc.amplitude / (osc.stiffness - osc.mass * omega**2 + 1j * osc.damping * omega)
    inertia = -osc.mass * omega**2 * (y + amplitude)
    assert abs(inertia + (osc.stiffness + 1j * osc.damping * omega) * y) < 1e-13 * abs(inertia)


def test_an_unbalance_pulls_with_the_square_of_the_speed():
    slow, fast = (models.unbalanced_machine(unbalance=0.02, rpm=rpm) for rpm in (600.0, 1200.0))
    assert slow.omega == pytest.approx(20.0 * math.pi, rel=1e-15)
    assert slow.amplitude == pytest.approx(0.02 * (20.0 * math.pi) ** 2, rel=1e-15)
    assert fast.amplitude == pytest.approx(4.0 * slow.amplitude, rel=1e-15)
    assert (slow.replace(frequency=1.0), slow.gap) == (fast.replace(frequency=1.0, amplitude=slow.amplitude), fast.gap)


# Free masses


def test_a_bouncing_ball_lies_on_its_table_and_falls_with_g():
    ball = models.bouncing_ball(mass=2.0, amplitude=0.3, frequency=5.0, gravity=9.0)
    assert (ball.mass.item(), ball.stiffness.item(), ball.damping.item()) == (2.0, 0.0, 0.0)
    assert ball.force.constant.tolist() == [-18.0]
    for turn in (0.0, 0.25, 0.6):
        table = 0.3 * math.sin(2.0 * math.pi * turn)
        assert ball.clearances([1.0], turn * ball.period)[0] == pytest.approx(1.0 - table, rel=1e-14)


def test_default_ball_can_bounce_once_per_period_and_that_is_stable():
    ball = models.bouncing_ball()
    (table,) = ball.stops
    gamma = abs(table.motion[1]) * ball.omega**2 / -(ball.force.constant[0] / ball.mass[0, 0])
    assert 1.047197551197 < gamma < 1.526823700519  # fold and period doubling at r = 0.5


def test_the_slot_of_an_impact_pair_moves_with_its_frame_and_keeps_its_length():
    pair = models.impact_pair(amplitude=2e-3, clearance=6e-3, inclination=30.0, gravity=10.0, mass=0.4)
    assert pair.force.constant.tolist() == pytest.approx([-2.0], rel=1e-15)
    for turn in (0.1, 0.25, 0.7):
        left, right = pair.clearances([1e-3], turn * pair.period)
        assert left + right == pytest.approx(6e-3, rel=1e-14)
        assert right == pytest.approx(3e-3 + 2e-3 * math.sin(2.0 * math.pi * turn) - 1e-3, rel=1e-13)


def test_an_idle_gear_strikes_with_its_inertia_over_the_radius_squared():
    gear = models.idle_gear(inertia=2e-3, base_radius=0.05, backlash=0.2e-3, rpm=1500.0, order=2.0)
    assert 1.0 / np.diag(gear.modal().mobility) == pytest.approx([0.8, 0.8], rel=1e-15)
    assert gear.frequency == pytest.approx(50.0, rel=1e-15)
    drive, coast = gear.stops
    assert opposite(drive, coast)
    # At mean position of the driving gear, the driving flank is half a backlash behind, in rad over the radius.
    assert gear.clearances([-0.1e-3 / 0.05])[0] == pytest.approx(0.0, abs=1e-19)
    swing = 600.0 / gear.omega**2
    front = gear.clearances([swing], 0.25 * gear.period)  # at rest in the middle of the backlash, both turned
    assert front == pytest.approx([0.1e-3, 0.1e-3], rel=1e-12)


def test_the_teeth_of_a_gear_pair_rest_on_the_flank_that_drives_and_swing_there_as_a_spring():
    pair = models.gear_pair(transmission_error=0.0, mesh_damping_ratio=0.0, backlash=1e-4, torque=20.0)
    mass, push = pair.mass.item(), 20.0 / 0.05
    assert mass == pytest.approx(1.0 / (0.05**2 / 2e-3 + 0.05**2 / 2e-3), rel=1e-15)
    # Let go 1 um off the flank that drives, it falls on it and is caught by a half sine about its static deflection.
    hits = vi.impact_section(pair, start=vi.State(49e-6, 0.0), transient_impacts=0, sample_impacts=3)
    speed, static = math.sqrt(2.0 * push / mass * 1e-6), push / 2e8
    assert set(hits["stop"].values) == {"drive"}
    assert hits["velocity"].values == pytest.approx(speed, rel=1e-9)
    assert hits["penetration"].values[0] == pytest.approx(static + math.hypot(static, speed * (mass / 2e8) ** 0.5))


# Structures


def test_an_impact_damper_has_the_structure_s_mode_and_free_particles():
    for particles in (1, 2, 3, 4):
        system = models.impact_damper(particles=particles, natural_frequency=25.0, particle_mass=0.6, clearance=6e-3)
        assert system.natural_frequencies / HERTZ == pytest.approx([0.0] * particles + [25.0], rel=1e-14)
        assert np.trace(system.mass) == pytest.approx(10.6, rel=1e-15)
        assert len(system.stops) == particles + 1
        # Wherever the particles are, the gaps between them add up to the free travel.
        q = 1e-4 * np.arange(particles + 1.0) ** 2
        assert system.clearances(q).sum() == pytest.approx(6e-3, rel=1e-14)
        # Nothing changes where all move together.
        assert system.clearances(q + 0.7) == pytest.approx(system.clearances(q), abs=1e-15)


def test_particles_are_in_order_from_left_to_right():
    system = models.impact_damper(particles=2, clearance=6e-3)
    left, between, right = system.clearances([0.0, -1e-3, 0.5e-3])
    assert [left, between, right] == pytest.approx([1e-3, 3.5e-3, 1.5e-3], rel=1e-14)


def test_two_units_are_two_dampers_of_one_structure():
    system = models.two_unit_impact_damper(clearance=4e-3, second_clearance=2e-3)
    one = models.impact_damper(particle_mass=0.25, clearance=4e-3)
    assert system.clearances([1e-3, 0.5e-3, 0.2e-3])[:2] == pytest.approx(one.clearances([1e-3, 0.5e-3]), rel=1e-14)
    assert system.clearances([0.0, 0.0, 1e-3]).tolist() == pytest.approx([2e-3, 2e-3, 2e-3, 0.0], abs=1e-18)
    struck = 1.0 / np.diag(system.modal().mobility)
    assert struck == pytest.approx([2.5 / 10.25] * 4, rel=1e-14)  # the reduced mass


def test_a_tuned_mass_damper_has_the_two_frequencies_of_its_quadratic():
    ratio, tuning = 0.05, 0.93
    system = models.tuned_mass_damper(mass_ratio=ratio, tuning=tuning, natural_frequency=3.0)
    middle, product = 0.5 * (1.0 + (1.0 + ratio) * tuning**2), tuning**2
    root = math.sqrt(middle**2 - product)
    squares = np.array([product / (middle + root), middle + root])
    assert system.natural_frequencies / (HERTZ * 3.0) == pytest.approx(np.sqrt(squares), rel=1e-14)


def test_den_hartog_s_absorber_has_two_equal_peaks():
    ratio = 0.02
    system = models.tuned_mass_damper(
        mass_ratio=ratio, tuning=1.0 / (1.0 + ratio), damping_ratio=0.0, force=1.0,
        absorber_damping_ratio=math.sqrt(3.0 * ratio / (8.0 * (1.0 + ratio) ** 3)),
    )  # fmt: skip
    static = 1.0 / (HERTZ * 2.0) ** 2 / 4e4
    fixed = [math.sqrt((1.0 + sign * math.sqrt(ratio / (2.0 + ratio))) / (1.0 + ratio)) for sign in (-1, 1)]
    peaks = [abs(receptance(system, HERTZ * 2.0 * at)[0]) / static for at in fixed]
    assert peaks == pytest.approx([math.sqrt(1.0 + 2.0 / ratio)] * 2, rel=1e-12)  # at both fixed points


# Beams


@pytest.mark.parametrize(("ends", "first"), [
    ("clamped-free", [1.875104068711961, 4.694091132974175, 7.854757438237613, 10.995540734875467]),
    ("clamped-clamped", [4.730040744862704, 7.853204624095838, 10.995607838001671]),
    ("clamped-pinned", [3.926602312047919, 7.068582745628732, 10.210176122813031]),
    ("pinned-pinned", [math.pi * n for n in range(1, 13)]),
    ("pinned-free", [0.0, 3.926602312047919, 7.068582745628732, 10.210176122813031]),
])  # fmt: skip
def test_wave_numbers_are_those_of_the_tables(ends, first):
    assert beam_modes(ends, 12).wave_numbers[: len(first)] == pytest.approx(first, rel=1e-15)


@pytest.mark.parametrize("ends", [*BEAMS, "pinned-free"])
def test_twelve_modes_are_orthonormal_by_quadrature(ends):
    shapes = beam_modes(ends, 12)
    nodes, weights = np.polynomial.legendre.leggauss(64)
    values = np.array([shapes.at(at) for at in 0.5 * (nodes + 1.0)])
    assert np.abs(values.T @ (0.5 * weights[:, None] * values) - np.eye(12)).max() < 4e-15
    assert np.abs(0.5 * weights @ values - shapes.means).max() < 2e-15


def test_a_pinned_free_beam_turns_rigidly_and_bends():
    shapes = beam_modes("pinned-free", 12)
    assert shapes.at(0.3)[0] == pytest.approx(0.3 * math.sqrt(3.0), rel=1e-15)
    assert not shapes.at(0.0).any()
    assert shapes.at(1.0)[1:] == pytest.approx(2.0 * (-1.0) ** np.arange(1, 12), rel=1e-14)
    assert beam_modes("pinned-free", 1).wave_numbers.tolist() == [0.0]


@pytest.mark.parametrize("ends", ["clamped-free", "clamped-clamped", "clamped-pinned", "pinned-free"])
def test_shapes_of_high_modes_lose_no_digits(ends):
    import mpmath

    shapes = beam_modes(ends, 12)
    with mpmath.workdps(50):
        cosh, sinh, cos, sin = mpmath.cosh, mpmath.sinh, mpmath.cos, mpmath.sin
        equation = {
            "clamped-free": lambda b: cos(b) * cosh(b) + 1,
            "clamped-clamped": lambda b: cos(b) * cosh(b) - 1,
            "clamped-pinned": lambda b: sin(b) * cosh(b) - sinh(b) * cos(b),
            "pinned-free": lambda b: mpmath.tan(b) - mpmath.tanh(b),
        }[ends]
        ratio = {
            "clamped-free": lambda b: (sinh(b) - sin(b)) / (cosh(b) + cos(b)),
            "clamped-clamped": lambda b: (cosh(b) - cos(b)) / (sinh(b) - sin(b)),
            "clamped-pinned": lambda b: cosh(b) / sinh(b),
        }.get(ends)
        rigid = ends == "pinned-free"  # its first mode, of no frequency
        for n, found in list(enumerate(shapes.wave_numbers))[rigid:]:
            b = mpmath.findroot(equation, mpmath.mpf(float(found)))
            assert abs(found - b) < 4e-16 * b
            for place in (0.1, 0.45, 0.83, 1.0):
                z = b * mpmath.mpf(place)
                if rigid:
                    exact = mpmath.sign(sin(b)) * (sin(z) / sin(b) + sinh(z) / sinh(b))
                else:
                    exact = cosh(z) - cos(z) - ratio(b) * (sinh(z) - sin(z))
                assert abs(shapes.at(place)[n] - exact) < 1e-14


def test_ends_that_are_held_do_not_move_and_nodes_are_nodes():
    for ends in BEAMS:
        assert not beam_modes(ends, 12).at(0.0).any()
    for ends in ("clamped-clamped", "clamped-pinned", "pinned-pinned"):
        assert not beam_modes(ends, 12).at(1.0).any()
    for ends in ("clamped-clamped", "pinned-pinned"):
        middle = beam_modes(ends, 12).at(0.5)
        assert not middle[1::2].any()
        assert (np.abs(middle[::2]) > 1.0).all()
        assert not beam_modes(ends, 12).means[1::2].any()
    assert np.abs(beam_modes("clamped-free", 12).at(1.0)) == pytest.approx([2.0] * 12, rel=1e-14)


def test_modes_of_symmetric_ends_are_even_or_odd():
    for ends in ("clamped-clamped", "pinned-pinned"):
        shapes, signs = beam_modes(ends, 12), (-1.0) ** np.arange(12)
        for place in (0.07, 0.31):
            assert shapes.at(1.0 - place) == pytest.approx(signs * shapes.at(place), abs=3e-14)


def test_unknown_ends_are_refused():
    with pytest.raises(ValueError, match="unknown `ends` 'free-free'; choose from clamped-free"):
        beam_modes("free-free", 3)


@pytest.mark.parametrize("ends", BEAMS)
def test_a_beam_has_the_frequencies_of_its_wave_numbers(ends):
    beam = BEAMS[ends](length=0.4, thickness=2e-3, youngs_modulus=7e10, density=2700.0, modes=12)
    bending = math.sqrt(7e10 * 2e-3**2 / (12.0 * 2700.0)) / 0.4**2  # sqrt(E I/(m' L^4)): the width drops out
    expected = beam_modes(ends, 12).wave_numbers ** 2 * bending
    assert beam.natural_frequencies == pytest.approx(expected, rel=1e-13)
    assert np.diag(beam.damping) == pytest.approx(2.0 * 0.01 * expected, rel=1e-13)


# Deflection of a unit force where it acts, times E I/L^3, and that under a unit load per length, times E I/L^4.
POINT = {
    "clamped-free": lambda x: x**3 / 3.0,
    "clamped-clamped": lambda x: x**3 * (1.0 - x) ** 3 / 3.0,
    "clamped-pinned": lambda x: x**3 * (1.0 - x) ** 2 * (4.0 - x) / 12.0,
    "pinned-pinned": lambda x: x**2 * (1.0 - x) ** 2 / 3.0,
}
UNIFORM = {
    "clamped-free": lambda x: x**2 * (x**2 - 4.0 * x + 6.0) / 24.0,
    "clamped-clamped": lambda x: x**2 * (1.0 - x) ** 2 / 24.0,
    "clamped-pinned": lambda x: x**2 * (1.0 - x) * (3.0 - 2.0 * x) / 48.0,
    "pinned-pinned": lambda x: x * (x**3 - 2.0 * x**2 + 1.0) / 24.0,
}


@pytest.mark.parametrize("ends", BEAMS)
@pytest.mark.parametrize("place", [0.3, 0.62])
def test_static_deflections_tend_to_those_of_beam_theory_as_modes_are_added(ends, place):
    size = {"length": 0.5, "width": 0.02, "thickness": 2e-3, "youngs_modulus": 2e11}
    rigidity = 2e11 * 0.02 * 2e-3**3 / 12.0
    for drive, exact in {
        "force": POINT[ends](place) * 0.5**3 / rigidity,
        "base_acceleration": UNIFORM[ends](place) * 0.5**4 / rigidity * 7800.0 * 0.02 * 2e-3,
    }.items():
        misses = []
        for modes in (1, 3, 12):
            drives = {"force": 0.0, "base_acceleration": 0.0, drive: 1.0}
            beam = BEAMS[ends](**size, **drives, force_at=place, stop_at=place, modes=modes)
            static = beam.stops[0].direction @ np.linalg.solve(beam.stiffness, beam.force.harmonics[1].real)
            misses.append(abs(static / exact - 1.0))
        assert misses[0] > misses[1] > misses[2]
        assert misses[2] < (5e-4 if drive == "force" else 1e-5)


def test_the_tip_of_a_cantilever_gives_way_as_three_e_i_over_l_cubed():
    for modes in range(4, 13):
        beam = models.cantilever_with_stop(force=1.0, base_acceleration=0.0, modes=modes)
        tip = beam.stops[0].direction @ np.linalg.solve(beam.stiffness, beam.force.harmonics[1].real)
        stiffness = 3.0 * 2.1e11 * (0.02 * 1e-3**3 / 12.0) / 0.3**3
        left_out = 12.0 * zeta(4, modes + 0.5) / math.pi**4  # 12/b^4 each, with b = (n - 1/2) pi in high modes
        assert 1.0 - tip * stiffness == pytest.approx(left_out, rel=1e-5)


def test_the_struck_mass_of_a_tip_is_the_beam_s_over_four_times_the_modes():
    mass = 7800.0 * 0.3 * 0.02 * 1e-3
    for modes in range(1, 13):
        struck = 1.0 / models.cantilever_with_stop(modes=modes).modal().mobility[0, 0]
        assert struck == pytest.approx(mass / (4.0 * modes), rel=1e-13)


def test_a_stop_may_stand_anywhere_along_the_beam():
    beam = models.cantilever_with_stop(stop_at=0.4, modes=5)
    shapes = beam_modes("clamped-free", 5).at(0.4) / math.sqrt(7800.0 * 0.3 * 0.02 * 1e-3)
    assert beam.stops[0].direction == pytest.approx(shapes, rel=1e-14)


# Tubes


def tube_numbers(system, size):
    """Return flexural rigidity and mass per length, written out with diameters."""
    outer, inner = size["outer_diameter"], size["outer_diameter"] - 2.0 * size["wall_thickness"]
    rigidity = 2e11 * math.pi * (outer**4 - inner**4) / 64.0
    per_length = math.pi / 4.0 * (7900.0 * (outer**2 - inner**2) + 1000.0 * inner**2 + 1.5 * 1000.0 * outer**2)
    return rigidity, per_length


@pytest.mark.parametrize("ends", TUBES)
def test_a_tube_in_water_has_the_frequencies_of_its_mass_with_the_fluid(ends):
    size = {"outer_diameter": 0.02, "wall_thickness": 2e-3, "length": 2.0}
    tube = TUBES[ends](**size, modes=6)
    rigidity, per_length = tube_numbers(tube, size)
    expected = beam_modes(ends, 6).wave_numbers ** 2 * math.sqrt(rigidity / per_length) / 4.0
    assert tube.natural_frequencies == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("ends", TUBES)
def test_a_steady_load_bends_a_tube_as_beam_theory_says(ends):
    size = {"outer_diameter": 0.02, "wall_thickness": 2e-3, "length": 2.0}
    tube = TUBES[ends](
        **size, steady_force_per_length=5.0, first_support_at=0.3, second_support_at=0.5, modes=12,
        diametral_clearance=1.0,
    )  # fmt: skip
    rigidity, _ = tube_numbers(tube, size)
    expected = [UNIFORM[ends](place) * 5.0 * 2.0**4 / rigidity for place in (0.3, 0.5)]
    clearance = tube.clearances(rest(tube))
    assert 0.5 - clearance[[0, 2]] == pytest.approx(expected, rel=2e-5)
    assert clearance[[1, 3]] - 0.5 == pytest.approx(expected, rel=2e-5)


def test_a_support_leaves_half_of_its_clearance_above_and_below():
    tube = models.tube_in_supports(diametral_clearance=1e-3, modes=12)
    assert tube.clearances(np.zeros(12)).tolist() == [0.5e-3] * 4
    upper, lower, second_upper, second_lower = tube.stops
    assert opposite(upper, lower)
    assert opposite(second_upper, second_lower)
    assert not opposite(upper, second_lower)


def test_a_tube_in_two_even_supports_is_one_in_many_supports_and_groups_them_by_support():
    two = models.clamped_tube_in_supports(first_support_at=1.0 / 3.0, second_support_at=2.0 / 3.0, length=2.0)
    many = models.tube_in_many_supports(supports=2, length=2.0, modes=3, frequency=38.0)
    assert [(stop.gap, stop.direction.tolist()) for stop in two.stops] == [
        (stop.gap, pytest.approx(stop.direction.tolist(), rel=1e-12)) for stop in many.stops
    ]
    assert np.array_equal(two.stiffness, many.stiffness)
    assert two.groups == ("first", "first", "second", "second")
    assert many.groups == ("support_1", "support_1", "support_2", "support_2")
    assert len(models.tube_in_many_supports(supports=32, modes=12).stops) == 64


def test_supports_in_mirrored_places_make_a_mirrored_tube():
    there = models.tube_in_supports(first_support_at=0.3, second_support_at=0.7, modes=4)
    signs = np.array([1.0, -1.0, 1.0, -1.0])
    assert there.stops[2].direction == pytest.approx(signs * there.stops[0].direction, rel=1e-13)


# What is refused


@pytest.mark.parametrize(("model", "number", "message"), [
    ("bouncing_ball", {"amplitud": 1.0}, "unknown parameter 'amplitud'; .*did you mean 'amplitude'"),
    ("bouncing_ball", {"mass": 0.0}, "`mass` must be a finite number > 0, got 0.0; give the moving mass in kg"),
    ("bouncing_ball", {"amplitude": "1"}, "`amplitude` must be .*, got '1'; write numbers without quotes"),
    ("bouncing_ball", {"gravity": math.nan}, "`gravity` must be a finite number > 0, got nan"),
    ("two_sided_oscillator", {"stiffness": -1.0}, "`stiffness` must be a finite number > 0, got -1.0"),
    ("two_sided_oscillator", {"force": -1.0}, "`force` must be a finite number >= 0, got -1.0; for the opposite sign"),
    ("impact_pair", {"inclination": 91.0}, "`inclination` must be between -90 and 90, got 91.0"),
    ("impact_pair", {"clearance": 0.0}, "`clearance` must be a finite number > 0, got 0.0"),
    ("idle_gear", {"rpm": 0.0}, "`rpm` must be a finite number > 0, got 0.0"),
    ("impact_damper", {"particles": 5}, "`particles` must be a whole number between 1 and 4, got 5"),
    ("impact_damper", {"particles": 1.5}, "`particles` must be a whole number between 1 and 4, got 1.5"),
    ("tuned_mass_damper", {"stroke": -0.1}, "`stroke` must be a finite number > 0, got -0.1"),
    ("cantilever_with_stop", {"modes": 13}, "`modes` must be a whole number between 1 and 12, got 13"),
    ("cantilever_with_stop", {"modes": 2.5}, "`modes` must be a whole number between 1 and 12, got 2.5"),
    ("cantilever_with_stop", {"stop_at": 1.1}, "`stop_at` must be between 0 and 1, got 1.1; give the distance"),
    ("cantilever_with_stop", {"stop_at": 0.0}, "`stop_at` must be a place that moves, got 0.0; keep stops away"),
    ("clamped_beam_with_stop", {"stop_at": 1.0}, "`stop_at` must be a place that moves, got 1.0; keep stops away"),
    ("pinned_beam_with_stop", {"stop_at": 1.0}, "`stop_at` must be a place that moves, got 1.0; keep stops away"),
    ("tube_in_supports", {"wall_thickness": 0.01}, "`wall_thickness` must be less than half of `outer_diameter`"),
    ("tube_in_supports", {"second_support_at": 1.0}, "`second_support_at` must be a place that moves, got 1.0"),
    ("unbalanced_machine", {"gap": math.inf}, "`gap` must be a finite number, got inf"),
])  # fmt: skip
def test_a_number_that_makes_no_machine_is_refused_by_its_name(model, number, message):
    with pytest.raises(ValueError, match=message) as error:
        MODELS[model](**number)
    assert "\n" not in str(error.value)


def test_numbers_are_given_by_name():
    with pytest.raises(TypeError, match="positional"):
        models.bouncing_ball(0.1)


@pytest.mark.parametrize("model", ["impact_damper", "tube_in_supports"])
def test_a_verdict_varies_what_can_vary_continuously(model):
    machine = vi.family(MODELS[model])
    counts = {name for name, parameter in machine.parameters.items() if parameter.whole}
    assert counts
    assert not counts & set(check_parameters(machine, None))
    with pytest.raises(ValueError, match="`parameters` must be names of numbers that vary continuously"):
        check_parameters(machine, counts)


def test_an_argument_that_counts_takes_whole_numbers():
    @vi.family
    def pair(omega=2.0, stops: int = 2):
        return two_sided(omega, gap=0.5 * stops)

    assert pair.at(stops=4.0).stops[0].gap == 2.0
    with pytest.raises(ValueError, match="`stops` must be a whole number"):
        pair.replace(stops=1.5)
