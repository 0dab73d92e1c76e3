"""The engine in front of compliant stops: closed forms, balances of energy and momentum, limits and hard cases."""

import math
from contextlib import nullcontext

import numpy as np
import pytest

import vibroimpact as vi
from systems import linear
from vibroimpact.backends.modal import rows
from vibroimpact.model.elements import BLOCKS, Block
from witness import follow

FEW = {"transient_impacts": 0, "sample_impacts": 8}


def oscillator(*stops, mass=1.0, stiffness=1.0, damping=0.1, omega=1.3, force=1.0, constant=None):
    load = vi.Force(omega=omega, harmonics={1: force}, constant=constant)
    return vi.ImpactSystem(mass=mass, stiffness=stiffness, damping=damping, force=load, stops=stops)


def spring(k, c=0.0, gap=0.3, direction=1.0, **more):
    return vi.Stop(direction=direction, gap=gap, stiffness=k, damping=c, **more)


def section(system, **how):
    return vi.impact_section(system, **(FEW | how))


# Columns of a table that the kernels have none for: one with a number in it, one without.
@pytest.mark.parametrize(("column", "refused"), [("fastest", True), ("time", False)])
def test_a_stop_with_a_number_that_the_kernels_do_not_know_is_refused(monkeypatch, column, refused):
    monkeypatch.setattr(rows, "BLOCKS", BLOCKS | {"bond": Block(column)})
    system, says = oscillator(spring(60.0, 0.8)), "a stop has a `bond`, for which .* no contact law; make it rigid"
    for run in (section, vi.simulate, lambda one: vi.parameter_map(one, omega=[1.3], indices=["std"], **FEW)):
        with pytest.raises(ValueError, match=says) if refused else nullcontext():
            run(system)


def test_unforced_motion_loses_what_dampers_and_stops_take():
    k, g = 1.7, 0.4
    stops = spring(60.0, 0.8, g), spring(30.0, 0.0, g, -1.0)
    system = oscillator(*stops, stiffness=k, damping=0.03, force=0.0, constant=0.2)
    how = {"start": vi.State(0.0, 20.0), "transient_impacts": 2, "sample_impacts": 31}
    hits, names = section(system, **how), ["work_rate", "damper_rate"]
    index = vi.parameter_map(system, omega=[1.3], indices=names, **how).isel(omega=0)
    first, last = (float(hits["velocity"][at]) for at in (0, -1))
    assert hits["stop"].values[0] == hits["stop"].values[-1]  # the same displacement
    span = float(hits["time"][-1] - hits["time"][0])
    lost = 0.5 * (first**2 - last**2)
    assert float(index["work_rate"] + index["damper_rate"]) * span == pytest.approx(lost, rel=1e-12)
    assert float(index["work_rate"]) * span == pytest.approx(float(hits["energy_lost"][:-1].sum()), rel=1e-12)


@pytest.mark.parametrize("omega", [0.9, 1.1, 1.9, 2.4])
def test_over_a_cycle_the_force_works_as_much_as_stops_and_dampers_take(omega):
    stops = spring(50.0, 0.9, 0.3, name="a"), spring(20.0, 0.4, 0.5, -1.0, name="b")
    system = oscillator(*stops, damping=0.2, omega=omega)
    names = ["n_periods", "n_impacts", "work_rate", "damper_rate", "mean_force", "dissipation"]
    how = {"indices": names, "transient_impacts": 3000, "sample_impacts": 1 + 2 * 3 * 4 * 5 * 7}
    index = vi.parameter_map(system, omega=[omega], **how).isel(omega=0)
    cycle = int(index["n_periods"])
    assert cycle > 0
    assert 840 % int(index["n_impacts"]) == 0
    start = settled(system, 500)
    motion = vi.simulate(system, start=start, periods=cycle, samples_per_period=2**14)
    place, turn = motion["displacement"].values[:-1, 0], omega * motion["time"].values[:-1]
    assert abs(motion["displacement"].values[-1, 0] - place[0]) < 1e-12
    # Of a periodic displacement whose second derivative jumps a mean of samples is right to their spacing cubed.
    power = -omega * np.mean(np.cos(turn) * place)
    assert float(index["work_rate"] + index["damper_rate"]) == pytest.approx(power, rel=1e-10)
    assert float(index["dissipation"]) == pytest.approx(float(index["work_rate"]) * system.period, rel=1e-14)
    # Momentum: what the stops push on average is what the spring pulls on average.
    each = vi.parameter_map(system, omega=[omega], by_stop=True, **(how | {"indices": ["mean_force"]}))
    forces = each["mean_force"].isel(omega=0).values
    assert forces.sum() == pytest.approx(float(index["mean_force"]), rel=1e-13)
    assert forces[0] - forces[1] == pytest.approx(-np.mean(place), abs=1e-9 * forces.max())


def settled(system, periods):
    motion = vi.simulate(system, periods=periods, samples_per_period=1)
    return vi.State(motion["displacement"].values[-1].tolist(), motion["velocity"].values[-1].tolist())


def test_the_force_of_a_rigid_stop_that_is_held_counts():
    """A mass at rest between sticks: the mean force is what load and spring leave, sticks and impacts together."""
    stop = vi.Stop(direction=1.0, gap=0.1, restitution=0.0, name="wall")
    system = oscillator(stop, damping=0.2, omega=0.4)
    how = {"indices": ["mean_force", "n_periods"], "transient_impacts": 500, "sample_impacts": 401}
    index = vi.parameter_map(system, omega=[0.4], **how).isel(omega=0)
    motion = vi.simulate(system, start=settled(system, 100), periods=int(index["n_periods"]), samples_per_period=2**15)
    assert motion.sizes["stick"] > 0
    mean = np.mean(motion["displacement"].values[:-1, 0])
    assert float(index["mean_force"]) == pytest.approx(-mean, rel=1e-7)


@pytest.mark.parametrize(("gap", "names"), [(0.3, {"wall"}), (0.2, {"wall", "soft"}), (0.4, {"wall"})])
@pytest.mark.parametrize("first", [0, 1])
def test_a_spring_at_or_behind_a_rigid_stop_is_never_pushed(gap, names, first):
    stops = [vi.Stop(direction=1.0, gap=0.3, restitution=0.7, name="wall"), spring(5.0, 0.1, gap, name="soft")]
    hits = section(oscillator(*stops[:: -1 if first else 1]), sample_impacts=60)
    assert set(hits["stop"].values.tolist()) == names
    assert np.nanmax(hits["penetration"].values, initial=0.0) <= 0.1 + 1e-12


def test_a_start_inside_is_pushed_out_and_counted_by_no_impact():
    system = oscillator(spring(50.0, 1.0, 0.0), stiffness=1.0, force=0.0)
    motion = vi.simulate(system, start=vi.State(0.5, 0.0), periods=1)
    assert motion["force"].values[0, 0] == pytest.approx(25.0, rel=1e-14)
    assert motion["displacement"].values.min() < 0.0


def test_a_graze_of_a_spring_changes_nothing():
    """Undriven and undamped, from rest at -g: the mass turns exactly at the stop."""
    system = oscillator(spring(1000.0, 3.0, 0.5), damping=0.0, force=0.0, omega=1.0)
    motion = vi.simulate(system, start=vi.State(-0.5, 0.0), periods=10.0)
    np.testing.assert_allclose(motion["displacement"][:, 0], -0.5 * np.cos(motion["time"]), atol=1e-12)


@pytest.mark.parametrize("damper", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("stiffness", [100.0, 1e4])
def test_a_contact_of_one_mass_takes_a_leap_and_few_steps(damper, stiffness):
    stop = vi.Stop(direction=1, gap=0.2, stiffness=stiffness, damping=damper)
    mass = vi.ImpactSystem(
        mass=1.0, damping=0.05, stiffness=1.0, force=vi.Force(omega=2.0, harmonics={1: 1.0}), stops=[stop]
    )
    sweep = vi.parameter_map(mass, omega=np.linspace(0.5, 3.0, 16), early_closing=False, sample_impacts=300)
    assert sweep.attrs["steps_computed"] < 3.5 * sweep.attrs["impacts_computed"]


def free(**stop):
    """Return a mass of 1 that nothing but its stops holds."""
    return oscillator(spring(100.0, gap=0.0), *stop.values(), stiffness=0.0, damping=0.0, force=0.0, omega=1.0)


def test_a_mass_that_begins_at_a_stop_with_a_speed_strikes_it_at_once():
    hits = section(free(), start=vi.State(0.0, 1.0))
    assert hits["velocity"].values.tolist() == [1.0]
    assert hits["time"].values.tolist() == [0.0]
    assert float(hits["contact_time"][0]) == pytest.approx(math.pi / 10.0, rel=1e-14)
    assert float(hits["impulse"][0]) == pytest.approx(2.0, rel=1e-14)
    assert vi.Status(int(hits["status"])) == vi.Status.STOPPED_IMPACTING  # it leaves at -1, for good
    witness = follow(linear(free()), [0.0], [1.0], impacts=1)
    assert [(event.time, event.velocity) for event in witness.impacts] == [(0.0, 1.0)]
    assert witness.end.velocity == pytest.approx([-1.0], rel=1e-12)


def test_an_impact_at_the_start_counts_in_maps_as_in_sections():
    """Between two compliant stops, the first impact of every second is known only if that at the start is."""
    box, start = free(back=spring(100.0, gap=2.0, direction=-1.0)), vi.State(0.0, 1.0)
    how = {"start": start, "transient_impacts": 0, "sample_impacts": 2}
    names = ["mean_velocity", "dissipation", "impacts_per_period"]
    cell = vi.parameter_map(box, omega=[1.0], indices=names, **how)
    hits = section(box, **how)
    assert hits["stop"].values.tolist() == ["stop_1", "stop_2"]
    between = math.pi / 10.0 + 2.0
    assert float(hits["time"][1]) == pytest.approx(between, rel=1e-14)
    assert float(cell["impacts_per_period"][0]) == pytest.approx(2.0 * math.pi / between, rel=1e-14)


def test_a_motion_is_returned_although_its_last_contact_never_ends():
    spread, load = np.array([[2.0, -1.0], [-1.0, 1.0]]), vi.Force(omega=1.3, harmonics={1: [0.1, 0.1]})
    stop = spring(50.0, 0.5, -2.0, [1.0, 0.0])
    system = vi.ImpactSystem(mass=np.eye(2), damping=0.05 * spread, stiffness=spread, force=load, stops=[stop])
    number = section(system, sample_impacts=1000).sizes["impact"]
    hits = section(system, sample_impacts=number)
    assert hits.sizes["impact"] == number > 10
    assert np.isnan(hits["contact_time"].values).tolist() == [False] * (number - 1) + [True]
