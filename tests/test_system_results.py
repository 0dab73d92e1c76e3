"""What a user does with motions of systems: diagrams, files, stores and pictures."""

import numpy as np
import pytest

import vibroimpact as vi
from systems import one_mass, two_masses
from vibroimpact.report import sentences_of

OSC = vi.ImpactOscillator(damping=0.1, restitution=0.5, gap=0.5)
SHORT = {"transient_impacts": 20, "sample_impacts": 30}
GAPS = [0.02, 0.04, 0.06]


# Diagrams


@pytest.mark.parametrize("direction", ["fresh", "up", "down"])
@pytest.mark.parametrize("section", ["impact", "stroboscopic"])
def test_the_diagram_of_one_coordinate_is_that_of_the_oscillator(section, direction):
    how = {"section": section, "direction": direction, "omega": [1.5, 1.6, 1.7], "sample_impacts": 5}
    how |= {"transient_impacts": 300, "transient_periods": 100, "sample_periods": 5}
    one, system = (vi.bifurcation_diagram(model, **how) for model in (OSC, one_mass(OSC)))
    for name in one.data_vars:
        if name != "status":
            np.testing.assert_allclose(system[name], one[name], rtol=1e-9, atol=1e-11)


def test_a_fresh_diagram_holds_the_sections_of_its_values():
    found = vi.bifurcation_diagram(two_masses(), bar_gap=GAPS, **SHORT)
    names = np.array(found["stop"].attrs["flag_meanings"].split())
    for gap in GAPS:
        hits, column = vi.impact_section(two_masses().replace(bar_gap=gap), **SHORT), found.sel(bar_gap=gap)
        assert np.array_equal(column["velocity"], hits["velocity"])
        assert np.array_equal(column["phase"], hits["phase"])
        assert (names[column["stop"].values + 1] == hits["stop"].values).all()


def test_a_stroboscopic_diagram_gives_the_coordinate_asked_for():
    how = {"transient_periods": 20, "sample_periods": 9}
    found = vi.bifurcation_diagram(two_masses(), section="stroboscopic", coordinate=1, bar_gap=GAPS, **how)
    looks = vi.stroboscopic_section(two_masses().replace(bar_gap=GAPS[1]), **how)
    for name in ("displacement", "velocity"):
        assert np.array_equal(found[name][1], looks[name].isel(coordinate=1))


def test_a_motion_carried_to_the_same_value_goes_on():
    """The next value of an axis that changes nothing starts where the one before ended."""
    whole = vi.impact_section(two_masses(), transient_impacts=0, sample_impacts=12)

    @vi.family
    def unchanged(nothing=0.0):
        return two_masses()

    found = vi.bifurcation_diagram(unchanged, direction="up", nothing=[0, 1, 2], transient_impacts=0, sample_impacts=4)
    for name in ("velocity", "phase"):
        np.testing.assert_allclose(found[name].values.ravel(), whole[name], rtol=1e-9)


def test_a_motion_carried_into_stops_starts_before_them():
    wide, narrow = 0.06, -0.019  # the slot is almost closed
    found = vi.bifurcation_diagram(two_masses(), direction="down", bar_gap=[narrow, wide], **SHORT)
    assert (found["count"] == 30).all()


def test_a_motion_is_carried_to_every_kind_of_end():
    """A free mass that drifts away ends its window early; what follows it is computed."""
    drifting = vi.ImpactSystem(
        mass=1.0, stiffness=0.0, force=vi.Force(omega=1.0, harmonics={1: 1.0}), stops=[vi.Stop(direction=-1, gap=0.1)]
    )
    found = vi.bifurcation_diagram(drifting, direction="up", stop_1_gap=[0.1, 0.2], sample_impacts=5)
    assert [vi.Status(int(code)).has_indices for code in found["status"]] == [False, False]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"coordinate": 2}, "`coordinate` must be less than the number of coordinates, 2, got 2"),
        ({"coordinate": -1}, "`coordinate` must be a whole number >= 0"),
        ({"indices": ["lyapunov"]}, "`indices` of systems must be of std"),
        ({"backend": "reference"}, "`backend` 'reference' does not take systems"),
    ],
)
def test_a_diagram_refuses_what_systems_have_not(more, words):
    with pytest.raises(ValueError, match=words):
        vi.bifurcation_diagram(two_masses(), bar_gap=GAPS, **SHORT, **more)


def test_a_diagram_of_a_system_is_summed_up_in_words():
    found = vi.bifurcation_diagram(vi.family(vi.models.impact_damper), frequency=[29.0, 30.0], **SHORT)
    assert sentences_of(found)[0].startswith("2 values of driving frequency 29 to 30 Hz, each from rest at q = 0")
