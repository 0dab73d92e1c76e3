"""Orbits of systems by the name of their cycle."""

import pytest

import vibroimpact as vi


def two_sided(**changes):
    given = {"above": 0.5, "below": 0.5, "omega": 2.0} | changes
    stops = [
        vi.Stop(direction=1, gap=given["above"], restitution=0.6, name="above"),
        vi.Stop(direction=-1, gap=given["below"], restitution=0.6, name="below"),
    ]
    force = vi.Force(omega=given["omega"], harmonics={1: 1.0})
    return vi.ImpactSystem(mass=1.0, damping=0.05, stiffness=1.0, force=force, stops=stops)


def test_the_symmetric_motion_is_found_by_its_name_with_its_closed_form():
    found = vi.find_orbit(two_sided(), n_impacts=2)
    assert found.outcome == "found"
    orbit = found[0]
    assert orbit.stable
    assert orbit.stops == ("above", "below")
    assert orbit.velocities == pytest.approx([1.01091975000998629752895] * 2, rel=1e-13)


def test_the_motion_from_rest_gives_the_orbit_that_it_settles_to():
    system = two_sided(below=0.3)
    orbit = vi.find_orbit(system, n_impacts=2)[0]
    hits = vi.impact_section(system, transient_impacts=2000, sample_impacts=2)
    assert orbit.stable
    assert sorted(orbit.velocities) == pytest.approx(sorted(hits.velocity.values), rel=1e-12)
    assert set(orbit.stops) == {"above", "below"}


def test_an_orbit_of_another_system_is_a_guess():
    orbit = vi.find_orbit(two_sided(below=0.3), n_impacts=2)[0]
    near = vi.find_orbit(two_sided(below=0.31), n_impacts=2, near=orbit)
    assert [found.stable for found in near] == [True]
    assert near[0].velocities == pytest.approx(orbit.velocities, rel=0.1)
    assert near[0].velocities != orbit.velocities


def test_orbits_that_are_not_there_are_not_found():
    found = vi.find_orbit(two_sided(), n_impacts=4)
    assert not found
    assert "does not settle to a period-1 impact-4 orbit" in found.message


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"n_impacts": 2, "near": (0.1, 2.0)}, "an orbit of a system"),
        ({"n_impacts": 0}, "n_impacts"),
    ],
)
def test_what_cannot_be_searched_for_is_refused(how, words):
    with pytest.raises(ValueError, match=words):
        vi.find_orbit(two_sided(), **how)


def test_a_family_of_systems_has_the_orbits_of_its_values():
    @vi.family
    def slot(width=1.0):
        return two_sided(above=width / 2, below=width / 2)

    assert vi.find_orbit(slot, n_impacts=2)[0].velocities == vi.find_orbit(two_sided(), n_impacts=2)[0].velocities


def test_a_beam_can_move_along_the_orbit_that_it_settles_to_although_rounding_leaves_its_clearance_below_zero():
    beam = vi.models.cantilever_with_stop()
    (orbit,) = (one for one in vi.find_orbit(beam, n_impacts=3) if one.stable)
    hits = vi.impact_section(beam, transient_impacts=2000, sample_impacts=3)
    assert sorted(orbit.velocities) == pytest.approx(sorted(hits["velocity"].values), rel=1e-9)
    assert orbit.admissible, orbit.message
