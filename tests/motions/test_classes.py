"""Classes of motion: what the rule says of known cells, and that exponents and cycles tell one story."""

import math

import numpy as np
import pytest
import xarray as xr

import vibroimpact as vi
from vibroimpact.dataset import provenance, status_variable, variable
from vibroimpact.motion import CERTAIN_GROWTH, MotionClass

OSC = vi.ImpactOscillator()
CYCLES = ("lyapunov_per_impact", "n_periods", "n_impacts")
SPREAD = np.linspace(0.06, 5.0, 120)


def motion_at(osc=OSC, **settings):
    cell = vi.classify(vi.parameter_map(osc, omega=[osc.omega], **({"indices": CYCLES} | settings))).isel(omega=0)
    return MotionClass(int(cell["motion"])), int(cell["n_periods"]), int(cell["n_impacts"])


def cells(per_impact, n_periods, n_impacts, status, sample_impacts=1000):
    """Return a sweep that tells this of its cells."""
    indices = {"lyapunov_per_impact": per_impact, "n_periods": n_periods, "n_impacts": n_impacts}
    axis = np.arange(1.0, len(status) + 1.0)
    return xr.Dataset(
        {name: variable(name, "omega", data) for name, data in indices.items()}
        | {"status": status_variable("omega", status)},
        coords={"omega": variable("omega", "omega", axis)},
        attrs=provenance("parameter_map", OSC, {"sample_impacts": sample_impacts}),
    )


@pytest.fixture(scope="module")
def spread():
    indices = (*CYCLES, "lyapunov", "impacts_per_period")
    return vi.parameter_map(OSC, omega=SPREAD, start=vi.State(-1.0), indices=indices)


@pytest.mark.parametrize(
    ("changes", "known"),
    [
        ({"omega": 0.1}, (MotionClass.STICKING, 1, -1)),
        ({"omega": 0.95}, (MotionClass.PERIODIC, 1, 2)),
        ({"omega": 2.0}, (MotionClass.PERIODIC, 1, 1)),
        ({"omega": 2.8}, (MotionClass.CHAOTIC, 0, 0)),
        ({"omega": 0.4, "restitution": 0.0}, (MotionClass.STICKING, 1, 2)),
        ({"gap": 50.0}, (MotionClass.NO_IMPACT, 0, 0)),  # out of reach
        ({"gap": -2.0}, (MotionClass.NO_IMPACT, 0, 0)),  # pressed for ever
    ],
)
def test_known_motions_have_their_class_and_name(changes, known):
    assert motion_at(OSC.replace(**changes)) == known


def test_a_motion_that_loses_nothing_is_neither_periodic_nor_chaotic_but_undecided():
    """Without loss at the stop and in the damper neighbours of a regular orbit part in proportion to time."""
    elastic = OSC.replace(restitution=1.0, damping=0.0, omega=3.3)
    assert motion_at(elastic, start=vi.State(-0.4)) == (MotionClass.UNDECIDED, 0, 0)


def test_a_mass_that_rests_once_and_not_again_is_undecided_until_that_rest_is_left_out():
    """The orbit from at rest at y = -1 sticks at 43 s and no more within 5000 impacts."""
    osc, settings = OSC.replace(omega=SPREAD[7]), {"start": vi.State(-1.0), "indices": CYCLES}
    (rest,) = vi.impact_section(osc, start=vi.State(-1.0))["stick_time"].values
    assert rest < 50.0
    assert motion_at(osc, **settings) == (MotionClass.UNDECIDED, 0, 0)
    assert motion_at(osc, **settings, transient_impacts=200) == (MotionClass.CHAOTIC, 0, 0)


def test_each_rule_decides_where_the_ones_before_it_do_not():
    inf, certain = math.inf, 1.01 * CERTAIN_GROWTH / 1000
    sweep = cells(
        [math.nan, math.nan, math.nan, -inf, -inf, -0.1, certain, 0.97 * certain, certain, -0.01, certain],
        [0, 0, 0, 1, 0, 3, 0, 0, 0, 0, 0],
        [0, 0, 0, -1, 0, 2, 0, 0, 0, 0, -1],
        [
            vi.Status.STOPPED_IMPACTING,
            vi.Status.BUDGET,
            vi.Status.INTERRUPTED,
            vi.Status.STICKING,
            vi.Status.STICKING,
            vi.Status.CLOSED,
            vi.Status.OK,
            vi.Status.OK,
            vi.Status.SHORT_WINDOW,
            vi.Status.OK,
            vi.Status.OK,
        ],
    )
    words = [MotionClass(code).word for code in vi.classify(sweep)["motion"].values]
    assert words == [
        "no_impact",
        "undecided",
        "undecided",
        "sticking",
        "undecided",
        "periodic",
        "chaotic",
        "undecided",
        "undecided",
        "undecided",
        "chaotic",
    ]
    assert vi.classify(sweep)["n_impacts"].values[-1] == 0, "without a cycle no impacts are counted"


def test_positive_exponents_and_motions_that_never_repeat_are_one_thing(spread):
    motion = vi.classify(spread)["motion"]
    grows, cycle = spread["lyapunov"] > 0, (spread["n_periods"] > 0) | (spread["n_impacts"] == -1)
    assert not bool((grows & cycle).any())
    decided = motion != MotionClass.UNDECIDED
    np.testing.assert_array_equal(grows.values[decided], ~cycle.values[decided])
    np.testing.assert_array_equal(motion.values[decided] == MotionClass.CHAOTIC, grows.values[decided])
    assert float(decided.mean()) > 0.95
    exponent = spread["lyapunov"].values
    unnamed = exponent[~(spread["n_periods"].values > 0) & np.isfinite(exponent)]  # what rests now and then has none
    # What never repeats within 5100 impacts is chaotic, but for orbits that settle too slowly to be told.
    assert (unnamed > 0).mean() > 0.9
    assert len(unnamed) >= 15
    assert {MotionClass.PERIODIC, MotionClass.STICKING, MotionClass.CHAOTIC} <= set(motion.values.tolist())


def test_impacts_per_period_of_a_cycle_are_those_of_its_name(spread):
    named = (spread["n_periods"] > 0) & (spread["n_impacts"] > 0)
    assert int(named.sum()) > 20
    ratio = (spread["n_impacts"] / spread["n_periods"]).values[named]
    np.testing.assert_array_equal(ratio, spread["impacts_per_period"].values[named])


def test_the_exponent_per_time_decides_as_the_one_per_impact(spread):
    by_impact = vi.classify(spread.drop_vars(["lyapunov", "impacts_per_period"]))
    by_time = vi.classify(spread.drop_vars("lyapunov_per_impact"))
    np.testing.assert_array_equal(by_impact["motion"], by_time["motion"])
    in_hertz = spread.drop_vars("lyapunov_per_impact").rename(omega="frequency")
    in_hertz = in_hertz.assign_coords(frequency=variable("frequency", "frequency", SPREAD / (2 * math.pi)))
    np.testing.assert_array_equal(vi.classify(in_hertz)["motion"], by_impact["motion"])


def test_a_family_is_classified_by_the_exponent_per_impact_alone():
    """Its own parameters do not give the driving period of a cell."""
    family = vi.family(lambda hertz=0.45: vi.ImpactOscillator(frequency=hertz))
    indices = (*CYCLES, "lyapunov", "impacts_per_period")
    sweep = vi.parameter_map(family, hertz=[0.1 / 2 / math.pi, 1 / math.pi, 1.4 / math.pi], indices=indices)
    assert [MotionClass(code).word for code in vi.classify(sweep)["motion"].values] == [
        "sticking",
        "periodic",
        "chaotic",
    ]
    with pytest.raises(ValueError, match="lacks lyapunov_per_impact"):
        vi.classify(sweep.drop_vars("lyapunov_per_impact"))


def test_a_map_of_three_axes_is_classified_cell_by_cell():
    axes = {"omega": [0.1, 2.0, 2.8], "mass": [0.9, 1.0], "gap": [0.0, 50.0]}
    cube = vi.classify(vi.parameter_map(OSC, **axes, indices=CYCLES, sample_impacts=1000))
    assert cube["motion"].dims == ("omega", "mass", "gap")
    assert bool((cube["motion"].sel(gap=50.0) == MotionClass.NO_IMPACT).all())
    line = [MotionClass(code).word for code in cube["motion"].sel(gap=0.0, mass=1.0).values]
    assert line == ["sticking", "periodic", "chaotic"]


@pytest.mark.parametrize("direction", ["fresh", "down"])
def test_a_diagram_that_tells_the_indices_along_its_axis_is_classified(direction):
    values = {"omega": [0.1, 2.0, 2.8], "sample_impacts": 1000, "indices": CYCLES}
    classes = vi.classify(vi.bifurcation_diagram(OSC, **values, direction=direction))
    assert classes["motion"].dims == ("omega",)
    assert [MotionClass(code).word for code in classes["motion"].values] == ["sticking", "periodic", "chaotic"]


def test_a_class_is_labelled_by_flags_and_keeps_what_it_was_made_from(spread):
    classes = vi.classify(spread)
    assert classes["motion"].attrs["flag_meanings"] == "undecided no_impact periodic sticking chaotic"
    np.testing.assert_array_equal(classes["motion"].attrs["flag_values"], range(5))
    assert classes.attrs["oscillator"] == spread.attrs["oscillator"]
    np.testing.assert_array_equal(classes["omega"], SPREAD)


@pytest.mark.parametrize(
    ("sweep", "words"),
    [
        ([1.0], "`sweep` must be a Dataset, got [1.0]"),
        (
            cells([0.1], [0], [0], [0]).drop_vars("n_periods"),
            "must hold exponents and cycles, but lacks n_periods;",
        ),
        (
            vi.parameter_map(OSC, omega=[2.0], sample_impacts=50),
            "lacks lyapunov_per_impact, n_periods, n_impacts; run parameter_map with "
            "indices=('lyapunov_per_impact', 'n_periods', 'n_impacts')",
        ),
        (cells([0.1], [0], [0], [0]).drop_attrs(), "`sweep` must hold the number of sampled impacts"),
    ],
)
def test_a_sweep_that_cannot_be_classified_is_refused_with_what_to_ask_for(sweep, words):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        vi.classify(sweep)
    assert words in str(caught.value)
