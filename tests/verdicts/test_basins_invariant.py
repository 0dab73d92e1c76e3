"""What leaves attractors and basins alone: mirror images, other coordinates, an uncoupled mode, the other engine."""

import numpy as np
import pytest

import vibroimpact as vi
from codes import Witness
from contents import names_of_starts
from systems import THREE, TWINS, beside_its_centre, free_pair, mirrored, one_mass, two_sided
from systems import system as of
from vibroimpact.orbits import same_orbit


def test_a_motion_and_its_mirror_image_are_two_attractors():
    found = vi.attractors(TWINS)
    one, other = (attractor for attractor in found if attractor.kind == "periodic")
    assert one.name == other.name == "period-1 impact-2"
    assert mirrored(one, other)
    assert not same_orbit(one, other, tolerance=1e-3)
    assert sum(attractor.share for attractor in found) == 1.0
    (symmetric,) = (found for found in vi.attractors(two_sided(2.0, 0.6, 0.5)) if found.kind == "periodic")
    assert symmetric.stops == ("above", "below")
    assert mirrored(symmetric, symmetric)
    assert symmetric.velocities[0] == pytest.approx(1.01091975000998629752895, rel=1e-13)
    assert symmetric.phases[0] == pytest.approx(0.30697182627669859292, rel=1e-12)


@pytest.mark.parametrize(("omega", "number"), [(0.8, 2), (0.9, 1)])
def test_chaos_is_told_from_its_mirror_image_until_both_merge(omega, number):
    """After a pitchfork each chaotic attractor strikes one of the stops harder, for good; after the crisis neither."""
    model = two_sided(omega, 0.85, 0.2)
    found = vi.attractors(model)
    assert [one.kind for one in found] == ["chaotic"] * number
    assert sum(one.share for one in found) == 1.0
    assert all(one.share > 0.4 for one in found)
    for transient in (0, 10_000) if number == 2 else ():
        samples = [
            vi.impact_section(model, start=one.start, transient_impacts=transient, sample_impacts=5000) for one in found
        ]
        above, below = ([float(hits["velocity"][hits["stop"] == stop].mean()) for hits in samples]
                        for stop in ("above", "below"))  # fmt: skip
        assert above == pytest.approx(below[::-1], rel=2e-3)
        assert above != pytest.approx(below, rel=0.01)
    for one in found if number == 2 else ():
        start = one.start.displacement, one.start.velocity, one.start.time
        hits = Witness().impacts(model, *start, number=400)
        mean = [float(hits["velocity"][hits["stop"] == stop].mean()) for stop in (0, 1)]
        assert mean == pytest.approx([0.4207, 0.4286][:: 1 if mean[0] < mean[1] else -1], rel=3e-3)
        assert (mean[0] > mean[1]) == (above[found.index(one)] > below[found.index(one)])


def velocities_at_stops(system, start):
    """Return the mean velocity at each stop of a long motion."""
    hits = vi.impact_section(system, start=start, transient_impacts=5000, sample_impacts=20000)
    return [float(hits["velocity"].values[hits["stop"].values == stop].mean()) for stop in system.stop_names]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("omega", [1.18, 1.22])
def test_a_verdict_names_the_one_of_two_chaotic_twins_that_rest_leads_to(omega, sign):
    """Their means over all impacts are the same; one hits the first stop twice as hard as the second, one half."""
    system = two_sided(force=vi.Force(omega=omega, harmonics={1: sign}))
    first, other = vi.describe(system, parameters=[]).attractors
    assert first.from_rest
    assert first.chaotic
    assert other.chaotic
    mine = velocities_at_stops(system, None)
    assert mine[0] > 1.9 * mine[1] or mine[1] > 1.9 * mine[0]
    np.testing.assert_allclose(velocities_at_stops(system, first.start), mine, rtol=0.02)
    np.testing.assert_allclose(velocities_at_stops(system, other.start), mine[::-1], rtol=0.02)


def test_initial_conditions_that_mirror_each_other_lead_to_chaos_that_does():
    model = two_sided(0.8, 0.85, 0.2)
    starts = [vi.State(y, v, 0.3) for y, v in ((0.1, 0.2), (-0.05, 0.7), (0.0, -0.4))]
    images = [vi.State(-np.array(s.displacement), -np.array(s.velocity), 0.3 + model.period / 2) for s in starts]
    both = [vi.attractors(model, [start, image]) for start, image in zip(starts, images, strict=True)]
    assert all([one.share for one in found] == [0.5, 0.5] for found in both)


def test_twins_have_basins_that_are_mirror_images():
    y, v = np.linspace(-0.05, 0.05, 16), np.linspace(-1.0, 1.0, 15)
    here, there = (vi.basins(TWINS, displacement=y, velocity=v, phase=phase) for phase in (0.0, 0.5))
    names = "undecided period-1_impact-2_a period-1_impact-2_b"
    assert here["attractor"].attrs["flag_meanings"] == there["attractor"].attrs["flag_meanings"] == names
    at = [[vi.State(*(float(row[f"point_{axis}"][0]) for axis in ("displacement", "velocity")), time) for row in
           (found.isel(attractor_id=number) for number in range(2))] for found, time in
          ((here, 0.0), (there, 0.5 * TWINS.period))]  # fmt: skip
    first, second = ([vi.attractors(TWINS, [start])[0] for start in starts] for starts in at)
    image = [next(j for j in range(2) if mirrored(first[i], second[j])) for i in range(2)]
    assert sorted(image) == [0, 1]
    mapped = np.array([*image, 2, -1])[here["attractor"].values]
    np.testing.assert_array_equal(mapped, there["attractor"].values[::-1, ::-1])


def test_a_decoupled_mode_changes_no_label():
    plain = two_sided(0.8, 0.6, 0.5)
    stops = [stop.replace(direction=[float(stop.direction[0]), 0.0]) for stop in plain.stops]
    more = of(np.diag([1.0, 2.0]), np.diag([0.05, 0.3]), np.diag([1.0, 5.0]), 0.8, stops, {1: [1.0, 0.4]})
    y, v = np.linspace(-0.5, 0.5, 9), np.linspace(-1.0, 1.0, 8)
    alone = vi.basins(plain, displacement=y, velocity=v, phase=0.2)
    assert {"period-1_impact-4", "period-1_impact-2"} == set(names_of_starts(alone).ravel())
    begun = vi.State([0.0, 0.3], [0.0, -0.7], 0.2 * plain.period)
    beside = vi.basins(more, displacement_0=y, velocity_0=v, start=begun)
    np.testing.assert_array_equal(names_of_starts(alone), names_of_starts(beside))
    np.testing.assert_allclose(alone["max_velocity"], beside["max_velocity"], rtol=1e-12)


def test_permuted_coordinates_and_stops_change_no_label():
    swap = np.array([[0.0, 1.0], [1.0, 0.0]])
    turned = [stop.replace(direction=swap @ stop.direction) for stop in reversed(THREE.stops)]
    matrices = (swap @ matrix @ swap for matrix in (THREE.mass, THREE.damping, THREE.stiffness))
    permuted = of(*matrices, THREE.omega, turned, {1: [0.0, 1.0]})
    states = {"displacement_1": np.linspace(-0.2, 0.2, 7), "velocity_1": np.linspace(-2.0, 2.0, 7)}
    portrait = vi.basins(THREE, **states)
    there = vi.basins(permuted, **{name.replace("1", "0"): values for name, values in states.items()})
    np.testing.assert_array_equal(names_of_starts(portrait), names_of_starts(there))
    np.testing.assert_allclose(portrait["max_velocity"], there["max_velocity"], rtol=1e-12)


@pytest.mark.usefixtures("modal_engine")
@pytest.mark.parametrize(("omega", "gap", "restitution"), [(3.0, 0.0, 0.8), (1.45, 0.0, 0.8), (0.9, 0.3, 0.7)])
def test_one_coordinate_and_one_stop_have_the_basins_of_the_oscillator(omega, gap, restitution):
    osc = vi.ImpactOscillator(omega=omega, gap=gap, restitution=restitution)
    impacts = {"phase": np.linspace(0.0, 1.0, 15), "velocity": np.linspace(0.0, 3.0, 12)}
    states = {"displacement": np.linspace(gap - 2.0, gap, 9), "velocity": np.linspace(-1.0, 1.0, 8), "phase": 0.3}
    for plane in (impacts, states):
        portrait, as_system = vi.basins(osc, **plane), vi.basins(one_mass(osc), **plane)
        np.testing.assert_array_equal(names_of_starts(portrait), names_of_starts(as_system))
        np.testing.assert_array_equal(portrait["share"], as_system["share"])
        for name in ("max_velocity", "mean_velocity", "dissipation"):
            np.testing.assert_allclose(portrait[name], as_system[name], rtol=1e-6, atol=0)
        np.testing.assert_allclose(portrait["max_velocity"], as_system["max_velocity"], rtol=1e-9, atol=0)
    mine, theirs = vi.attractors(one_mass(osc)), vi.attractors(osc)
    assert [(one.name, one.share) for one in mine] == [(one.name, one.share) for one in theirs]


@pytest.mark.usefixtures("modal_engine")
def test_a_number_of_starts_are_impacts_that_attractors_are_looked_for_from():
    osc = vi.ImpactOscillator(omega=1.45, gap=0.2)
    how = {"indices": ("max_velocity",), "transient_impacts": 20, "sample_impacts": 60}
    sweep = vi.parameter_map(osc, start=9, gap=[0.1, 0.2], early_closing=False, **how)
    as_system = vi.parameter_map(one_mass(osc), start=9, stop_1_gap=[0.1, 0.2], **how)
    np.testing.assert_allclose(sweep["max_velocity"].values, as_system["max_velocity"].values, rtol=1e-9)
    several = vi.parameter_map(THREE, start=5, omega=[THREE.omega], **how)
    assert several.sizes["start"] == 5
    assert (
        "4 impacts at phases 0 to 1 and velocities 0 to 4 V, on all stops in turn" in several.attrs["initial_condition"]
    )


def test_two_free_masses_lead_where_their_relative_motion_does():
    (found,) = vi.attractors(free_pair())
    assert (found.name, found.share) == ("period-1 impact-2", 1.0)
    assert found.velocities == pytest.approx([4.014863874979368] * 2, rel=1e-12)
    pair = free_pair(0.9, mass=np.diag([1.0, 1.5]), force=vi.Force(omega=1.0, harmonics={1: [1.0, -0.5]}))
    both = [vi.attractors(model) for model in (pair, beside_its_centre(pair)[0])]
    seen, own = ([(one.name, one.share) for one in found] for found in both)
    assert seen == own
    hardest = [[one.max_velocity for one in found] for found in both]
    assert hardest[0] == pytest.approx(hardest[1], rel=1e-4)  # of chaos, over a sample
