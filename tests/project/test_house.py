"""The plan of the house, counted: what CONTRIBUTING says of the code is so."""

import ast
import re
from collections import Counter
from pathlib import Path

import pytest

from vibroimpact.backends import BACKENDS
from vibroimpact.kernels.systems.elements import COLUMNS
from vibroimpact.model.elements import KINDS as ELEMENTS
from vibroimpact.model.oscillator import PARAMETERS

SOURCE = Path(__file__).parents[2] / "src" / "vibroimpact"
FILES = {str(path.relative_to(SOURCE)): path.read_text(encoding="utf-8") for path in SOURCE.rglob("*.py")}
# Where physics or a published study speaks of one oscillator by its seven numbers.
PHYSICS = ("model/oscillator.py", "kernels/", "backends/reference/", "backends/fixed_step.py", "orbits/", "studies/")


def calls_of(name):
    """Return the files that call a function of that name, once for every call."""
    found = []
    for file, text in FILES.items():
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", None)) == name:
                found.append(file)
    return sorted(found)


def test_compiled_functions_live_in_kernels():
    compiled = [
        file
        for file, text in FILES.items()
        if re.search(r"^\s*@(njit|inner|once|rare|loop|compiled|cuda\.jit|_kernel)", text, re.M)
    ]
    assert [file for file in compiled if not file.startswith("kernels/")] == []


def test_one_verb_changes_a_state_and_two_loops_call_it():
    calls = calls_of("advance")
    assert 1 <= len(calls) <= 2
    assert all(file.startswith("kernels/") for file in calls)


def test_the_machinery_names_no_list_of_parameters():
    naming = [
        file
        for file, text in FILES.items()
        if re.search(r"from vibroimpact.model.oscillator import .*PARAMETERS", text)
    ]
    assert [file for file in naming if not file.startswith(PHYSICS)] == []


def test_no_list_of_back_ends_stands_outside_their_table():
    names = set(BACKENDS)
    found = {
        file: {
            node.value
            for node in ast.walk(ast.parse(text))
            if isinstance(node, ast.Constant) and isinstance(node.value, str)
        }
        & names
        for file, text in FILES.items()
        if not file.startswith("backends/")
    }
    assert [file for file, named in found.items() if len(named) > 1] == []


@pytest.mark.parametrize("file", FILES)
def test_a_file_is_one_room(file):
    assert len(FILES[file].splitlines()) <= 400


def test_a_folder_has_fewer_files_than_a_reader_can_survey():
    tests = Path(__file__).parents[1]
    folders = Counter(file.rpartition("/")[0] for file in FILES)
    assert max(folders.values()) < 24
    assert max(Counter(path.parent for path in tests.rglob("*.py")).values()) < 24


def test_parameters_have_symbols_that_are_theirs_alone():
    symbols = {}
    from vibroimpact import ImpactOscillator

    for name, parameter in ImpactOscillator.parameters.items():
        symbols.setdefault(parameter.symbol, []).append(name)
    assert all(len(names) == 1 for names in symbols.values())
    assert set(PARAMETERS) <= set(ImpactOscillator.parameters)


KINDS = {
    "ImpactOscillator", "ImpactSystem", "Orbit", "SystemOrbit", "Samples", "Cells", "SystemCells",
}  # fmt: skip


def questions_of_kind(text):
    """Return the lines that ask which kind of model, orbit, sample or table something is."""
    for node in ast.walk(ast.parse(text)):
        asks = isinstance(node, ast.Call) and getattr(node.func, "id", "") == "isinstance"
        if asks and KINDS & {name.id for name in ast.walk(node.args[1]) if isinstance(name, ast.Name)}:
            yield node.lineno


def test_nothing_above_the_back_ends_asks_for_the_kind_of_a_model_an_orbit_or_a_table():
    questions = {file: [*questions_of_kind(text)] for file, text in FILES.items()}
    above = {
        file: lines for file, lines in questions.items() if lines and not file.startswith(("backends/", "kernels/"))
    }
    assert not above


def names_in(text):
    """Return the names in code: those of variables, attributes and imports."""
    for node in ast.walk(ast.parse(text)):
        for field in ("id", "attr", "name"):
            if isinstance(name := getattr(node, field, None), str):
                yield name


def test_the_kinds_of_stops_are_named_only_in_the_files_that_define_them():
    kinds = {kind.__name__ for kind in ELEMENTS}
    rooms = dict.fromkeys(kinds, "model/elements.py")
    rooms |= {f"{kind}Stop": "backends/reference/stops.py" for kind in kinds}
    assert {(kind, file) for file, text in FILES.items() for kind in {*names_in(text)} & {*rooms}} == {*rooms.items()}


def test_one_file_of_the_kernels_says_by_what_law_stops_push():
    attributes = {
        file: {node.attr for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Attribute)}
        for file, text in FILES.items()
        if file.startswith("kernels/")
    }
    assert [file for file, names in attributes.items() if names & {*COLUMNS}] == ["kernels/systems/elements.py"]


def test_no_code_asks_a_stop_whether_it_is_compliant():
    assert [file for file, text in FILES.items() if re.search(r"\bstops?(\[\w+\])?\.compliant\b", text)] == []
