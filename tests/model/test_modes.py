"""The modes of a system and tables of them, the scale of its velocities, and centres that no stop feels."""

import itertools
import math

import numpy as np
import pytest

import vibroimpact as vi
from systems import C, K, M, a_random_system, changed, one_mass, two_masses

# The modal form


def test_one_mass_has_the_numbers_of_plain_division():
    form = vi.ImpactSystem(
        mass=3.0,
        damping=0.7,
        stiffness=5.0,
        force=vi.Force(omega=2.0, harmonics={1: 1.1, 2: 0.3j}, constant=-9.81),
        stops=[vi.Stop(direction=0.9, gap=0.1, motion={3: 0.2})],
    ).modal()
    assert form.squares.tolist() == [5.0 / 3.0]
    assert form.damping.tolist() == [[0.7 / 3.0]]
    assert form.constant.tolist() == [-9.81 / 3.0]
    assert form.orders.tolist() == [1, 2, 3]
    assert form.forces.tolist() == [[1.1 / 3.0], [0.3j / 3.0], [0.0]]
    assert (form.directions.tolist(), form.jumps.tolist()) == ([[0.9]], [[0.9 / 3.0]])
    assert form.motions.tolist() == [[0.0, 0.0, 0.2]]
    assert form.decoupled


def test_modes_satisfy_the_equations_of_motion():
    rng = np.random.default_rng(4)
    for n in range(1, 13):
        system = a_random_system(rng, n)
        form, stiff = system.modal(), np.abs(system.stiffness).max()
        np.testing.assert_allclose(form.shapes @ form.inverse, np.eye(n), atol=1e-12)
        modal = form.shapes @ np.diag(form.squares) @ form.inverse
        np.testing.assert_allclose(system.mass @ modal, system.stiffness, atol=1e-13 * n * stiff)
        damping = form.shapes @ form.damping @ form.inverse
        np.testing.assert_allclose(system.mass @ damping, system.damping, atol=1e-11)
        np.testing.assert_allclose(system.mass @ form.shapes @ form.constant, system.force.constant, atol=1e-12)
        for at, order in enumerate(form.orders):
            p = system.force.harmonics.get(order, np.zeros(n))
            np.testing.assert_allclose(system.mass @ form.shapes @ form.forces[at], p, atol=1e-12)
        a = np.array([stop.direction for stop in system.stops])
        np.testing.assert_allclose(form.directions @ form.inverse, a, atol=1e-12)
        np.testing.assert_allclose(form.mobility, a @ np.linalg.solve(system.mass, a.T), rtol=1e-11, atol=1e-12)
        assert (np.diff(form.squares) >= 0.0).all()
        assert np.abs(form.shapes).max(axis=0).tolist() == [1.0] * n or n > 1


@pytest.mark.parametrize("n", [2, 3, 5, 8, 12])
def test_rigid_body_modes_have_exactly_no_stiffness(n):
    rng = np.random.default_rng(n)
    springs = np.diff(np.eye(n), axis=0) * rng.uniform(0.1, 100.0, (n - 1, 1))
    mass = np.diag(rng.uniform(0.01, 10.0, n))
    free = {"mass": mass, "damping": 0.01 * springs.T @ springs, "stiffness": springs.T @ springs}
    system = two_masses(**free, force=vi.Force(omega=1.0), stops=[])
    squares = system.modal().squares
    assert squares[0] == 0.0 < squares[1]
    np.testing.assert_allclose(system.modal().shapes[:, 0], 1.0, rtol=1e-9)  # all masses together
    assert system.modal().decoupled


def test_matrices_assembled_with_rounding_are_no_negative_springs():
    rng = np.random.default_rng(5)
    for n in (2, 4, 7, 12):
        for _ in range(50):
            half = rng.standard_normal((n - 1, n)) * 10.0 ** rng.uniform(-3, 3, (n - 1, 1))
            system = two_masses(
                mass=np.eye(n), stiffness=half.T @ half, damping=half.T @ half, force=vi.Force(omega=1.0), stops=[]
            )
            assert system.modal().squares[0] == 0.0


def test_coordinates_that_nothing_couples_do_not_round_each_other():
    system = two_masses(stiffness=[[1e30, 0.0], [0.0, 1e-3]], mass=[[2.0, 0.0], [0.0, 3.0]])
    assert system.modal().squares.tolist() == [1e-3 / 3.0, 5e29]
    alone = two_masses()
    joined = vi.ImpactSystem(
        mass=np.pad(M, (0, 1)) + np.diag([0, 0, 7.0]),
        damping=np.pad(C, (0, 1)),
        stiffness=np.pad(K, (0, 1)) + np.diag([0, 0, 1e22]),
        force=vi.Force(omega=8.0),
        stops=[],
    )
    np.testing.assert_array_equal(joined.modal().squares[:2], alone.modal().squares)
    np.testing.assert_array_equal(joined.modal().damping[:2, :2], alone.modal().damping)


def test_proportional_damping_decouples_and_no_other_does():
    rng = np.random.default_rng(6)
    for n in (2, 3, 6, 12):
        for _ in range(20):
            half, other = rng.standard_normal((2, n, n))
            mass, stiffness = half @ half.T + np.eye(n), other @ other.T
            for share in (0.01 * stiffness, 0.1 * mass, 0.02 * mass + 0.003 * stiffness):
                system = a_random_system(rng, n, damping=0.0)
                system = vi.ImpactSystem(mass=mass, stiffness=stiffness, damping=share, force=system.force)
                form = system.modal()
                assert form.decoupled
                assert not (form.damping - np.diag(np.diag(form.damping))).any()
            assert not a_random_system(rng, n).modal().decoupled
    gyroscopic = two_masses(mass=np.eye(2), stiffness=np.diag([1.0, 2.0]), damping=[[0.0, -3.0], [3.0, 0.0]])
    assert gyroscopic.modal().damping.tolist() == [[0.0, -3.0], [3.0, 0.0]]
    assert not gyroscopic.modal().decoupled


def test_modes_of_one_frequency_are_those_that_damping_parts():
    springs = np.array([[2.0, -1.0, -1.0], [-1.0, 2.0, -1.0], [-1.0, -1.0, 2.0]])  # a ring: two modes of one frequency
    damping = np.outer([1.0, -2.0, 1.0], [1.0, -2.0, 1.0])
    ring = two_masses(mass=np.eye(3), stiffness=springs, damping=damping, force=vi.Force(omega=1.0), stops=[])
    form = ring.modal()
    assert form.decoupled
    np.testing.assert_allclose(form.squares, [0.0, 3.0, 3.0], rtol=1e-14)
    np.testing.assert_allclose(np.diag(form.damping), [0.0, 0.0, 6.0], atol=1e-14)
    drag = [[1.0, -1.0], [-1.0, 1.0]]  # two free masses with a damper between them
    pair = two_masses(mass=np.diag([1.0, 3.0]), stiffness=0.0, damping=drag, force=vi.Force(omega=1.0), stops=[])
    form = pair.modal()
    assert form.decoupled
    np.testing.assert_allclose(np.diag(form.damping), [0.0, 4.0 / 3.0], atol=1e-15)
    np.testing.assert_allclose(form.shapes.T @ pair.mass @ form.shapes, np.diag(form.masses), atol=1e-15)
    np.testing.assert_allclose(form.shapes @ form.inverse, np.eye(2), atol=1e-15)


def test_small_couplings_of_damping_are_kept():
    for small in (1e-3, 1e-9, 1e-12):
        damping = [[1.0, small], [small, 2.0]]
        for stiffness in (np.diag([1.0, 2.0]), [[1.0, 0.5], [0.5, 3.0]]):
            arguments = {"mass": np.eye(2), "stiffness": stiffness, "damping": damping}
            form = two_masses(**arguments).modal()
            assert not form.decoupled
            np.testing.assert_allclose(form.shapes @ form.damping @ form.inverse, damping, atol=1e-15)


def test_a_chain_of_stiff_and_soft_springs_with_proportional_damping_decouples():
    rng = np.random.default_rng(13)
    for n in (2, 5, 12):
        for _ in range(20):
            springs = np.diff(np.eye(n), axis=0) * 10.0 ** rng.uniform(-1, 2, (n - 1, 1))
            stiffness = springs.T @ springs
            mass = np.diag(10.0 ** rng.uniform(-2, 1, n))
            force = vi.Force(omega=1.0)
            assert two_masses(
                mass=mass, stiffness=stiffness, damping=0.01 * stiffness, force=force, stops=[]
            ).modal().decoupled  # fmt: skip


# A table of modes


def test_a_system_of_modes_is_that_of_its_matrices():
    rng = np.random.default_rng(11)
    n = 4
    half, other = rng.standard_normal((2, n, n))
    mass, stiffness = half @ half.T + np.eye(n), other @ other.T
    force = vi.Force(frequency=0.3, harmonics={1: [0.0, 2.0, 0.0, 0.0]}, constant=[0.0, 0.0, 0.0, -1.0])
    stops = [vi.Stop(direction=[1.0, 0.0, -1.0, 0.0], gap=0.1), vi.Stop(direction=[0, 0, 0, 2.0], gap=0.2)]
    damping = 0.05 * mass + 0.01 * stiffness
    physical = vi.ImpactSystem(mass=mass, damping=damping, stiffness=stiffness, force=force, stops=stops)
    form = physical.modal()
    rates = np.sqrt(form.squares)
    table = {
        "frequencies": rates / (2.0 * math.pi),
        "damping_ratios": np.diag(form.damping) / (2.0 * rates),
        "shapes": form.shapes / np.sqrt(form.masses),
    }
    by_rows = vi.ImpactSystem.from_modes(**table, force=force, stops=stops)
    by_name = vi.ImpactSystem.from_modes(
        **table,
        points=["foot", "knee", "hip", "tip"],
        force=vi.Force(frequency=0.3, harmonics={1: {"knee": 2.0}}, constant={"tip": -1.0}),
        stops=[vi.Stop(direction={"hip": -1.0, "foot": 1.0}, gap=0.1), vi.Stop(direction={"tip": 2.0}, gap=0.2)],
    )
    assert by_rows == by_name
    modal = by_rows.modal()
    assert modal.decoupled
    np.testing.assert_allclose(modal.squares, form.squares, rtol=1e-14)
    np.testing.assert_allclose(modal.damping, form.damping, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(modal.mobility, form.mobility, rtol=1e-11)
    np.testing.assert_allclose(modal.directions @ modal.constant, form.directions @ form.constant, rtol=1e-11)
    np.testing.assert_allclose(modal.directions @ modal.forces[0], form.directions @ form.forces[0], rtol=1e-11)
    assert by_rows.velocity_scale == pytest.approx(physical.velocity_scale, rel=1e-10)


def test_a_mode_at_0_hz_is_a_free_mass():
    system = vi.ImpactSystem.from_modes(
        [0.0, 10.0], 0.01, [[1.0, 1.0]], force=vi.Force(omega=1.0), stops=[vi.Stop(direction=1, gap=0.1)]
    )
    assert system.modal().squares.tolist() == [0.0, (20.0 * math.pi) ** 2]
    assert system.stops[0].direction.tolist() == [1.0, 1.0]


# The scale of velocities


def test_one_mass_has_the_scale_of_its_oscillator():
    rng = np.random.default_rng(7)
    for _ in range(100):
        m, k, f, w = 10.0 ** rng.uniform(-1, 1, 4)
        osc = vi.ImpactOscillator(mass=m, stiffness=k, amplitude=f, omega=w, gap=rng.normal())
        assert one_mass(osc).velocity_scale == pytest.approx(osc.velocity_scale, rel=1e-14)


def test_the_scale_is_a_speed_and_does_not_change_with_coordinates():
    rng = np.random.default_rng(8)
    for n, s in itertools.product((1, 2, 4, 8), (1, 2, 3)):
        system = a_random_system(rng, n, s)
        scale = system.velocity_scale
        assert changed(system, length=3.0).velocity_scale == pytest.approx(3.0 * scale, rel=1e-12)
        assert changed(system, time=3.0).velocity_scale == pytest.approx(scale / 3.0, rel=1e-12)
        assert changed(system, mass=3.0).velocity_scale == pytest.approx(scale, rel=1e-12)
        basis = rng.standard_normal((n, n)) + 2.0 * np.eye(n)
        assert changed(system, basis=basis).velocity_scale == pytest.approx(scale, rel=1e-9)
        turned = vi.ImpactSystem(**{**system.arguments(), "stops": system.stops[::-1]})
        assert turned.velocity_scale == pytest.approx(scale, rel=1e-13)


def test_a_mode_that_no_stop_sees_leaves_the_scale_alone():
    rng = np.random.default_rng(9)
    for n in (1, 2, 4):
        system = a_random_system(rng, n, 2)
        joined = vi.ImpactSystem(
            mass=np.pad(system.mass, (0, 1)) + np.diag([0.0] * n + [2.0]),
            damping=np.pad(system.damping, (0, 1)),
            stiffness=np.pad(system.stiffness, (0, 1)) + np.diag([0.0] * n + [0.3]),
            force=vi.Force(
                omega=system.omega,
                harmonics={h: np.append(p, 1e6) for h, p in system.force.harmonics.items()},
                constant=np.append(system.force.constant, 1e6),
            ),
            stops=[stop.replace(direction=np.append(stop.direction, 0.0)) for stop in system.stops],
        )
        assert joined.velocity_scale == pytest.approx(system.velocity_scale, rel=1e-10)
        turned = changed(joined, basis=np.linalg.qr(rng.standard_normal((n + 1, n + 1)))[0])
        assert turned.velocity_scale == pytest.approx(system.velocity_scale, rel=1e-6)


def free_mass(stops, constant=None, harmonics=None, omega=3.0):
    force = vi.Force(omega=omega, constant=constant, harmonics=harmonics)
    return vi.ImpactSystem(mass=2.0, stiffness=0.0, force=force, stops=stops)


def test_free_and_unforced_masses_have_a_scale():
    floor = vi.Stop(direction=-1, gap=0.0)
    assert free_mass([floor], constant=-2.0 * 9.81).velocity_scale == pytest.approx(9.81 / 3.0)  # falls for 1/w
    assert free_mass([floor], harmonics={2: 1.0}).velocity_scale == pytest.approx(0.5 / 6.0)
    assert free_mass([floor.replace(motion={1: 0.1j, 2: 0.05})]).velocity_scale == pytest.approx(0.3 + 0.3)
    assert free_mass([floor.replace(gap=0.2)]).velocity_scale == pytest.approx(0.6)  # unforced, in a slot
    assert free_mass([floor]).velocity_scale == 1.0  # alike at every speed
    assert free_mass([]).velocity_scale == 1.0
    hung = vi.ImpactSystem(
        mass=2.0, stiffness=8.0, force=vi.Force(omega=3.0, constant=-4.0), stops=[vi.Stop(direction=-1, gap=0.7)]
    )
    assert hung.velocity_scale == pytest.approx(2.0 * 0.2)  # it rests at -0.5: 0.2 are left, at 2 rad/s


def test_a_load_that_springs_carry_only_shifts_the_rest_position():
    rng = np.random.default_rng(10)
    system = a_random_system(rng, 3, 2)
    shift = rng.standard_normal(3)
    load = system.force.constant + system.stiffness @ shift
    force = vi.Force(**{**system.force.arguments(), "constant": load})
    stops = [stop.replace(gap=stop.gap + stop.direction @ shift) for stop in system.stops]
    there = vi.ImpactSystem(**{**system.arguments(), "force": force, "stops": stops})
    assert there.velocity_scale == pytest.approx(system.velocity_scale, rel=1e-10)


# A free centre


def on_one_another(mass, damping=0.0, stiffness=0.0, stops=((1, -1),)):
    made = [vi.Stop(direction=direction, gap=0.5) for direction in stops]
    return vi.ImpactSystem(mass=mass, damping=damping, stiffness=stiffness, force=vi.Force(omega=1.0), stops=made)


def test_the_centre_of_free_masses_is_a_mode_that_no_stop_feels():
    form = on_one_another(np.diag([0.3, 1.1])).modal()
    assert form.neutral.tolist() == [[True, False]] * 2
    assert form.directions[:, 0] == 0.0
    assert form.shapes[:, 0] == pytest.approx(1.0, rel=1e-15)
    assert form.shapes[:, 1] / form.shapes[0, 1] == pytest.approx([1.0, -0.3 / 1.1])
    assert not on_one_another(np.eye(2), stops=((1, -1), (1, 0))).modal().neutral.any()
    assert not on_one_another(np.eye(2), stiffness=np.diag([1.0, 0.0])).modal().neutral.any()
    third = on_one_another(np.eye(3), stops=((1, -1, 0),)).modal().neutral
    assert third.sum(axis=1).tolist() == [2, 2]  # of the pair, and the third mass


@pytest.mark.parametrize("soft", [1.0, 1e-3])
def test_rounding_of_a_chain_of_stiff_and_soft_springs_hides_no_free_centre(soft):
    links = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, -1.0]])
    stiffness = links.T @ np.diag([0.1e6, 0.3 * soft]) @ links
    form = on_one_another(np.diag([0.7, 1.3, 0.9]), 0.01 * stiffness, stiffness, ((1, 0, -1),)).modal()
    assert form.neutral.tolist() == [[True, False, False]] * 2
    assert not form.directions[:, 0].any()
    assert not form.damping[0].any()


def test_a_drift_is_felt_where_drag_differs_from_mass_to_mass_and_a_place_never():
    alike, differing = (on_one_another(np.eye(2), np.diag(drag)).modal() for drag in ([0.1, 0.1], [0.1, 0.3]))
    assert alike.neutral.tolist() == [[True, False], [True, False]]
    assert differing.neutral.tolist() == [[True, False], [False, False]]
    assert alike.decoupled
    assert alike.damping == pytest.approx(0.1 * np.eye(2))
