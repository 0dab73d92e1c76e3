"""Beams and rods of finite elements: closed forms of deflections and frequencies, supports, points and bad input."""

import math
import re

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.linalg import eigvalsh
from scipy.optimize import brentq

import vibroimpact as vi
from systems import cantilever
from vibroimpact.models import fe_beam, fe_rod
from vibroimpact.models.beam_modes import beam_modes
from vibroimpact.orbits.cycle import cycle_of
from vibroimpact.orbits.systems.sampling import places_of

HERTZ = 2.0 * math.pi
BUILDERS = {"beam": fe_beam, "rod": fe_rod}
ENDS = {
    "clamped-free": ("clamp", None),
    "clamped-clamped": ("clamp", "clamp"),
    "clamped-pinned": ("clamp", "pin"),
    "pinned-pinned": ("pin", "pin"),
    "pinned-free": ("pin", None),
}


def unit(build, elements=8, supports=None, **more):
    """Return a beam or rod of unit rigidity, mass per length and length."""
    given = {"length": 1.0, "rigidity": 1.0, "mass_per_length": 1.0, "elements": elements}
    return build(**given | {"supports": {0.0: "clamp"} if supports is None else supports} | more)


def static(system, at, force):
    """Return the displacement of a point under a constant force at another."""
    return float(system.points[at] @ np.linalg.solve(system.stiffness, system.points[force]))


def test_a_beam_with_a_spring_behind_a_gap_has_the_published_frequencies_while_it_is_open():
    beam = fe_beam(
        length=0.7, elements=7, supports={0: "clamp"}, section={"width": 0.03, "thickness": 0.03},
        youngs_modulus=185e9, density=7830.0, points={"spring": 0.3, "tip": 0.7}, damping_ratios=0.008,
        force=vi.Force(omega=317.869, harmonics={1: {"tip": 20.0}}),
        stops=[vi.Stop(direction={"spring": 1.0}, gap=1e-3, stiffness=1.3e6, name="spring")],
    )  # fmt: skip
    assert (beam.natural_frequencies[:5] / HERTZ).round(1).tolist() == [48.1, 301.3, 844.4, 1659.2, 2758.0]
    assert beam.coordinates == 14
    assert np.diag(beam.damping) == pytest.approx(0.016 * beam.natural_frequencies, rel=1e-15)


@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize("elements", [16, 32, 60])
def test_frequencies_of_hermite_elements_exceed_those_of_the_beam_by_their_known_error(ends, elements):
    supports = {at: what for at, what in zip((0.0, 1.0), ENDS[ends], strict=True) if what}
    waves = beam_modes(ends, 4).wave_numbers
    too_high = (waves / elements) ** 4 / 1440.0
    found = unit(fe_beam, elements, supports).natural_frequencies[:4]
    assert found == pytest.approx(waves**2 * (1.0 + too_high), abs=0.1 * (waves**2 * too_high).max() + 1e-9)
    assert (found >= waves**2 * (1.0 - 1e-10)).all()


@pytest.mark.parametrize("ends", ENDS)
def test_shapes_are_those_of_the_beam(ends):
    supports = {at: what for at, what in zip((0.0, 1.0), ENDS[ends], strict=True) if what}
    beam = unit(fe_beam, 30, supports, points={"at": 0.437})
    assert np.abs(beam.points["at"][:3]) == pytest.approx(np.abs(beam_modes(ends, 3).at(0.437)), abs=1e-4)


def test_frequencies_of_linear_elements_exceed_those_of_the_rod_by_their_known_error():
    for supports, waves in (({}, np.arange(4)), ({0: "clamp"}, np.arange(4) + 0.5), ({0: "clamp", 1: "clamp"}, 1)):
        exact = np.pi * np.atleast_1d(waves)
        found = unit(fe_rod, 60, supports).natural_frequencies[: len(exact)]
        assert found == pytest.approx(exact * (1.0 + (exact / 60.0) ** 2 / 24.0), rel=1e-5)


@pytest.mark.parametrize(("build", "number"), [(fe_beam, 2), (fe_rod, 1)])
@pytest.mark.parametrize("elements", [1, 5, 62])
def test_a_free_structure_has_rigid_modes_of_frequency_zero_and_its_whole_mass(build, number, elements):
    free = unit(build, elements, {}, points={"left": 0.0, "all": (0.0, 1.0)})
    assert (free.natural_frequencies[:number] == 0.0).all()
    assert free.natural_frequencies[number] > 3.0
    rigid = free.points["all"][:number]
    assert rigid @ rigid == pytest.approx(1.0, rel=1e-12)  # 1 over the mass
    assert free.points["all"][number:] == pytest.approx(0.0, abs=1e-9)  # elastic modes leave the centre at rest


def test_supports_leave_the_rigid_modes_that_they_do_not_hold():
    for supports, number in (
        ({0.5: "pin"}, 1), ({0.3: "guide"}, 1), ({0.3: 2.0}, 1), ({0.1: (0.0, 3.0)}, 1),
        ({0.2: "pin", 0.7: 1.0}, 0), ({0.2: "pin", 0.7: "pin"}, 0), ({0.3: "guide", 0.9: (0.0, 1.0)}, 1),
    ):  # fmt: skip
        found = unit(fe_beam, 10, supports).natural_frequencies
        assert (found[:number] == 0.0).all(), supports
        assert found[number] > 0.1, supports


@pytest.mark.parametrize("elements", [1, 3, 20])
def test_static_deflections_are_exact_at_nodes_wherever_the_force_acts(elements):
    a = 0.437
    beam = unit(fe_beam, elements, points={"tip": 1.0, "at": a})
    assert static(beam, "tip", "tip") == pytest.approx(1.0 / 3.0, rel=1e-9)
    assert static(beam, "tip", "at") == pytest.approx(a**2 * (3.0 - a) / 6.0, rel=1e-9)
    rod = unit(fe_rod, elements, points={"tip": 1.0, "at": a})
    assert static(rod, "tip", "at") == pytest.approx(a, rel=1e-9)


def test_a_load_along_a_span_is_that_of_the_beam():
    beam = unit(fe_beam, 5, points={"tip": 1.0, "all": (0.0, 1.0), "half": (0.37, 1.0)})
    assert static(beam, "tip", "all") == pytest.approx(1.0 / 8.0, rel=1e-9)
    a = 0.37  # the mean of x^2 (3 - x)/6 from a to 1
    assert static(beam, "tip", "half") == pytest.approx(((1 - a**3) - (1 - a**4) / 4) / 6 / (1 - a), rel=1e-9)
    assert static(beam, "all", "all") == pytest.approx(1.0 / 20.0, rel=1e-3)  # the mean deflection is no nodal one


def test_springs_hold_with_their_stiffness():
    beam = unit(fe_beam, 9, {0.0: "clamp", 1.0: 6.0}, points={"tip": 1.0})
    assert static(beam, "tip", "tip") == pytest.approx(1.0 / (3.0 + 6.0), rel=1e-9)
    hinged = unit(fe_beam, 9, {0.0: (math.inf, 2.0)}, points={"tip": 1.0})
    assert static(hinged, "tip", "tip") == pytest.approx(1.0 / 3.0 + 1.0 / 2.0, rel=1e-9)
    sprung = unit(fe_rod, 40, {0.0: "clamp", 1.0: 2.0}).natural_frequencies[0]
    assert sprung == pytest.approx(brentq(lambda w: w / math.tan(w) + 2.0, 1.6, 3.0), rel=1e-3)


def test_a_node_is_at_each_support():
    three = unit(fe_beam, 12, {0.0: "pin", 0.4: "pin", 1.0: "pin"}, points={"middle": 0.4, "right": 0.7})
    assert three.points["middle"] == pytest.approx(0.0, abs=0.0)
    alone = unit(fe_beam, 60, {0.0: "pin", 0.4: "pin", 1.0: "pin"})
    assert three.natural_frequencies[:3] == pytest.approx(alone.natural_frequencies[:3], rel=2e-3)


def test_frequencies_are_the_eigenvalues_of_textbook_matrices():
    """Two elements of length 1 that are clamped on their left."""
    mass, stiffness = cantilever(2)
    squares = eigvalsh(stiffness, mass)
    beam = unit(fe_beam, 2, length=2.0)
    assert beam.natural_frequencies == pytest.approx(np.sqrt(squares), rel=1e-12)


@pytest.mark.parametrize("build", BUILDERS.values())
def test_shapes_are_orthogonal_in_the_mass_and_the_stiffness(build):
    places = np.linspace(0.0, 1.0, 201)
    names = {f"p{at}": place for at, place in enumerate(places.tolist())}
    table = np.array(list(unit(build, 6, {0.3: 5.0}, points=names).points.values()))[:, :4]
    weights = np.full(201, 1.0 / 200.0) * np.where((np.arange(201) % 200) == 0, 0.5, 1.0)
    assert table.T @ (weights[:, None] * table) == pytest.approx(np.eye(4), abs=5e-3)


def test_rayleigh_damping_brakes_rigid_modes_too():
    free = unit(fe_beam, 4, {}, rayleigh=(0.3, 0.01))
    assert np.diag(free.damping) == pytest.approx(0.3 + 0.01 * free.natural_frequencies**2, rel=1e-14)
    assert not np.any(unit(fe_beam, 4, {}).damping)
    each = unit(fe_beam, 4, modes=2, damping_ratios=[0.01, 0.02])
    assert np.diag(each.damping) == pytest.approx([0.02, 0.04] * each.natural_frequencies, rel=1e-14)


def test_sections_of_a_beam_and_a_rod():
    steel = {"length": 1.0, "elements": 4, "supports": {0.0: "clamp"}, "youngs_modulus": 2e11, "density": 7800.0}
    d, t = 0.02, 0.002
    for section, area, second in (
        ({"width": 0.03, "thickness": 0.01}, 3e-4, 0.03 * 0.01**3 / 12.0),
        ({"diameter": d}, math.pi * d**2 / 4.0, math.pi * d**4 / 64.0),
        (
            {"outer_diameter": d, "wall_thickness": t},
            math.pi * (d**2 - (d - 2 * t) ** 2) / 4.0,
            math.pi * (d**4 - (d - 2 * t) ** 4) / 64.0,
        ),
    ):
        for build, rigidity in ((fe_beam, 2e11 * second), (fe_rod, 2e11 * area)):
            plain = {"rigidity": rigidity, "mass_per_length": 7800.0 * area, "length": 1.0, "elements": 4}
            other = build(**plain, supports={0.0: "clamp"}).natural_frequencies
            assert build(**steel, section=section).natural_frequencies == pytest.approx(other, rel=1e-12)


def test_the_most_elements_are_those_of_128_coordinates():
    assert unit(fe_beam, 64).coordinates == 128
    assert unit(fe_beam, 63, {}).coordinates == 128
    assert unit(fe_rod, 128).coordinates == 128
    assert unit(fe_rod, 127, {}).coordinates == 128
    assert unit(fe_beam, 64, modes=3).coordinates == 3


@pytest.mark.parametrize("seed", range(5))
def test_a_random_structure_is_built_of_its_parts(seed):
    """Receptances are symmetric, the mass is whole, and a spring adds its stiffness to the compliance."""
    random = np.random.default_rng(seed)
    length, rigidity, per_length = random.uniform(0.2, 3.0), 10.0 ** random.uniform(-1, 6), random.uniform(0.01, 30.0)
    at, spring = length * random.uniform(0.3, 1.0), 10.0 ** random.uniform(-1, 1) * rigidity / length**3
    elements = int(random.integers(2, 40))
    common = {"length": length, "rigidity": rigidity, "mass_per_length": per_length, "elements": elements}
    points = {"at": at, "tip": length}
    open_, closed = (fe_beam(**common, supports={0.0: "clamp"} | more, points=points) for more in ({}, {at: spring}))
    c = {(i, j): static(open_, i, j) for i in points for j in points}
    force = c["at", "tip"] / (c["at", "at"] + 1.0 / spring)
    assert static(closed, "tip", "tip") == pytest.approx(c["tip", "tip"] - force * c["at", "tip"], rel=1e-7)
    free = fe_beam(**common, supports={}, points={"all": (0.0, length)})
    assert 1.0 / (free.points["all"][:2] @ free.points["all"][:2]) == pytest.approx(per_length * length, rel=1e-9)


def test_a_motion_at_a_point_is_its_row_times_the_coordinates():
    beam = unit(
        fe_beam, 3, points={"tip": 1.0, "mid": 0.5}, damping_ratios=0.02,
        force=vi.Force(omega=3.0, harmonics={1: {"tip": 1.0}}),
        stops=[vi.Stop(direction={"tip": 1.0}, gap=0.3, stiffness=30.0, name="bumper")],
    )  # fmt: skip
    motion = vi.simulate(beam, periods=3)
    tip = beam.at_point("tip", motion)
    assert tip["displacement"].dims == tip["velocity"].dims == ("time",)
    assert tip["displacement"].values == pytest.approx(0.3 - motion["clearance"].sel(stop="bumper").values, abs=1e-14)
    assert tip["displacement"].attrs == motion["displacement"].attrs
    assert "coordinate" not in tip.dims
    assert tip["impact_time"].identical(motion["impact_time"])
    alone = beam.at_point("tip", motion["velocity"])
    assert alone.identical(tip["velocity"])
    assert (beam.at_point("tip", motion["velocity"].transpose()).values == alone.values).all()
    looks = beam.at_point("mid", vi.stroboscopic_section(beam, transient_periods=5, sample_periods=3))
    assert looks["displacement"].dims == ("period",)
    orbit = next(orbit for orbit in vi.find_orbit(beam) if orbit.stable)
    y, v, a = beam.at_point("tip", orbit.motion([0.0, 0.1]))
    assert y.shape == v.shape == a.shape == (2,)
    assert beam.at_point("tip", np.eye(6)).tolist() == beam.points["tip"].tolist()


def test_points_are_kept_by_copies_files_and_families(tmp_path):
    modes = {"frequencies": [1.0, 2.0], "damping_ratios": 0.01, "shapes": [[1.0, 2.0], [3.0, -1.0]]}
    system = vi.ImpactSystem.from_modes(
        **modes, points=["hip", "toe"], stops=[vi.Stop(direction={"toe": 1.0}, gap=1.0, name="floor")]
    )
    assert system.points["toe"].tolist() == [3.0, -1.0]
    assert system.replace(floor_gap=2.0).points["toe"].tolist() == [3.0, -1.0]
    unnamed = vi.ImpactSystem.from_modes(**modes)
    assert list(unnamed.points) == ["point_1", "point_2"]
    motion = vi.simulate(system, start=vi.State([0.1, 0.2]), duration=6.0)
    vi.save(motion, tmp_path / "motion.nc")
    from vibroimpact.dataset import model_of

    assert model_of(vi.load(tmp_path / "motion.nc")) == system
    assert model_of(vi.load(tmp_path / "motion.nc")).points["toe"].tolist() == [3.0, -1.0]


def test_matrices_may_have_named_points():
    given = {"mass": np.eye(2), "stiffness": [[2.0, -1.0], [-1.0, 1.0]]}
    named = vi.ImpactSystem(
        **given, points={"end": [0.0, 1.0], "mean": [0.5, 0.5]},
        force=vi.Force(omega=1.0, harmonics={1: {"mean": 2.0}}, constant=[0.0, 1.0]),
        stops=[vi.Stop(direction={"end": 1.0, "mean": -1.0}, gap=0.1)],
    )  # fmt: skip
    assert named.force.harmonics[1].tolist() == [1.0, 1.0]
    assert named.force.constant.tolist() == [0.0, 1.0]
    assert named.stops[0].direction.tolist() == [-0.5, 0.5]
    assert named.at_point("end", [3.0, 4.0]) == 4.0


SOLID = {"rigidity": None, "mass_per_length": None, "youngs_modulus": 1.0, "density": 1.0}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"elements": 0}, "`elements` must be a whole number >= 1, got 0"),
        ({"elements": 2.5}, "`elements` must be a whole number >= 1, got 2.5"),
        ({"elements": 65}, "`elements` must be at most 64, for 128 degrees of freedom, got 65"),
        ({"elements": 10**8}, "`elements` must be at most 64, for 128 degrees of freedom"),
        ({"elements": 1, "supports": {0: "clamp", 1: "clamp"}}, "`elements` must be at least 2 here, got 1"),
        ({"elements": 2, "supports": {0: "pin", 0.3: "pin", 0.6: 5.0}}, "`elements` must be at least 3, as supports"),
        ({"length": 0.0}, "`length` must be a finite number > 0, got 0.0"),
        ({"supports": {1.2: "pin"}}, "`supports` must be on the beam, from 0 to 1 m, got 1.2"),
        ({"supports": {-0.1: "pin"}}, "`supports` must be on the beam, from 0 to 1 m, got -0.1"),
        ({"supports": {0.0: "clmp"}}, "unknown `supports[0.0]` 'clmp'; choose from clamp, pin, guide; did you mean"),
        ({"supports": {0.0: -2.0}}, "`supports[0.0]` must be 'clamp' or 'pin' or 'guide', or a stiffness > 0, got"),
        ({"supports": {0.0: (1.0, 2.0, 3.0)}}, "`supports[0.0]` must be two stiffnesses in N/m and N m/rad"),
        ({"supports": {0.5: "pin", 0.5 + 1e-12: 3.0}}, "`supports` has two supports at 0.5 m"),
        ({"supports": "clamp"}, "`supports` must be a mapping from places in m to supports, got 'clamp'"),
        ({"points": {"tip": 1.1}}, "`points['tip']` must be on the beam, from 0 to 1 m, got 1.1"),
        ({"points": {"all": (0.5, 0.2)}}, "`points['all']` must be a place in m, or the two ends of a span, ascending"),
        ({"points": [0.3]}, "`points` must be a mapping from names to places in m, got [0.3]"),
        ({"force": vi.Force(omega=1.0, constant={"top": 1.0})}, "unknown point 'top'; choose from tip"),
        ({"points": None, "force": vi.Force(omega=1.0, constant={"top": 1.0})}, "`constant` refers to points, but"),
        ({"stops": [vi.Stop(direction={"hip": 1.0}, gap=0.1)]}, "unknown point 'hip'"),
        (
            {"points": {"root": 0.0}, "stops": [vi.Stop(direction={"root": 1.0}, gap=0.1)]},
            "`stops[0].direction` refers to point 'root', which a rigid support holds",
        ),
        ({"rigidity": None}, "give either `section`, `youngs_modulus` and `density`, or `rigidity` and"),
        ({"section": {"diameter": 1.0}}, "got `section`, `rigidity`, `mass_per_length`"),
        ({"rigidity": -1.0}, "`rigidity` must be a finite number > 0, got -1.0"),
        ({"damping_ratios": -0.1}, "`damping_ratios` must be a number >= 0, or 16 of them, one per mode, got -0.1"),
        ({"damping_ratios": [0.1, 0.2]}, "`damping_ratios` must be a number >= 0, or 16 of them, one per mode"),
        ({"rayleigh": (0.1,)}, "`rayleigh` must be two numbers >= 0"),
        ({"rayleigh": (0.1, 0.2), "damping_ratios": 0.1}, "give either `damping_ratios` or `rayleigh`, not both"),
        ({"modes": 17}, "`modes` must be at most 16, the degrees of freedom of the nodes, got 17"),
        ({"modes": 0}, "`modes` must be a whole number >= 1, got 0"),
        (
            SOLID | {"section": {"width": 0.1}},
            "`section` must have the dimensions width and thickness, diameter, or outer_diameter and",
        ),
        (SOLID | {"section": {"diameter": -1.0}}, "`section['diameter']` must be a finite number > 0"),
        (
            SOLID | {"section": {"outer_diameter": 0.01, "wall_thickness": 0.006}},
            "`wall_thickness` must be less than half of `outer_diameter`",
        ),
        (SOLID | {"section": 0.03}, "`section` must be a mapping of dimensions in m"),
    ],
)  # fmt: skip
def test_what_a_beam_cannot_be_is_refused_in_a_sentence(changes, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        unit(fe_beam, **{"points": {"tip": 1.0}, **changes})


def test_a_point_that_is_not_there_is_refused():
    beam = unit(fe_beam, points={"tip": 1.0})
    with pytest.raises(ValueError, match="unknown `point` 'top'; choose from tip"):
        beam.at_point("top", np.zeros(16))
    with pytest.raises(ValueError, match="must have 16 coordinates in its last axis, got an array of shape"):
        beam.at_point("tip", np.zeros(3))
    with pytest.raises(ValueError, match="the system has no named points"):
        unit(fe_beam).at_point("tip", np.zeros(16))
    with pytest.raises(ValueError, match="`points` must be a mapping"):
        vi.ImpactSystem(mass=1.0, stiffness=1.0, points=["tip"])
    with pytest.raises(ValueError, match=r"`points\['tip'\]` must have 2 numbers, one per coordinate, got 1"):
        vi.ImpactSystem(mass=np.eye(2), stiffness=np.eye(2), points={"tip": [1.0]})


BEAM = """
import vibroimpact as vi

beam = vi.models.fe_beam(
    length=1.0, elements=3, supports={0.0: "clamp"}, rigidity=1.0, mass_per_length=1.0, damping_ratios=0.02,
    points={"tip": 1.0, "mid": 0.5}, force=vi.Force(omega=3.0, harmonics={1: {"tip": 1.0}}),
    stops=[vi.Stop(direction={"tip": 1.0}, gap=0.05, restitution=0.5, name="bumper")],
)
"""


@pytest.fixture
def beam(tmp_path):
    (tmp_path / "mine.py").write_text(BEAM)
    names = {}
    exec(BEAM, names)
    return names["beam"]


def test_figures_draw_the_motion_at_a_point_with_the_stops_that_act_there(beam):
    motion = vi.simulate(beam, periods=3)
    assert motion.sizes["impact"] > 0
    for point, walls in (("tip", ["bumper"]), ("mid", [])):
        there = beam.at_point(point, motion)
        ax = vi.plotting.time_history(there)
        assert f"displacement of {point}" in ax.get_ylabel()
        legend = " ".join(text.get_text() for text in ax.figure.legends[0].get_texts()) if ax.figure.legends else ""
        texts = legend + " ".join(text.get_text() for text in ax.texts)
        assert ("bumper" in texts) == bool(walls)
        assert vi.plotting.phase_portrait(there).lines
        plt.close("all")
    looks = beam.at_point("mid", vi.stroboscopic_section(beam, transient_periods=5, sample_periods=3))
    assert "displacement of mid" in vi.plotting.stroboscopic_map(looks).get_xlabel()
    plt.close("all")
    with pytest.raises(ValueError, match="the motion is that of point 'tip'; leave out `coordinate` and `stop`"):
        vi.plotting.time_history(beam.at_point("tip", motion), coordinate=1)
    with pytest.raises(ValueError, match="`motion` must have coordinates; take the result of simulate"):
        beam.at_point("tip", vi.impact_section(beam, sample_impacts=3))


def test_the_command_line_gives_the_motion_at_a_point(beam, run, refused, tmp_path):
    tip = beam.at_point("tip", vi.simulate(beam, periods=3))["displacement"]
    _, lines, _ = run("simulate --model mine.py:beam --periods 3 --point tip")
    assert f"displacement {float(tip.min()):.4g} to {float(tip.max()):.4g} m" in lines
    assert run("simulate --model mine.py:beam --periods 3 --point tip --out tip.nc")[0] == 0
    saved = vi.load(tmp_path / "tip.nc")
    assert np.array_equal(saved["displacement"].values, tip.values)
    assert run("plot tip.nc --out tip.png")[0] == 0
    assert "unknown `point` 'top'; choose from tip, mid" in refused("simulate --model mine.py:beam --point top")
    assert "`--point` needs a motion" in refused("section --model mine.py:beam --point tip")
    assert "the system has no named points" in refused("simulate -p w=2 --point tip")


def stiffly_damped(elements):
    """Return a driven cantilever of steel, damped in proportion to its stiffness, with a spring behind a gap."""
    return fe_beam(
        length=0.7, elements=elements, supports={0: "clamp"}, section={"width": 0.03, "thickness": 0.03},
        youngs_modulus=185e9, density=7830.0, points={"spring": 0.3, "tip": 0.7}, rayleigh=(0.0, 1.3e-4),
        force=vi.Force(frequency=48.5, harmonics={1: {"tip": 20.0}}),
        stops=[vi.Stop(direction={"spring": 1.0}, gap=1e-3, stiffness=1.3e6, name="spring")],
    )  # fmt: skip


@pytest.mark.long(but=1)
@pytest.mark.parametrize("elements", [6, 10, 20])
def test_orbits_of_beams_are_found_whose_fastest_modes_decay_within_a_millionth_of_a_period(elements):
    """With twenty elements their rates are up to 5e8/s, more than a million times that of the force."""
    model = stiffly_damped(elements)
    (orbit,) = vi.find_orbit(model)
    assert orbit.stable
    cycle, unknown = cycle_of(orbit)
    assert sum(sum(part[3] for part in places_of(cycle.leg(unknown, i))) for i in range(2)) < 20_000
    (coarse,) = vi.find_orbit(stiffly_damped(5))
    assert orbit.velocities == pytest.approx(coarse.velocities, rel=0.01)


@pytest.mark.long
def test_such_an_orbit_is_the_motion_that_is_simulated():
    model = stiffly_damped(4)
    (orbit,) = vi.find_orbit(model)
    motion = model.at_point("tip", vi.simulate(model, start=orbit.start, periods=1, samples_per_period=4000))
    tip = motion["displacement"].values
    assert tip[-1] == pytest.approx(tip[0], abs=1e-11 * np.abs(tip).max())
    assert vi.response_of(orbit, of="tip").amplitude == pytest.approx(0.5 * np.ptp(tip), rel=1e-6)


@pytest.mark.parametrize("call", [vi.attractors, vi.describe])
def test_a_long_search_among_the_motions_of_a_stiff_beam_is_announced(call):
    """The answer would take minutes, so it is not waited for."""
    beam = vi.models.fe_beam(
        length=0.7, elements=16, supports={0.0: "clamp"}, rigidity=12487.5, mass_per_length=7.047, rayleigh=(3.0, 1e-5),
        points={"tip": 0.7}, force=vi.Force(frequency=48.5, harmonics={1: {"tip": 20.0}}),
        stops=[vi.Stop(direction={"tip": 1.0}, gap=1e-3, stiffness=1.3e6)],
    )  # fmt: skip
    with pytest.raises(
        UserWarning, match=r"256 initial conditions take about \d.* or more: the fastest rate .* [\d,]+ t"
    ):
        call(beam, workers=2)
