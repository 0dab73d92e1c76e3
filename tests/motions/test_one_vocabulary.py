"""One motion has one name in maps, sections, diagrams, attractors, verdicts, the explorer and on the command line.

500 random oscillators are named by a map (one call, a design per row), by `decide` cell by cell, by the picture of a
refined map, by `recognise` and the command line from a section each, and by `attractors`. The slower callers name
fewer: verdicts 50, the explorer 100, basins and maps in words 50; diagrams name 60 values of one oscillator.
"""

from __future__ import annotations

import re

import numpy as np
import pytest

import vibroimpact as vi
from contents import named
from systems import a_random_system, sticking
from vibroimpact import report
from vibroimpact.backends import ImpactWindow
from vibroimpact.coexistence.final import final_motion
from vibroimpact.coexistence.measuring import Runner
from vibroimpact.explorer.point import compute_point
from vibroimpact.explorer.state import View
from vibroimpact.motion import MotionClass, decide, motion_name, refined
from vibroimpact.orbits.distance import orbit_distance
from vibroimpact.refinement.picture import motion_codes

SAMPLES = {"transient_impacts": 500, "sample_impacts": 500}
CYCLES = ("lyapunov_per_impact", "n_periods", "n_impacts")
NUMBER = 500
UNSURE = {"undecided", "not followed to the end"}
SLACK = 0.05  # of the oscillators named by two callers: undecided by one, within the sample that it happens to see


def random_oscillator(rng):
    return vi.ImpactOscillator(
        mass=10 ** rng.uniform(-0.5, 0.5),
        damping=float(rng.choice([0.0, 10 ** rng.uniform(-3, 0)], p=[0.05, 0.95])),
        stiffness=10 ** rng.uniform(-0.5, 0.5),
        omega=10 ** rng.uniform(-0.8, 0.7),
        restitution=float(rng.choice([0.0, rng.uniform(0.1, 0.95)], p=[0.1, 0.9])),
        gap=float(rng.choice([0.0, rng.uniform(-1.3, 1.5)])),
    )


@pytest.fixture(scope="module")
def oscillators():
    rng = np.random.default_rng(12)
    return [random_oscillator(rng) for _ in range(NUMBER)]


@pytest.fixture(scope="module")
def sweep(oscillators):
    """The map of all, a design per row."""
    points = {name: np.array([getattr(osc, name) for osc in oscillators]) for name in oscillators[0].values}
    return vi.parameter_map(vi.ImpactOscillator(), points=points, indices=CYCLES, **SAMPLES)


@pytest.fixture(scope="module")
def names(sweep):
    """The names on the map, by class and status."""
    classes = vi.classify(sweep)
    kinds = refined(classes["motion"].values, classes["status"].values)
    return [
        motion_name(*row) for row in zip(kinds, classes["n_periods"].values, classes["n_impacts"].values, strict=True)
    ]


def agree(mine, others):
    """Hold names to be the same wherever both callers are sure, and both to be sure nearly everywhere."""
    pairs = list(zip(mine, others, strict=True))
    differ = [(i, *pair) for i, pair in enumerate(pairs) if pair[0] != pair[1]]
    assert [row for row in differ if not UNSURE & set(row[1:])] == []
    assert len(differ) <= max(1, SLACK * len(pairs)), differ


def test_the_map_has_motions_of_every_kind(names):
    kinds = {name.split("-")[0] for name in names}
    assert {"period", "intermittent sticking", "chaotic", "no impact", "permanently in contact", "undecided"} <= kinds
    assert any(name.endswith(" sticking") and name.startswith("period-") for name in names)


def test_deciding_cell_by_cell_is_deciding_all_at_once(sweep, names):
    growth = sweep["lyapunov_per_impact"].values * SAMPLES["sample_impacts"]
    rows = zip(sweep["status"].values, growth, sweep["n_periods"].values, sweep["n_impacts"].values, strict=True)
    alone = [motion_name(decide(*row), int(row[2]), int(row[3])) for row in rows]
    assert alone == names


def test_a_refined_map_tells_the_same_motions_apart(sweep, names):
    cells = {name: sweep[name].values for name in (*CYCLES, "status")}
    codes = motion_codes(cells, SAMPLES["sample_impacts"])
    classes = [MotionClass(code % 8).word for code in codes]
    assert classes == [MotionClass(code).word for code in vi.classify(sweep)["motion"].values]
    by_code = {}
    for code, name in zip(codes.tolist(), names, strict=True):
        by_code.setdefault(code, set()).add(name)
    assert all(len(found) == 1 for code, found in by_code.items() if code % 8 == MotionClass.PERIODIC)


def test_a_section_is_recognised_as_the_map_names_it(oscillators, names):
    agree(names, [vi.recognise(vi.impact_section(osc, **SAMPLES)).name for osc in oscillators])


def test_a_diagram_names_each_value_as_the_map_does():
    osc, omega = vi.ImpactOscillator(), np.linspace(0.15, 4.5, 60)
    sampling = {"indices": CYCLES, "omega": omega, **SAMPLES}
    diagram, sweep = vi.bifurcation_diagram(osc, **sampling), vi.parameter_map(osc, **sampling)
    assert vi.classify(diagram)["motion"].equals(vi.classify(sweep)["motion"])
    intervals = [line for line in report.sentences_of(diagram) if line.startswith("  omega")]
    lines = report.sentences_of(sweep)
    for name in {line.split(": ")[1] for line in intervals} - {"does not repeat"}:
        assert name in " ".join(lines) or "other motion" in " ".join(lines)


@pytest.mark.long
def test_an_attractor_has_the_name_of_the_motion_that_leads_to_it(oscillators, names):
    """What does not repeat is followed further than a map does: there it is the final motion that both name."""
    runner, found, mine = Runner(), [], list(names)
    for osc in oscillators:
        listed = vi.attractors(osc, [vi.State(min(0.0, osc.gap))], **SAMPLES)
        found.append(listed[0].name if listed else "undecided")
        assert not listed or listed[0].motion.name == listed[0].name
    for i, osc in enumerate(oscillators):
        if names[i] in ("chaotic", "intermittent sticking", "undecided"):
            mine[i] = final_motion(runner, osc, ImpactWindow(500, 500)).measured.name
    agree(mine, found)


def test_a_portrait_of_basins_has_the_names_of_its_attractors(oscillators):
    for osc in oscillators[::10]:
        portrait = vi.basins(osc, phase=np.linspace(0.0, 0.9, 5), velocity=np.linspace(0.1, 2.0, 4))
        starts = [
            vi.State(osc.gap, float(v), float(phase) * osc.period)
            for phase in portrait["phase"].values
            for v in portrait["velocity"].values
        ]
        meanings = [word.replace("_", " ") for word in portrait["attractor"].attrs["flag_meanings"].split()[1:]]
        listed = vi.attractors(osc, starts)
        assert {re.sub(" [a-z]$", "", name) for name in meanings} == {found.name for found in listed}


def name_of_cell(osc, **sampling):
    """Return a map of one cell, and the name of its motion."""
    cell = vi.parameter_map(osc, omega=[osc.omega], indices=CYCLES, **sampling)
    return cell, named(cell)[1]


def test_the_explorer_names_a_point_as_the_map_of_its_samples(oscillators):
    for osc in oscillators[::5]:
        _, name = name_of_cell(osc, transient_impacts=100, sample_impacts=500)
        assert compute_point(View(osc=osc, samples=500)).name == name


def test_the_command_line_says_the_maps_word_for_a_map_and_for_a_section(oscillators, names):
    for osc in oscillators[::10]:
        cell, name = name_of_cell(osc, **SAMPLES)
        assert f"100 % {name}" in [line.strip() for line in report.sentences_of(cell)]
    sections = [vi.impact_section(osc, **SAMPLES) for osc in oscillators]
    agree(names, [re.split("[,:;]", report.sentences_of(section)[0].split(": ", 1)[1])[0] for section in sections])


def without_rebound(seed):
    """Return a random system whose stops take all speed; None if they leave no room, or impacts cease or come close."""
    rng = np.random.default_rng([40, seed])
    model = a_random_system(rng, int(rng.integers(1, 4)), int(rng.integers(1, 3)))
    for stop in model.stops:
        gap = float(rng.choice([0.0, stop.gap]))
        model = model.replace(**{f"{stop.name}_restitution": 0.0, f"{stop.name}_gap": gap})
    try:
        section = vi.impact_section(model, transient_impacts=500, sample_impacts=500)
    except ValueError:
        return None
    waits = np.diff(section["time"].values) / model.period
    distinct = section["status"] <= vi.Status.SHORT_WINDOW and waits.min() > 1e-6
    return (model, section) if distinct else None


@pytest.mark.long
def test_a_motion_that_rests_has_the_same_name_in_a_section_a_sentence_and_as_an_orbit():
    """Whether the rest erases all memory (one mass; all masses at once) or not, and for one without rests."""
    kinds = []
    for seed in range(100):
        if (found := without_rebound(seed)) is None:
            continue
        model, section = found
        motion = vi.recognise(section)
        if not motion.n_periods or motion.n_impacts > 60:
            continue
        (orbit,) = vi.find_orbit(model, near=section)
        assert orbit.name == motion.name, seed
        assert report.motion_of(section).startswith(motion.name), seed
        kinds.append((motion.kind, orbit.sticks))
    assert {("periodic", True), ("periodic", False), ("sticking", True)} == set(kinds)
    assert len(kinds) > 40


def test_a_rest_that_another_coordinate_remembers_is_told_beside_the_number_of_impacts():
    model = sticking()
    (found,) = vi.attractors(model)
    (orbit,) = vi.find_orbit(model, n_impacts=5)
    verdict = vi.describe(model, parameters=[])
    assert found.name == found.orbit.name == orbit.name == verdict.motion.name == "period-1 impact-5"
    assert orbit.sticks
    assert orbit_distance(orbit, found.orbit) < 1e-9
    assert vi.find_orbit(model, n_impacts=-1)[0].name == orbit.name
    assert "44.9 % of the time at rest at a stop" in str(verdict)
    assert orbit.stuck_time / model.period == pytest.approx(0.449391, abs=1e-6)
