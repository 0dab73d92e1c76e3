"""Systems, forces, stops, states and tables of modes name what they refuse."""

import math
import re
from functools import partial

import numpy as np
import pytest

import vibroimpact as vi
from systems import two_masses

pytestmark = pytest.mark.usefixtures("modal_engine")


OF_MODES = partial(
    vi.ImpactSystem.from_modes,
    frequencies=[1.0, 2.0],
    damping_ratios=[0.1, 0.1],
    shapes=[[1.0, 0.5], [2.0, -1.0]],
    points=["mid", "tip"],
    force=vi.Force(omega=1.0),
)
REFUSED = {  # by what is called: arguments and words
    two_masses: [
        ({"mass": [[1, 2, 3], [4, 5, 6]]}, r"`mass` must be a square array, got one of shape \(2, 3\)"),
        ({"mass": [[1, 0], [0]]}, r"`mass` must be an array of rows of numbers"),
        ({"mass": [[1, "0"], [0, 1]]}, r"`mass` must be an array of rows of numbers"),
        ({"mass": [[1, 1j], [0, 1]]}, r"`mass` must be an array of rows of numbers"),
        ({"mass": np.ones((1, 2, 2))}, r"got an array of shape \(1, 2, 2\)"),
        ({"mass": np.eye(129)}, r"`mass` must be at most 128 x 128, got an array of shape \(129, 129\)"),
        ({"mass": [[1, np.nan], [0, 1]]}, r"`mass\[0, 1\]` must be a finite number of a size up to 1e\+60, got nan"),
        ({"stiffness": [[1e61, 0], [0, 1]]}, r"`stiffness\[0, 0\]` must be a finite number of a size up to 1e\+60"),
        ({"mass": [[2, 1], [0, 1]]}, r"`mass` must be symmetric, but `mass\[0, 1\]` is 1 and `mass\[1, 0\]` is 0"),
        ({"stiffness": [[1, 1], [1.1, 9]]}, r"`stiffness` must be symmetric, but `stiffness\[0, 1\]` is 1 and"),
        ({"mass": [[1, 0], [0, 0]]}, r"`mass` must be positive definite, but `mass\[1, 1\]` is 0"),
        ({"mass": [[1, 0], [0, 1e-61]]}, r"`mass` must be positive definite, but `mass\[1, 1\]` is 1e-61"),
        ({"mass": [[1, 1], [1, 1]]}, r"`mass` must be positive definite, but v . mass v is 0 for v = \(1, -1\)"),
        ({"mass": [[1, 2], [2, 1]]}, r"`mass` must be positive definite, but v . mass v is -2 for v = \(1, -1\)"),
        (
            {"stiffness": [[1, 0], [0, -1e-9]]},
            r"`stiffness` .* positive semidefinite, but `stiffness\[1, 1\]` is -1e-09",
        ),
        ({"mass": np.eye(2), "stiffness": [[1, 2], [2, 1]]}, r"v . stiffness v is -2 for v = \(1, -1\)"),
        ({"damping": [[0, 1], [1, 0]]}, r"symmetric part of `damping` must be positive semidefinite"),
        ({"damping": 0.1}, r"`damping` must be 2 x 2, as `mass` is, got an array of shape \(\)"),
        ({"stiffness": np.eye(3)}, r"`stiffness` must be 2 x 2, as `mass` is, got an array of shape \(3, 3\)"),
        ({"force": vi.Force(omega=1.0, harmonics={2: 1.0})}, r"`harmonics\[2\]` must have 2 numbers, .*, got 1"),
        ({"force": vi.Force(omega=1.0, constant=[1, 2, 3])}, r"`constant` must have 2 numbers, .*, got 3"),
        (
            {"force": vi.Force(omega=1.0, constant={"tip": 1})},
            r"refers to points \(tip\), but the system has none; give it `points`, or 2 numbers, one per coordinate",
        ),
        ({"force": {"omega": 1.0}}, r"`force` must be a Force"),
        ({"stops": vi.Stop(direction=[0, 1], gap=0.1)}, r"`stops` must be a list of Stops"),
        ({"stops": [0.1]}, r"`stops\[0\]` must be a Stop, got 0.1"),
        ({"stops": [vi.Stop(direction=1, gap=0.1)]}, r"`stops\[0\].direction` must have 2 numbers, .*, got 1"),
        (
            {"stops": [vi.Stop(direction=[1, at], gap=1) for at in range(65)]},
            r"`stops` must have at most 64 entries, got 65",
        ),
        (
            {"stops": [vi.Stop(direction=[1, at], gap=1, name="a") for at in (0, 1)]},
            r"'a' is also the name of another stop",
        ),
        ({"stops": [vi.Stop(direction=[1, 0], gap=1, name="omega")]}, r"'omega' is also the name of a parameter"),
        (
            {"stops": [vi.Stop(direction=[1, at], gap=1, name=name) for at, name in enumerate(["a", "a_gap"])]},
            r"`stops\[1\].name` 'a_gap' is also the name of a parameter",
        ),
        (
            {"stops": [vi.Stop(direction=[1, 1], gap=0.1), vi.Stop(direction=[-2, -2], gap=-0.3)]},
            r"`stops` 'stop_1' and 'stop_2' overlap by 0.05 m",
        ),
        (
            {"stops": [vi.Stop(direction=way, gap=-1) for way in ([1, 0], [0, 1], [-1, -1])]},
            r"`stops` stop_1, stop_2, stop_3 overlap: no position is in front of all of them",
        ),
    ],
    vi.Force: [
        ({"harmonics": {1: 1.0}}, r"give either `omega` \(rad/s\) or `frequency` \(Hz\)"),
        ({"omega": 1.0, "frequency": 1.0}, r"give either `omega` \(rad/s\) or `frequency` \(Hz\)"),
        ({"omega": 0.0}, r"`omega` must be a finite number > 0, got 0.0"),
        ({"frequency": -1.0}, r"`frequency` must be a finite number > 0, got -1.0"),
        ({"omega": 1.0, "harmonics": {0: [1.0]}}, r"`harmonics key` must be a whole number >= 1, got 0"),
        ({"omega": 1.0, "harmonics": {1.5: [1.0]}}, r"`harmonics key` must be a whole number >= 1, got 1.5"),
        ({"omega": 1.0, "harmonics": [1.0]}, r"`harmonics` must be a mapping from the order of a harmonic"),
        (
            {"omega": 1.0, "harmonics": {1: [1.0, complex(0, math.inf)]}},
            r"`harmonics\[1\]\[1\]` must be a finite number",
        ),
        ({"omega": 1.0, "constant": [1j]}, r"`constant` must be a list of numbers"),
        (
            {"omega": 1.0, "constant": {}},
            r"`constant` must be a list of numbers, or a mapping from names of points to numbers",
        ),
    ],
    partial(vi.Stop, direction=[0, 1], gap=0.1): [
        ({"direction": [0.0, 0.0]}, r"`direction` must not be zero, got \[0.0, 0.0\]"),
        ({"direction": [0.0, 1e-61], "name": "bar"}, r"`direction` of stop 'bar' must not be zero"),
        ({"direction": {"tip": 0.0}}, r"`direction` must not be zero, got \{'tip': 0.0\}"),
        ({"gap": math.nan}, r"`gap` must be a finite number, got nan"),
        ({"restitution": 1.2}, r"`restitution` must be between 0 and 1, got 1.2"),
        ({"name": "two words"}, r"`name` must be a word of letters, digits and underscores, got 'two words'"),
        ({"name": ""}, r"`name` must be a word"),
        ({"motion": {-1: 1.0}}, r"`motion key` must be a whole number >= 1, got -1"),
        ({"motion": {1: [1.0, 2.0]}}, r"`motion\[1\]` must be a number, got an array of shape \(2,\)"),
    ],
    two_masses().replace: [
        ({"bar": 1.0}, "unknown parameter 'bar'; choose from omega, frequency, bar_gap, .*did you mean 'bar_gap'"),
        ({"mass": 1.0}, "unknown parameter 'mass'"),
        ({"bar_restitution": 2.0}, "`bar_restitution` must be between 0 and 1, got 2.0"),
        ({"omega": None}, "`omega` must be a finite number > 0, got None"),
        ({"omega": 1.0, "frequency": 1.0}, "give either `omega` or `frequency`, not both"),
    ],
    vi.State: [
        ({"displacement": []}, "`displacement` must be a number, or one number per coordinate"),
        ({"displacement": [1.0, "2"]}, r"`displacement\[1\]` must be a finite number, got '2'"),
        ({"displacement": [1.0, math.nan]}, r"`displacement\[1\]` must be a finite number, got nan"),
        ({"displacement": [1.0, 2.0], "velocity": [1.0]}, "the same length, got 2 and 1"),
        ({"displacement": [1.0, 2.0], "velocity": 1.0}, "the same length, got 2 and a single number"),
        ({"displacement": 1.0, "velocity": [1.0]}, "the same length, got a single number and 1"),
    ],
    OF_MODES: [
        ({"frequencies": [1.0]}, r"equal lengths, one per mode, got 1, 2 and 2"),
        ({"damping_ratios": [0.1] * 3}, r"equal lengths, one per mode, got 2, 3 and 2"),
        ({"frequencies": [1.0, -2.0]}, r"`frequencies` must be numbers >= 0, got \[1.0, -2.0\]"),
        ({"damping_ratios": -0.1}, r"`damping_ratios` must be numbers >= 0"),
        ({"points": ["tip"]}, r"`points` must be 2 different names, one per row of `shapes`, got \['tip'\]"),
        ({"points": ["tip", "tip"]}, r"`points` must be 2 different names"),
        ({"shapes": [1.0, 2.0]}, r"`shapes` must be an array of rows of numbers, got an array of shape \(2,\)"),
        ({"force": vi.Force(omega=1.0, constant={"tup": 1.0})}, r"unknown point 'tup'; .*; did you mean 'tip'\?"),
        ({"force": vi.Force(omega=1.0, constant=[1.0])}, r"`constant` must have 2 numbers, one per point, got 1"),
        ({"stops": [vi.Stop(direction={"tap": 1.0}, gap=1.0)]}, r"unknown point 'tap'"),
    ],
}


@pytest.mark.parametrize(
    ("call", "arguments", "words"), [(call, *row) for call, rows in REFUSED.items() for row in rows]
)
def test_what_is_refused_is_named(call, arguments, words):
    with pytest.raises(ValueError, match=words) as error:
        call(**arguments)
    assert "\n" not in str(error.value)


def test_opposite_stops_that_move_together_overlap_where_their_slot_is_negative():
    slot = [vi.Stop(direction=way, gap=-0.1, motion={1: way * 5.0}) for way in (1.0, -1.0)]
    with pytest.raises(ValueError, match="overlap by 0.2 m"):
        vi.ImpactSystem(mass=1.0, stiffness=1.0, force=vi.Force(omega=1.0), stops=slot)


@pytest.mark.parametrize("seed", range(5))
def test_opposite_stops_that_move_must_leave_room_throughout_the_period(seed):
    rng = np.random.default_rng([40, seed])
    ratio = float(rng.uniform(0.5, 2.0))
    one, other = ({h: complex(*rng.normal(size=2)) for h in rng.choice(6, 3, replace=False) + 1} for _ in range(2))
    stops = [vi.Stop(direction=1.0, gap=0.0, motion=one), vi.Stop(direction=-1.0 / ratio, gap=0.0, motion=other)]
    angles = np.linspace(0.0, 2.0 * np.pi, 200_001)
    rooms = stops[0].shift(angles) + ratio * stops[1].shift(angles)
    least, phase = float(rooms.min()), float(angles[rooms.argmin()] / (2.0 * np.pi))

    def between(gap):
        return vi.ImpactSystem(
            mass=1.0, stiffness=1.0, force=vi.Force(omega=1.0), stops=[stops[0].replace(gap=gap), stops[1]]
        )

    between(-least * (1.0 + 1e-6))
    with pytest.raises(ValueError, match="overlap by") as error:
        between(-least * (1.0 - 1e-3))
    overlap, at = (float(text) for text in re.findall(r"overlap by (\S+) m at phase (\S+):", str(error.value))[0])
    assert overlap == pytest.approx(-1e-3 * least, rel=1e-3)
    assert at == pytest.approx(phase, abs=2e-4)


def test_a_slot_without_width_is_room_enough():
    system = two_masses(stops=[vi.Stop(direction=[1, 2], gap=0.3), vi.Stop(direction=[-0.5, -1], gap=-0.15)])
    np.testing.assert_allclose(system.clearances(system.initial()[0]), 0.0, atol=1e-16)


def test_symmetry_is_asked_for_up_to_rounding():
    system = two_masses(mass=[[2.0, 0.1 * 3], [0.3, 1.0]])
    assert system.mass[0, 1] == system.mass[1, 0]


@pytest.mark.parametrize(
    "call",
    [
        lambda osc, several: vi.simulate(osc, periods=1, start=several),
        lambda osc, several: vi.parameter_map(osc, gap=[0.0], start=[several, several]),
        lambda osc, several: vi.attractors(osc, starts=[several]),
        lambda osc, several: vi.find_orbit(osc, near=several),
        lambda osc, several: vi.impact_map(osc) and vi.impact_section(osc, start=several),
    ],
)
def test_one_mass_refuses_a_state_of_several_coordinates(call):
    refusal = r"`(start|starts|near)` must (be .*got State\(displacement=\(0.0, 0.0\)|have 1 coordinate, .*got 2)"
    with pytest.raises(ValueError, match=refusal):
        call(vi.ImpactOscillator(), vi.State([0.0, 0.0]))


def test_a_design_that_is_refused_is_named():
    oscillator = vi.family(vi.models.two_sided_oscillator)
    with pytest.raises(ValueError, match=r"fails at .*left_gap=-1, .*overlap"):
        oscillator.cells({"left_gap": np.array([0.1, -1.0]), "right_gap": np.array([0.1, 0.1])})
