"""Cases of other codes: each number of their page, and each again by a closed form or by DOP853."""

import doctest
import math
import re

import numpy as np
import pytest
from scipy.optimize import brentq

import vibroimpact as vi
from dop853 import Compliant, Rigid, march
from fenced import ROOT, blocks, table
from vibroimpact.models.beam_modes import beam_modes

PAGE = ROOT / "docs" / "about" / "verification.md"
ROWS = re.findall(r"^\| (.+) \| (\S+) \| (\S+) \| (\S+) \| `(.+)` \|$", PAGE.read_text(), re.MULTILINE)


# Closed forms


def sdnd101():
    w = math.sqrt(1.01e6 / 100.0)
    force = 1e6 / w
    return math.pi / w, force, 2.0 * force / w


def sdnd108():
    touch, speed = (-1.0 + math.sqrt(41.0)) / 10.0, math.sqrt(41.0)
    return touch, touch + 2.0 * (math.pi - math.atan(speed)) / 10.0  # d = 0.1 (1 - cos 10 t) + 0.1 v sin 10 t


def sdnd108_height(time):
    """Return the height after the contact, which the mass leaves as fast as it came."""
    flight = time - sdnd108()[1]
    return -2.0 + math.sqrt(41.0) * flight - 5.0 * flight**2


def sdnd122(energy, omits=False):
    k, stop, gap = 10.0, 50.0, 0.01
    center = stop * gap / (k + stop)
    square = 2.0 * energy / (k + stop) - (0.0 if omits else k * stop * gap**2 / (k + stop) ** 2)
    free = (math.pi + 2.0 * math.asin(gap / math.sqrt(2.0 * energy / k))) / math.sqrt(k)
    return 1.0 / (free + 2.0 * math.acos((gap - center) / math.sqrt(square)) / math.sqrt(k + stop))


def vm65():
    w, sag = math.sqrt(1973.92 / 0.5), 386.0 * 0.5 / 1973.92
    touch, speed = math.sqrt(2.0 / 386.0), math.sqrt(2.0 * 386.0)
    return touch, speed, sag + math.hypot(sag, speed / w), touch + (math.pi - math.atan(speed / (w * sag))) / w


def exudyn(soft, pulls=False):
    down, none = np.array([-1.0]), np.zeros((1, 1))
    stop = Compliant(down, 0.0, 2e4) if soft else Compliant(down, 0.0, 2e6, 200.0, pulls=pulls)
    q, v, until = (0.01, -1.0, 0.5) if soft else (0.05, 0.0, 0.25)
    linear = {
        "mass": np.array([[0.25]]),
        "damping": none,
        "stiffness": none,
        "load": lambda t: np.array([-0.25 * 9.81]),
    }
    y, _ = march([stop], [q], [v], until, **linear, step=until / 200.0)
    return 0.05 + y[0]


def cam(rpm):
    """Return the angles in degrees at which the follower leaves and lands, and the speed at which it lands."""
    m, k, preload, e, w = 0.9, 1000.0, 2.5, 0.015, rpm * math.pi / 30.0
    leaves = math.acos(-(k * e + preload) / ((m * w**2 - k) * e))
    own, rest = math.sqrt(k / m), -preload / k
    height, rise = e * (1.0 - math.cos(leaves)) - rest, e * w * math.sin(leaves)

    def gap(angle):
        s = own * (angle - leaves) / w
        return rest + height * math.cos(s) + rise / own * math.sin(s) - e * (1.0 - math.cos(angle))

    lands = brentq(gap, leaves + 0.5, 2.0 * math.pi, xtol=1e-14)
    s = own * (lands - leaves) / w
    falls = e * w * math.sin(lands) + height * own * math.sin(s) - rise * math.cos(s)
    return math.degrees(leaves), math.degrees(lands), falls


def flights(rpm):
    """Return the flights in two turns: the force on the cam, lowest half a turn later, must fall to zero."""
    return 2 * ((rpm * math.pi / 30.0) ** 2 * 0.9 * 0.015 > 2.0 * 1000.0 * 0.015 + 2.5)


# DOP853


def sdnd102(count, instants=()):
    """Return the displacements of the first mass at instants, relative to its base."""
    w, k, ones = 20.0 * math.pi, 98696.0, np.eye(count)
    a, gap, stop = (np.array([1.0]), 5e-4, 5.76e7) if count == 1 else (np.array([1.0, -1.0]), 1e-3, 2.88e7)
    wall = Compliant(a, gap, stop, moves=lambda t: count * math.sin(w * t) / w**2)
    linear = {"mass": 25.0 * ones, "damping": 0.14 * math.sqrt(k * 25.0) * ones, "stiffness": k * ones}
    load = {"load": lambda t: -25.0 * math.sin(w * t) * a, "step": 1e-3}
    _, found = march([wall], np.zeros(count), np.zeros(count), max(instants), **linear, **load, instants=instants)
    return np.array([state[0] for state, _ in found])


def fe_cantilever(names):
    return *names["elements"](10), np.array([0.0] * 18 + [-1.0, 0.0])


def sdnl104(names):
    """Return the displacement at 0.1315 s and the speed at 0.1566 s of the tip."""
    mass, stiffness, down = fe_cantilever(names)
    linear = {"mass": mass, "damping": 0.0 * mass, "stiffness": stiffness, "load": lambda t: 1000.0 * down}
    at = (0.1315, 0.1566)
    _, found = march([Compliant(down, 1e-4, 1e8)], np.zeros(20), np.zeros(20), 0.1566, **linear, step=1e-4, instants=at)
    return found[0][0][18], found[1][0][38]


def newmark(names, step=1e-4):
    """Return the same by Newmark's scheme of average acceleration."""
    mass, stiffness, down = fe_cantilever(names)
    q, v, a = np.zeros(20), np.zeros(20), np.linalg.solve(mass, 1000.0 * down)
    found, closed = [(0.0, 0.0)], False
    for _ in range(1566):
        ahead, speed = q + step * v + step**2 / 4.0 * a, v + step / 2.0 * a
        for _ in range(20):
            k = stiffness + closed * 1e8 * np.outer(down, down)
            load = (1000.0 + closed * 1e8 * 1e-4) * down
            a = np.linalg.solve(mass + step**2 / 4.0 * k, load - k @ ahead)
            q = ahead + step**2 / 4.0 * a
            if closed == (down @ q > 1e-4):
                break
            closed = not closed
        v = speed + step / 2.0 * a
        found.append((q[18], v[18]))
    return found[1315][0], found[1566][1]


def modal(system):
    """Return the numbers of a system of modes, of which the program only made a table."""
    linear = {"mass": system.mass, "damping": system.damping, "stiffness": system.stiffness}
    return linear, [Compliant(stop.direction, stop.gap, stop.stiffness, stop.damping) for stop in system.stops]


def harvester(eta, periods):
    """Return states at whole periods, and the stops with their impacts."""
    mass = np.diag([1.0, eta])
    ends = [Rigid(side * np.array([1.0, -1.0]), 0.175, 0.5, mass) for side in (1.0, -1.0)]
    linear = {"mass": mass, "damping": np.diag([0.2, 0.0]), "stiffness": np.diag([math.pi**2, 0.0])}
    load = lambda t: np.array([math.sin(math.pi * t), -0.12201 * eta])  # noqa: E731
    instants = 2.0 * np.arange(periods + 1)
    _, found = march(ends, np.zeros(2), np.zeros(2), instants[-1], **linear, load=load, step=0.05, instants=instants)
    return np.array([state for state, _ in found]), ends


def settled(eta, periods=150):
    """Return the periods of the cycle, 0 if there is none up to 8, and its impacts per period."""
    states, ends = harvester(eta, periods)
    gaps = [np.abs(states[-1] - states[-1 - n]).max() for n in range(1, 9)]
    cycle = next((n for n, gap in enumerate(gaps, 1) if gap < 1e-6), 0)
    times = np.concatenate([end.times for end in ends])
    return cycle, (times > 2.0 * (periods - 48)).sum() / 48


def harvester_speeds():
    _, ends = harvester(0.5, 60)
    low, high = (end.speeds for end in ends)
    return sorted([*low[-2:], high[-1]])


def sdnl301(names, modes=30):
    system = names["in_supports"](modes)
    linear, stops = modal(system)
    load = system.force.harmonics[1].real
    grid = 2.0 * math.pi / 251.2 / 2000.0 * np.arange(20001)
    inside = grid[(grid >= 0.17) & (grid <= 0.25)]
    none = np.zeros(modes)
    _, found = march(
        stops, none, none, inside[-1], **linear, load=lambda t: math.sin(251.2 * t) * load, step=1e-4, instants=inside
    )
    return math.sqrt(np.mean([pushes[-1] ** 2 + pushes[-2] ** 2 for _, pushes in found]))


INDEPENDENT = {
    "SDND101, duration of contact [s]": lambda: sdnd101()[0],
    "SDND101, largest force [N]": lambda: sdnd101()[1],
    "SDND101, impulse [N s]": lambda: sdnd101()[2],
    "SDND108, touches at [s]": lambda: sdnd108()[0],
    "SDND108, leaves at [s]": lambda: sdnd108()[1],
    "SDND108, height at 1 s [m]": lambda: sdnd108_height(1.0),
    "SDND108, height at 1.1 s [m]": lambda: sdnd108_height(1.1),
    "SDND122, first energy [Hz]": lambda: sdnd122(0.00650108331626),
    "SDND122, second energy [Hz]": lambda: sdnd122(0.00658129654238),
    "SDND122, third energy [Hz]": lambda: sdnd122(0.00647656819016),
    "VM65, touches at [s]": lambda: vm65()[0],
    "VM65, speed [in/s]": lambda: vm65()[1],
    "VM65, largest penetration [in]": lambda: vm65()[2],
    "VM65, at [s]": lambda: vm65()[3],
    "EXUDYN, 2e4 N/m, height at 0.5 s [m]": lambda: exudyn(True),
    "EXUDYN, 2e6 N/m, height at 0.25 s [m]": lambda: exudyn(False),
    "cam at 500 rpm, leaves at [degrees]": lambda: cam(500.0)[0],
    "cam at 500 rpm, lands at [degrees]": lambda: cam(500.0)[1],
    "cam at 500 rpm, lands with [m/s]": lambda: cam(500.0)[2],
    "cam at 468.53 rpm, flights in two turns": lambda: flights(468.53),
    "cam at 468.55 rpm, flights in two turns": lambda: flights(468.55),
    "SDND102, twin minus wall at 0.1 s [m]": lambda: np.diff([sdnd102(n, [0.1])[0] for n in (1, 2)])[0],
    "SDND102, twin minus wall at 0.3 s [m]": lambda: np.diff([sdnd102(n, [0.3])[0] for n in (1, 2)])[0],
    "SDNL104, tip at 0.1315 s [m]": lambda names: sdnl104(names)[0],
    "SDNL104, tip at 0.1566 s [m/s]": lambda names: sdnl104(names)[1],
    "harvester, ratio 0.5, smallest speed": lambda: harvester_speeds()[0],
    "harvester, ratio 0.5, second speed": lambda: harvester_speeds()[1],
    "harvester, ratio 0.5, speed at the other end": lambda: harvester_speeds()[2],
    "harvester, ratio 0.5, impacts per period": lambda: settled(0.5)[1],
    "harvester, ratio 0.427, impacts per period": lambda: settled(0.427)[1],
    "harvester, ratio 0.36, periods of the cycle": lambda: settled(0.36)[0],
    "harvester, ratio 0.3, periods of the cycle (0: chaos)": lambda: settled(0.3)[0],
    "harvester, ratio 0.22, impacts per period": lambda: settled(0.22)[1],
    "harvester, ratio 0.15, impacts per period": lambda: settled(0.15)[1],
    "harvester, ratio 0.1136, impacts per period": lambda: settled(0.1136)[1],
    "harvester, ratio 0.093, impacts per period": lambda: settled(0.093)[1],
    "SDNL301, rms force of the last support [N]": lambda names: sdnl301(names),
}


@pytest.fixture(scope="module")
def names():
    """Return the names that the page defines."""
    defined = {}
    exec(doctest.script_from_examples("".join(blocks(PAGE, "python"))), defined)
    return defined


def independent(quantity, names):
    """Return the independent value; some cases take the table of a model, such as shapes of modes, from the page."""
    solution = INDEPENDENT[quantity]
    return solution(names) if solution.__code__.co_argcount else solution()


def half(shown):
    """Return half a unit of the last digit of a number in print."""
    digits, _, power = shown.partition("e")
    return 0.5 * 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))


def test_every_row_of_the_page_has_an_independent_solution():
    assert [row[0] for row in ROWS] == list(INDEPENDENT)


@pytest.mark.long(but=21)
@pytest.mark.parametrize(("quantity", "published", "ours", "difference", "line"), ROWS, ids=[row[0] for row in ROWS])
def test_a_row_of_the_page_is_what_its_line_and_an_independent_solution_give(
    quantity, published, ours, difference, line, names
):
    value = float(eval(line, names))
    assert abs(value - float(ours)) <= 2.0 * half(ours)
    assert abs(independent(quantity, names) - float(ours)) <= 2.0 * half(ours)
    apart = value - float(published)
    assert difference == ("0" if abs(apart) <= half(published) else f"{apart:+.2g}")


def test_published_frequencies_of_the_one_sided_oscillator_omit_a_term():
    energies = 0.00650108331626, 0.00658129654238, 0.00647656819016
    published = [float(row[1]) for row in ROWS if row[0].startswith("SDND122")]
    assert [sdnd122(energy, omits=True) for energy in energies] == pytest.approx(published, abs=5e-11)


def test_the_trapezoidal_rule_with_the_time_steps_of_the_source_makes_contacts_longer():
    def step(p, v, h):
        stiff, fall = 2e4 / 0.25, 9.81
        matrix = [[1.0, -h / 2.0], [h / 2.0 * stiff, 1.0]]
        return np.linalg.solve(matrix, [p + h / 2.0 * v, v - h / 2.0 * (stiff * p + 2.0 * fall)])

    def duration(h):
        p, v, time = 0.0, -math.sqrt(1.0 + 2.0 * 9.81 * 0.01), 0.0
        while (ahead := step(p, v, h))[0] < 0.0:
            (p, v), time = ahead, time + h
        return time + brentq(lambda part: step(p, v, part)[0], 1e-6 * h, h)

    assert duration(5e-3) == pytest.approx(12.8e-3, abs=5e-5)
    assert duration(1e-5) == pytest.approx(11.3e-3, abs=5e-5)


def test_a_stop_that_pulls_until_the_penetration_is_zero_loses_less_height():
    assert exudyn(False, pulls=True) == pytest.approx(0.0556745, abs=5e-8)


def test_newmarks_scheme_with_the_time_steps_of_the_source_gives_the_published_cantilever(names):
    published = [float(row[1]) for row in ROWS if row[0].startswith("SDNL104")]
    assert newmark(names) == pytest.approx(published, rel=2e-6)


def test_a_mass_on_a_shaken_base_moves_as_its_independent_solution(names):
    instants = 0.1 * np.arange(1, 11)
    assert names["wall"][1:] == pytest.approx(sdnd102(1, instants), abs=1e-13)


@pytest.mark.parametrize("column", [1, 4], ids=["18,000 N/m", "45,000 N/m"])
def test_a_beam_that_turns_onto_a_spring_moves_as_the_page_shows(column, names):
    rows = np.array([[float(cell) for cell in row] for row in table(PAGE, "| time [ms]")])
    published, shown, difference = rows[:, column : column + 3].T
    spring, ours = (18000.0, names["softer"]) if column == 1 else (45000.0, names["stiffer"])
    beam = beam_modes("pinned-free", 10)
    per_length = 2400.0 * 0.014**2
    shapes = beam.at(1.0) / math.sqrt(per_length * 0.783)
    rates = 2.0 * math.pi * beam.hertz(6.7e10 * 0.014**4 / 12.0, per_length, 0.783)
    linear = {"mass": np.eye(10), "damping": np.diag(0.02 * rates), "stiffness": np.diag(rates**2)}
    turning = np.array([-3.8 * 0.783 / shapes[0], *[0.0] * 9])
    instants = 1e-3 * np.arange(1, 13)
    _, found = march(
        [Compliant(-shapes, 0.0, spring)], np.zeros(10), turning, instants[-1],
        **linear, load=lambda t: 0.0, step=1e-4, instants=instants,
    )  # fmt: skip
    assert ours[1:] == pytest.approx([1e3 * shapes @ state[:10] for state, _ in found], abs=1e-9)
    assert ours[1:] == pytest.approx(shown, abs=1e-4)
    assert difference == pytest.approx(shown - published, abs=6e-4)
    assert np.abs(names["tip"](spring, 60) - ours).max() < 0.009


@pytest.mark.long
@pytest.mark.parametrize(("modes", "periods"), [(10, 1000), (20, 200), (30, 200)])
def test_the_settled_force_of_a_tube_in_supports_is_that_of_the_page(modes, periods, names):
    row = next(row for row in table(PAGE, "| modes") if row[0] == str(modes))
    rms, error = names["settled_force"](modes, periods)
    assert abs(rms - float(row[2])) < 4.0 * math.hypot(error, float(row[3]))


@pytest.mark.parametrize(("modes", "force"), [(10, "23.83"), (20, "23.30")])
def test_the_window_of_the_tube_in_supports_depends_on_the_number_of_modes(modes, force, names):
    assert f"{force} N with {modes}" in PAGE.read_text()
    assert names["published_window"](modes) == pytest.approx(float(force), abs=0.005)


def test_the_tube_in_supports_is_chaotic(names):
    tube = names["in_supports"](10)
    how = {"indices": ["n_periods", "lyapunov_per_impact"], "transient_impacts": 500, "sample_impacts": 1000}
    found = vi.parameter_map(tube, omega=[tube.omega], **how)
    assert found["n_periods"].item() == 0
    assert 0.05 < found["lyapunov_per_impact"].item() < 0.1
