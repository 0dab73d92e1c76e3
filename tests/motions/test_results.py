"""What is done with results: diagrams go on from value to value, files and stores keep them, and they are shown."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

import systems as make
import vibroimpact as vi
from contents import differing
from systems import one_mass, two_masses
from vibroimpact.dataset import model_of
from vibroimpact.report import sentences_of

pytestmark = pytest.mark.usefixtures("modal_engine")

OSC = vi.ImpactOscillator(damping=0.1, restitution=0.5, gap=0.5)
SHORT = {"transient_impacts": 20, "sample_impacts": 30}
GAPS = [0.02, 0.04, 0.06]
MODELS = {
    "one mass": vi.ImpactOscillator(damping=0.1, omega=0.7, restitution=0.5),
    "two masses": two_masses(),
    "a machine": vi.models.bouncing_ball(restitution=0.8),
}


@pytest.mark.parametrize("name", MODELS)
def test_a_simulation_holds_the_impacts_up_to_its_last_sample(name):
    motion = vi.simulate(MODELS[name], periods=4)
    assert motion.sizes["impact"]
    for of in ("impact_time", "stick_time", "release_time"):
        assert not (motion[of] > motion["time"][-1]).any()


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


@pytest.mark.parametrize("name", MODELS)
def test_a_motion_carried_to_the_same_value_goes_on(name):
    """The next value of an axis that changes nothing starts where the one before ended."""
    model = MODELS[name]
    whole = vi.impact_section(model, transient_impacts=0, sample_impacts=12)

    @vi.family
    def unchanged(nothing=0.0):
        return model

    diagram = vi.bifurcation_diagram(
        unchanged, direction="up", nothing=[0, 1, 2], transient_impacts=0, sample_impacts=4
    )
    for of in ("velocity", "phase"):
        np.testing.assert_allclose(diagram[of].values.ravel(), whole[of], rtol=1e-9)


def test_a_motion_carried_into_stops_starts_before_them():
    wide, narrow = 0.06, -0.019  # the slot is almost closed
    diagram = vi.bifurcation_diagram(two_masses(), direction="down", bar_gap=[narrow, wide], **SHORT)
    assert (diagram["count"] == 30).all()


def test_a_motion_is_carried_to_every_kind_of_end():
    """A free mass that drifts away ends its window early; what follows it is computed."""
    drifting = vi.ImpactSystem(
        mass=1.0, stiffness=0.0, force=vi.Force(omega=1.0, harmonics={1: 1.0}), stops=[vi.Stop(direction=-1, gap=0.1)]
    )
    diagram = vi.bifurcation_diagram(drifting, direction="up", stop_1_gap=[0.1, 0.2], sample_impacts=5)
    assert [vi.Status(int(code)).has_indices for code in diagram["status"]] == [False, False]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"coordinate": 2}, "`coordinate` must be less than the number of coordinates, 2, got 2"),
        ({"coordinate": -1}, "`coordinate` must be a whole number >= 0"),
        ({"backend": "fixed-step"}, "`backend` 'fixed-step' takes only one mass"),
    ],
)
def test_a_diagram_refuses_what_systems_have_not(more, words):
    with pytest.raises(ValueError, match=words):
        vi.bifurcation_diagram(two_masses(), bar_gap=GAPS, **SHORT, **more)


def test_a_diagram_of_a_system_is_summed_up_in_words():
    diagram = vi.bifurcation_diagram(vi.family(vi.models.impact_damper), frequency=[29.0, 30.0], **SHORT)
    assert sentences_of(diagram)[0].startswith("2 values of driving frequency 29 to 30 Hz, each from rest at q = 0")


# Files and stores


def test_a_table_of_impacts_names_the_stop_of_each(tmp_path):
    pandas = pytest.importorskip("pandas")
    hits = vi.impact_section(two_masses(), **SHORT)
    table = pandas.read_csv(vi.save(hits, tmp_path / "hits.csv"))
    rows = table[table["stop"].isin(two_masses().stop_names)]
    assert rows["stop"].tolist() == hits["stop"].values.tolist()


MAPS = [
    (OSC, {"omega": np.linspace(1.5, 1.7, 100), "gap": [0.4, 0.5]}),
    (two_masses(), {"bar_gap": np.linspace(0.02, 0.06, 100), "omega": [7.0, 8.0]}),
    (vi.family(vi.models.impact_damper), {"clearance": np.linspace(4e-3, 6e-3, 100), "frequency": [29.0, 30.0]}),
]


@pytest.mark.parametrize(("model", "axes"), MAPS, ids=["one mass", "system", "family"])
def test_a_store_goes_on_where_it_stopped_and_ends_with_the_bits_of_memory(run, tmp_path, model, axes):
    how = {**axes, "transient_impacts": 20, "sample_impacts": 200}
    stored = {"store": tmp_path / "map.zarr", "tile": 20, "workers": 1}
    vi.parameter_map(model, **how, **stored, progress=lambda *_: False)
    lines = run("info map.zarr")[1]
    assert "continue with: the same parameter_map(..., store=...) call" in lines
    assert not any(line.startswith("10 of 10") for line in lines)
    vi.parameter_map(model, **how, **stored)
    assert any(line.startswith("10 of 10 tiles done") for line in run("info map.zarr")[1])
    memory, loaded = vi.parameter_map(model, **how), vi.load(tmp_path / "map.zarr")
    assert not differing(memory, loaded, memory.data_vars)


@pytest.mark.parametrize("changed", [{"mass": [[2.0, 0.5], [0.5, 1.1]]}, {"damping": [[0.3, 0.0], [0.0, 0.2]]}])
def test_a_changed_matrix_is_another_study(tmp_path, changed):
    axes = {"bar_gap": GAPS, "store": tmp_path / "map.zarr", **SHORT}
    vi.parameter_map(two_masses(), **axes)
    with pytest.raises(ValueError, match="holds another study"):
        vi.parameter_map(two_masses(**changed), **axes)


@pytest.mark.parametrize(
    "text",
    ["", "7", "{}", '{"mass": 1}', "nothing", '{"mass": [[1.0, 2.0]], "force": 3, "stops": [{}]}', '{"mass": 1e999}'],
)
def test_a_damaged_system_is_refused(tmp_path, text):
    result = vi.impact_section(two_masses(), **SHORT)
    result.attrs["system"] = text
    with pytest.raises(OSError, match="its attribute 'system' is damaged"):
        vi.load(vi.save(result, tmp_path / "result.nc"))


@pytest.mark.parametrize("model", [*MODELS.values(), vi.models.tube_in_supports()], ids=[*MODELS, "a tube"])
def test_a_result_knows_its_model(model):
    assert model_of(vi.simulate(model, periods=1)) == model


# Shown


def results_of(design, kind):
    """Yield what the questions about a design return: orbits, a branch, an attractor, a verdict."""
    for n_impacts in (1, -1):
        yield (orbits := vi.find_orbit(design, n_impacts=n_impacts))
        yield from orbits
    yield vi.continue_orbit(
        next(iter(vi.find_orbit(design, **kind))), "omega", (0.9 * design.omega, 1.1 * design.omega)
    )
    yield from vi.attractors(design)
    yield vi.describe(design, parameters=())


@pytest.mark.parametrize(
    "design",
    [
        vi.ImpactOscillator(omega=0.1, gap=0.0),  # it chatters
        vi.ImpactOscillator(omega=0.9),  # its one orbit is inadmissible
        one_mass(vi.ImpactOscillator(omega=0.1), force=vi.Force(omega=0.1, harmonics={1: 1.0})),
        make.two_sided(),
    ],
    ids=lambda design: type(design).__name__,
)
def test_a_result_is_shown_in_some_lines_and_in_a_notebook_as_a_table_with_units(design):
    shown = set()
    for result in results_of(
        design, {} if design.forgets else {"stops": design.stop_names[0], "symmetric": len(design.stops) == 2}
    ):
        assert len(repr(result)) < 4000
        page = ElementTree.fromstring(f"<div>{result._repr_html_().replace('<br>', '<br/>')}</div>")
        assert page.find("p/b").text
        rows = page.findall("table/tr")
        assert len({len(row) for row in rows}) <= 1, "each row has a cell for each head"
        assert len(rows) <= 14
        shown |= {unit for cell in page.iter() for unit in re.findall(r"\[.*?\]", cell.text or "")}
    assert {"[m/s]", "[J]"} <= shown


def test_a_table_says_of_an_inadmissible_orbit_that_it_is_none_and_why():
    (orbit,) = vi.find_orbit(vi.ImpactOscillator(omega=0.9))
    assert "period-1 impact-1, inadmissible" in orbit._repr_html_()
    assert orbit.message.partition("'")[0] in orbit._repr_html_()
