"""The engine of systems against closed forms, the oscillator of one mass, identities and the witness."""

import json

import numpy as np
import pytest

import vibroimpact as vi
from systems import one_mass, two_masses
from vibroimpact import Status


def system(mass, damping, stiffness, omega, stops, force=None, constant=None):
    load = vi.Force(omega=omega, harmonics=force or {}, constant=constant)
    return vi.ImpactSystem(mass=mass, damping=damping, stiffness=stiffness, force=load, stops=stops)


def impacts(model, sample, transient=0, **how):
    return vi.impact_section(model, transient_impacts=transient, sample_impacts=sample, **how)


def outcome(model, sample=100, **how):
    return Status(int(impacts(model, sample, **how)["status"]))


# What the class allows is followed, and labelled.


def test_a_system_without_any_harmonic_starts_where_it_is_told():
    ball = system(1, 0, 0, 1.0, [vi.Stop(direction=1, gap=0.0, restitution=0.5)], constant=[2.0])
    hits = impacts(ball, 3, start=vi.State([-1.0], [0.0]))
    assert hits["velocity"].values == pytest.approx([2.0, 1.0, 0.5], rel=1e-14)
    assert hits["time"].values == pytest.approx([1.0, 2.0, 2.5], rel=1e-14)


def test_a_result_says_how_its_stops_move():
    made = json.loads(vi.simulate(two_masses(), periods=1).attrs["system"])
    assert made["stops"][0]["motion"] == {"1": [0.01, 0.0]}


# One coordinate and one stop are the oscillator.


@pytest.mark.parametrize(
    ("osc", "start"),
    [
        (
            vi.ImpactOscillator(mass=1.0, damping=0.11, stiffness=1.47, amplitude=0.63, omega=0.32, restitution=0.0),
            None,
        ),
        (vi.ImpactOscillator(amplitude=0.4, omega=0.8, gap=-1.0, restitution=0.6), vi.State(-1.5, 0.0)),
        (vi.ImpactOscillator(damping=0.34, amplitude=1.0, gap=1.1, omega=0.2), vi.State(1.0, 3.0)),
        (vi.ImpactOscillator(damping=0.4, stiffness=2.5, omega=1.1, restitution=0.03, gap=-0.4), vi.State(-1.0, 0.0)),
    ],
)
def test_sticks_and_status_are_those_between_the_first_and_the_last_impact(osc, start):
    there = start and vi.State([start.displacement], [start.velocity])
    for transient in (0, 2):
        own, other = impacts(osc, 15, transient, start=start), impacts(one_mass(osc), 15, transient, start=there)
        assert int(own["status"]) == int(other["status"])
        for name in ("stick_time", "release_time", "time", "velocity"):
            np.testing.assert_allclose(other[name].values, own[name].values, rtol=1e-12, err_msg=name)


def test_a_map_and_a_section_agree_on_a_stop_that_is_closed_before_and_after_the_window():
    pressed = vi.Stop(direction=[1, 0], gap=0.0, restitution=0.5, name="seat")
    struck = vi.Stop(direction=[0, 1], gap=0.2, restitution=0.7, name="bar")
    both = system(
        np.eye(2), 0.1 * np.eye(2), [[2, -0.1], [-0.1, 1]], 1.3, [pressed, struck], {1: [0, 1]}, constant=[5.0, 0.0]
    )
    assert outcome(both, 40, transient=10) == Status.STICKING
    found = vi.parameter_map(both, omega=[1.3], transient_impacts=10, sample_impacts=40)
    assert Status(int(found["status"].values[0])) == Status.STICKING
