"""Indices of displacements and forces: against closed forms, orbits, and motions in time of random designs."""

import math

import numpy as np
import pytest

import vibroimpact as vi
from compliant import bilinear
from systems import a_random_machine, two_masses
from vibroimpact.indices import DISPLACEMENTS, RESPONSES

OF_FORCE = "rms_force"


def measured(model, names=DISPLACEMENTS, **how):
    """Return indices of the motion from rest."""
    omega = model.values["omega"] if "omega" in model.parameters else None
    axis = {"omega": [omega]} if omega else {"frequency": [model.values["frequency"]]}
    how = {"sample_impacts": 400, "workers": 1} | how
    return vi.parameter_map(model, indices=names, **axis, **how).isel({next(iter(axis)): 0})


def in_time(model, along, periods, start):
    """Return the same from a motion that is sampled densely, by the trapezoidal rule."""
    motion = vi.simulate(model, start=start, periods=periods, samples_per_period=20_000)
    time, y = motion["time"].values, motion["displacement"].values.reshape(len(motion["time"]), -1) @ along

    def mean(values):
        return np.trapezoid(values, time) / (time[-1] - time[0])

    phasor = 2j * mean(y * np.exp(-1j * model.omega * time))
    peaks = np.abs(np.diff(y)).max()  # an impact between two samples is a peak that neither shows
    return peaks, 0.5 * np.ptp(y), math.sqrt(mean(y**2)), mean(y), abs(phasor), np.angle(phasor)


def close(found, peaks, amplitude, rms, mean, first, phase):
    """Return whether indices agree, the phase where there is a first harmonic."""
    *lengths, angle = (float(found[name]) for name in DISPLACEMENTS)
    turned = abs(np.exp(1j * angle) - np.exp(1j * phase)) * first
    off = np.abs(np.array([*lengths, turned]) - [amplitude, rms, mean, first, 0.0])
    return (off < 3e-6 * (amplitude + abs(mean)) + np.array([peaks, 0.0, 0.0, 0.0, 0.0])).all()


@pytest.mark.parametrize("seed", range(30))
def test_over_a_cycle_of_a_random_machine_they_are_those_of_its_motion_in_time(seed):
    rng = np.random.default_rng([17, seed])
    while True:
        model = a_random_machine(rng)
        if model.modal().neutral.any():  # where a free centre comes to rest depends on how all began
            continue
        found = measured(model, ["n_periods"], transient_impacts=2000)
        if found["n_periods"] > 0 or found["status"] == vi.Status.NO_IMPACT:
            break
    n = max(int(found["n_periods"]), 1)
    section = vi.stroboscopic_section(model, transient_periods=20_000, sample_periods=1)
    place, speed = (section[name].values[-1] for name in ("displacement", "velocity"))
    along = rng.normal(size=model.coordinates)
    wanted = in_time(model, along, n, vi.State(place, speed, 0.0))
    found = measured(model, of=along, transient_impacts=2000)
    assert close(found, *wanted)


@pytest.mark.parametrize("omega", [1.2, 1.4, 2.0, 3.3])
def test_of_one_mass_they_are_those_of_its_orbit_whichever_way_it_is_written(omega):
    osc = vi.ImpactOscillator(omega=omega)
    found = measured(osc)
    for other in (osc.system, vi.family(lambda omega=omega: osc.replace(omega=omega))):
        assert all(float(measured(other)[name]) == float(found[name]) for name in DISPLACEMENTS)
    (orbit,) = vi.find_orbit(osc, near=vi.impact_section(osc))
    wanted = vi.response_of(orbit)
    assert np.allclose([float(found[name]) for name in DISPLACEMENTS], wanted, rtol=1e-9)


def test_without_contact_they_are_those_of_the_linear_oscillator():
    omega = np.array([0.5, 0.9, 1.0, 1.7, 6.0])
    osc = vi.ImpactOscillator(gap=1e3, damping=0.05)
    found = vi.parameter_map(osc, omega=omega, indices=DISPLACEMENTS)
    force = osc.amplitude / (osc.stiffness - osc.mass * omega**2 + 1j * omega * osc.damping)
    assert (found["status"] == vi.Status.NO_IMPACT).all()
    assert np.allclose(found["amplitude"], abs(force), rtol=1e-12)
    assert np.allclose(found["rms"], abs(force) / math.sqrt(2.0), rtol=1e-12)
    assert np.allclose(found["mean"], 0.0, atol=1e-12 * abs(force))
    assert np.allclose(found["harmonic_amplitude"], abs(force), rtol=1e-12)
    assert np.allclose(found["harmonic_phase"], np.angle(force), atol=1e-12)


def test_without_contact_they_are_those_of_a_linear_system_under_a_constant_load_too():
    mass, stiffness = np.diag([1.0, 0.4]), np.array([[3.0, -1.0], [-1.0, 1.5]])
    damping, constant = 0.03 * stiffness, np.array([0.2, -0.5])
    load, along = np.array([1.0, 0.5 - 0.3j]), np.array([1.0, -0.7])
    far = vi.Stop(direction=[0.0, 1.0], gap=1e3, restitution=0.5)
    found = [
        measured(
            vi.ImpactSystem(
                mass=mass,
                damping=damping,
                stiffness=stiffness,
                stops=[far],
                force=vi.Force(omega=omega, harmonics={1: load}, constant=constant),
            ),
            of=along,
        )
        for omega in (0.7, 1.6, 4.0)
    ]
    for omega, cell in zip((0.7, 1.6, 4.0), found, strict=True):
        wave = along @ np.linalg.solve(stiffness - omega**2 * mass + 1j * omega * damping, load)
        mean = along @ np.linalg.solve(stiffness, constant)
        wanted = abs(wave), math.sqrt(mean**2 + abs(wave) ** 2 / 2.0), mean, abs(wave), np.angle(wave)
        assert cell["status"] == vi.Status.NO_IMPACT
        assert np.allclose([float(cell[name]) for name in DISPLACEMENTS], wanted, rtol=1e-12)


def test_the_clearance_of_a_stop_that_moves_is_never_negative_and_closes():
    model = two_masses()
    name = next(stop.name for stop in model.stops if stop.motion)
    number = model.stop_names.index(name)
    found = measured(model, ["max_velocity", "amplitude", "mean", "rms"], of=name)
    motion, stop = vi.simulate(model, periods=3000, samples_per_period=60), model.stops[number]
    late = motion["time"].values > motion["time"].values[-1] - 200 * model.period
    time, q = motion["time"].values[late], motion["displacement"].values[late]
    waves = [(part * np.exp(1j * order * model.omega * time)).imag for order, part in stop.motion.items()]
    u = stop.gap + np.sum(waves, axis=0) - q @ stop.direction
    assert u.min() > -1e-9
    assert float(found["mean"]) == pytest.approx(u.mean(), rel=0.05)
    assert float(found["rms"]) == pytest.approx(math.sqrt((u**2).mean()), rel=0.05)


def test_a_motion_that_does_not_repeat_is_estimated():
    osc = vi.ImpactOscillator(omega=2.8)
    found = measured(osc, [*DISPLACEMENTS, "n_periods", "lyapunov"])
    assert found["n_periods"] == 0
    assert found["lyapunov"] > 0.0
    motion = vi.simulate(osc, periods=5000, samples_per_period=40)
    y = motion["displacement"].values[40_000:]
    assert float(found["rms"]) == pytest.approx(math.sqrt((y**2).mean()), rel=0.1)
    assert float(found["mean"]) == pytest.approx(y.mean(), rel=0.1)
    assert 0.7 * 0.5 * np.ptp(y) < found["amplitude"] <= 0.5 * np.ptp(y) * (1.0 + 1e-3)


def test_the_rms_force_is_that_of_the_spring_that_is_pressed_in():
    model = bilinear(40.0, 0.0, gap=0.3, omega=1.3)
    found = measured(model, [OF_FORCE, "max_force", "n_periods"])
    section = vi.stroboscopic_section(model, transient_periods=3000, sample_periods=1)
    start = vi.State(section["displacement"].values[-1], section["velocity"].values[-1], 0.0)
    motion = vi.simulate(model, start=start, periods=int(found["n_periods"]), samples_per_period=20_000)
    force = 40.0 * np.maximum(motion["displacement"].values.ravel() - 0.3, 0.0)
    rms = math.sqrt(np.trapezoid(force**2, motion["time"]) / float(motion["time"][-1] - motion["time"][0]))
    assert float(found[OF_FORCE]) == pytest.approx(rms, rel=1e-6)
    by_stop = measured(model, [OF_FORCE], by_stop=True)[OF_FORCE]
    assert by_stop.sizes == {"stop": 1}
    assert float(by_stop[0]) == float(found[OF_FORCE])


def test_a_cell_is_the_same_to_the_bit_on_every_grid_and_in_every_number_of_threads():
    model, omega = vi.models.impact_damper(), np.linspace(9.0, 16.0, 70)
    whole = vi.parameter_map(model, omega=omega, indices=RESPONSES, of=0, sample_impacts=200)
    few = vi.parameter_map(model, omega=omega[::9], indices=RESPONSES, of=0, sample_impacts=200, workers=1)
    for name in RESPONSES:
        assert np.array_equal(whole[name][::9], few[name], equal_nan=True)


def test_a_diagram_a_store_and_a_refined_map_hold_them(tmp_path):
    osc = vi.ImpactOscillator()
    how = {"indices": ["rms", "std"], "sample_impacts": 200}
    omega, mass = np.linspace(1.0, 3.0, 4), [1.0, 1.5]
    plain = vi.parameter_map(osc, omega=omega, mass=mass, **how)
    refined = vi.refined_map(osc, omega=omega, mass=mass, refine=1, **how)
    assert np.allclose(refined["rms"][::2, ::2], plain["rms"], rtol=1e-9)
    diagram = vi.bifurcation_diagram(osc, omega=omega, **how)
    assert np.array_equal(diagram["rms"], plain["rms"][:, 0])
    system = two_masses()
    vi.parameter_map(system, omega=[7.0, 8.0], store=tmp_path / "of.zarr", of=0, **how)
    with pytest.raises(ValueError, match="`of`|of "):
        vi.parameter_map(system, omega=[7.0, 8.0], store=tmp_path / "of.zarr", of=1, **how)


def test_what_they_are_of_is_said_and_asked_for():
    model = two_masses()
    mapped = vi.parameter_map(model, omega=[8.0], indices=["rms"], of=1, sample_impacts=50)
    assert mapped["rms"].attrs["long_name"] == "rms displacement of coordinate 1"
    every = vi.parameter_map(model, omega=[8.0], indices="all", sample_impacts=50)
    assert "name it by `of`" in every["amplitude"].attrs["no_value"]
    assert "compliant" in every[OF_FORCE].attrs["no_value"]
    for how, said in (
        ({"indices": ["rms"]}, "`of` must say what is observed: bar, baffle, or the number of a coordinate, 0 to 1"),
        ({"indices": ["std"], "of": 0}, "`of` is for the indices amplitude"),
        ({"indices": ["rms"], "of": "tip"}, "unknown point or stop 'tip'"),
        (
            {"indices": ["rms"], "of": 2},
            "of bar, baffle, or the number of a coordinate, 0 to 1, got 2",
        ),
        ({"indices": [OF_FORCE]}, "needs a compliant stop"),
        ({"indices": [OF_FORCE, "rms"], "of": "left"}, "unknown point or stop 'left'"),
        ({"indices": ["rms"], "of": 0, "backend": "reference"}, "reference"),
    ):
        with pytest.raises(ValueError, match=said):
            vi.parameter_map(model, omega=[8.0], sample_impacts=50, **how)


def test_an_axis_and_an_index_of_one_name_are_told_apart():
    osc = vi.ImpactOscillator(omega=2.2)
    with pytest.raises(ValueError, match="vary the axis under another name"):
        vi.parameter_map(osc, amplitude=[1.0, 2.0], indices=["amplitude"])
    with pytest.raises(ValueError, match="vary the axis under another name"):
        vi.response_curve(osc, amplitude=(1.0, 2.0))
    assert vi.parameter_map(osc, amplitude=[1.0, 2.0], indices=["rms"], sample_impacts=50)["rms"].sizes
    loaded = vi.family(lambda load=1.0: osc.replace(amplitude=load))
    swings = vi.parameter_map(loaded, load=[1.0, 2.0], indices=["amplitude"], sample_impacts=50)["amplitude"]
    assert float(swings[1]) == pytest.approx(2.0 * float(swings[0]), rel=1e-9)


def test_a_cell_of_a_stopped_map_has_its_indices_or_is_interrupted():
    omega = np.linspace(2.7, 2.9, 50_000)  # chaos: seconds of work, stopped at the first word of progress
    mapped = vi.parameter_map(
        vi.ImpactOscillator(), omega=omega, indices=["rms"], sample_impacts=500, progress=lambda *_: False
    )
    done = mapped["status"] != vi.Status.INTERRUPTED
    assert 0 < done.sum() < len(omega)
    assert mapped["rms"].notnull().equals(done.rename("rms"))


def test_without_a_driving_frequency_there_is_no_harmonic():
    ground = vi.Stop(direction=-1.0, gap=1.0, restitution=0.9, name="ground")
    ball = vi.ImpactSystem(mass=1.0, damping=0.1, stiffness=1.0, force=vi.Force(constant=-2.0), stops=[ground])
    mapped = vi.parameter_map(ball, ground_gap=[0.5, 1.0], indices=["mean", "harmonic_phase"], sample_impacts=20)
    assert "no frequency" in mapped["harmonic_phase"].attrs["no_value"]
    assert mapped["mean"].values == pytest.approx([-0.5, -1.0])


@pytest.mark.parametrize("at_rest", [False, True])
def test_a_motion_without_a_part_at_the_driving_frequency_has_no_phase(at_rest):
    double = vi.Force(omega=1.3, harmonics={2: 1.0})
    stop = vi.Stop(direction=1.0, gap=5.0)
    faster = vi.ImpactSystem(mass=1.0, damping=0.1, stiffness=1.0, force=double, stops=[stop])
    model = vi.ImpactOscillator(amplitude=0.0, damping=0.1, gap=5.0) if at_rest else faster
    found = vi.parameter_map(model, omega=[1.2, 1.3], indices=["amplitude", "harmonic_amplitude", "harmonic_phase"])
    assert (found["amplitude"] > 0.0).values.all() != at_rest
    assert np.allclose(found["harmonic_amplitude"], 0.0, atol=1e-15)
    assert found["harmonic_phase"].isnull().all()


ELASTIC = vi.ImpactSystem(  # of many impacts a cycle, two stops of which are elastic and one pushes for long
    mass=np.diag([1.0314554300988048, 0.6146938679442339, 1.1791572105333175]),
    damping=[
        [0.034695114309397146, -0.025719622652422124, 0.0],
        [-0.025719622652422124, 0.035904682069785435, -0.008462221184162113],
        [0.0, -0.008462221184162113, 0.011767113637466964],
    ],
    stiffness=[
        [3.404238909848441, -2.7529620643908554, 0.0],
        [-2.7529620643908554, 3.658736391460505, -0.9057743270696494],
        [0.0, -0.9057743270696494, 0.9057743270696494],
    ],
    force=vi.Force(
        omega=0.44957033681717984,
        harmonics={
            1: [
                -0.6359636610079458 - 0.6740418489403783j,
                2.2083628035464247 - 0.1702203253176801j,
                0.05063893013064943 - 0.07337116303241593j,
            ],
            2: [
                0.24281990070041953 + 0.20930035595374485j,
                0.5230215757017309 + 0.46400445047212957j,
                -0.24187221606547596 - 0.09367643571198442j,
            ],
            3: [
                0.5698760134135166 + 0.19310630872685536j,
                -0.051658442445530646 + 0.7758860298696405j,
                -0.537917796778238 - 1.0532948187684237j,
            ],
        },
    ),
    stops=[
        vi.Stop(direction=[0.0, 0.0, -1.0], gap=0.0, restitution=1.0),
        vi.Stop(direction=[1.0, -1.0, 0.0], gap=0.05724029375500108, restitution=1.0),
        vi.Stop(direction=[0.0, 1.0, 0.0], gap=0.0, stiffness=2.2413301443441562, damping=0.8441368306267248),
    ],
)
ON_ITS_CYCLE = vi.State(
    (-0.09520470825058758, -0.05260005791235921, 2.9899669880298254),
    (-0.660948467309804, -0.6734953631293722, 1.902553599174881),
    10.94784973018693,
)


def test_a_driving_period_of_which_rounding_leaves_a_rest_is_over():
    """Else the next step has no length, as at a stop that is touched."""
    found = [
        measured(ELASTIC, ["rms", "amplitude"], of=1, start=ON_ITS_CYCLE, transient_impacts=skipped, sample_impacts=1)
        for skipped in (0, 1, 2, 5, 12)
    ]
    _, amplitude, rms, *_ = in_time(ELASTIC, np.array([0.0, 1.0, 0.0]), 4, ON_ITS_CYCLE)
    for each in found:
        assert float(each["rms"]) == pytest.approx(rms, rel=1e-5)
        assert float(each["amplitude"]) == pytest.approx(amplitude, rel=1e-5)
