"""The documentation says what the code does: tables, numbers, examples, links."""

import ast
import doctest
import importlib
import inspect
import json
import pkgutil
import re
from itertools import pairwise

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest

import vibroimpact as vi
from fenced import ROOT, blocks, fences, table
from vibroimpact.dataset import VARIABLES
from vibroimpact.indices import EVERY
from vibroimpact.model.oscillator import PARAMETERS

DOCS = ROOT / "docs"
PAGES = sorted([*DOCS.glob("*.md"), *DOCS.glob("[a-z]*/**/*.md"), *ROOT.glob("*.md")])
API = DOCS / "reference" / "api"
MODULES = sorted(
    module.name for module in pkgutil.walk_packages(vi.__path__, "vibroimpact.") if not module.name.endswith("__main__")
)


@pytest.fixture(autouse=True)
def drawn_out_of_sight():
    with mpl.rc_context({"backend": "Agg", "figure.max_open_warning": 0}):
        yield
    plt.close("all")


def failures(examples, name, names):
    told = []
    test = doctest.DocTestParser().get_doctest(examples, names, name, name, 0)
    doctest.DocTestRunner(optionflags=doctest.IGNORE_EXCEPTION_DETAIL).run(test, out=told.append)
    return "".join(told)


def named(page):
    return str(page.relative_to(ROOT))


def with_examples(pages):
    return [page for page in pages if any(">>> " in block for block in blocks(page, "python"))]


def handed_out(node):
    """Return the names in the types of what a function returns, or a class has for public attributes."""
    parts = [node] if isinstance(node, ast.FunctionDef) else node.body
    types = [part.returns for part in parts if isinstance(part, ast.FunctionDef) and part.name[0] != "_"]
    types += [part.annotation for part in parts if isinstance(part, ast.AnnAssign) and part.target.id[0] != "_"]
    return {name for kind in types if kind for name in re.findall(r"\w+", ast.unparse(kind))}


def test_every_class_that_a_user_receives_has_a_page():
    """All but the tables of cells, which back ends read."""
    trees = [ast.parse(file.read_text()) for file in (ROOT / "src" / "vibroimpact").rglob("*.py")]
    defined = {node.name: node for tree in trees for node in tree.body if hasattr(node, "name")}
    pages = re.findall(
        r"^   vibroimpact\.(?:\w+\.)*(\w+)$", "\n".join(page.read_text() for page in API.glob("*.md")), re.M
    )
    received = {name for page in pages if page in defined for name in handed_out(defined[page])}
    classes = {name for name in received if isinstance(defined.get(name), ast.ClassDef) and name[0] != "_"}
    assert classes - set(pages) <= {"Cells", "SystemCells"}


@pytest.mark.parametrize("page", [page for page in PAGES if fences(page)], ids=named)
def test_code_fits_beside_the_contents_of_a_page(page):
    """Such a column holds 88 characters; a block with longer lines, typed or printed, has to be scrolled."""
    assert [line for _, body in fences(page) for line in body.splitlines() if len(line) > 88] == []


@pytest.mark.long
@pytest.mark.parametrize("page", with_examples(PAGES), ids=named)
def test_every_example_of_a_page_gives_what_it_shows(page):
    assert failures("\n".join(blocks(page, "python")), page.name, {}) == ""


@pytest.mark.long
@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "{code-cell}")], ids=named)
def test_a_notebook_runs(page):
    exec("\n".join(blocks(page, "{code-cell}")), {})
    assert plt.get_fignums()


@pytest.mark.long
def test_known_cases_are_met_as_closely_as_their_page_says():
    page, names = DOCS / "about" / "cases.md", {}
    exec(doctest.script_from_examples("".join(blocks(page, "python"))), names)
    rows = re.findall(r"^\| (.+) \| .+ \| (.+) \| (.+) \| (.+) \| `(.+)` \|$", page.read_text(), re.MULTILINE)
    assert len(rows) > 15
    for case, known, ours, apart, line in rows:
        value = eval(line, names)
        assert abs(value - float(known)) <= float(apart), case
        assert abs(value - float(ours)) <= float(apart), case


def test_speeds_that_pages_state_are_those_of_the_last_benchmark():
    run = json.loads((ROOT / "benchmarks" / "results" / "latest.json").read_text())
    rows = {each["name"]: each for each in run["contenders"] if each["cost"]}
    chaotic = {name: row["cost"]["chaotic"] for name, row in rows.items()}
    targets = {each["what"]: each["measured"] for each in run["targets"]}
    readme, compared = (
        " ".join(page.read_text().split()) for page in (ROOT / "README.md", DOCS / "about" / "comparison.md")
    )

    def some(ratio):
        return f"some {float(f'{ratio:.2g}'):,.0f} times"

    assert f"{chaotic['ours, one core']['ns']:.0f} ns on one core" in readme
    assert f"{chaotic['ours, all cores']['ns']:.0f} ns on two" in readme
    seconds = targets["the paper's five maps, two cores, early closing"]
    assert f"take {seconds:.1f} s" in readme
    for name in ("the paper's scheme", "heyoka, one orbit", "SciPy DOP853, one orbit"):
        assert some(chaotic[name]["ratio"]) in readme, name
    ratios = [chaotic[name]["ratio"] for name in ("heyoka, one orbit", "heyoka, batch", "SciPy DOP853, one orbit")]
    ratios += [
        targets[f"heyoka / ours, {what}"] for what in ("two masses and two stops", "one mass and a one-sided spring")
    ]
    assert [ratio for ratio in ratios if some(ratio) not in compared] == []
    ours, heyoka, scipy = (rows[name] for name in ("ours, one core", "heyoka, one orbit", "SciPy DOP853, one orbit"))
    assert f"off by {scipy['error_first_20']:.1e} m/s, here by {ours['error_first_20']:.1e}" in compared
    assert f"passes {heyoka['passes_the_stop_by']:.3g} m beyond the stop" in compared
    assert f"stalls after {scipy['impacts_in_3_periods']} impacts" in compared


@pytest.mark.parametrize("name", MODULES)
def test_every_docstring_example_gives_what_it_shows(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    module = importlib.import_module(name)
    told = []
    runner = doctest.DocTestRunner()
    for test in doctest.DocTestFinder(exclude_empty=True).find(module, name):
        runner.run(test, out=told.append)
    assert "".join(told) == ""


def test_every_public_function_has_an_example():
    without = [name for name in vi.__all__ if name not in ("Status", "Tolerances", "models", "plotting")]
    assert [name for name in without if ">>> " not in (getattr(vi, name).__doc__ or "")] == []


FUNCTIONS = {
    name: function
    for module in (vi, vi.models, vi.plotting)
    for name in dir(module)
    if not name.startswith("_") and inspect.isfunction(function := getattr(module, name))
}


@pytest.mark.parametrize("function", FUNCTIONS.values(), ids=FUNCTIONS)
def test_the_documentation_of_a_function_has_every_argument_below_its_heading(function):
    text = inspect.getdoc(function)
    assert not re.search(r"\w -{4,}", text)
    assert [name for name in inspect.signature(function).parameters if not re.search(rf"\b{name}\b", text)] == []


GLOSSARY = DOCS / "reference" / "glossary.md"


def entries():
    """Return the first line of each entry of the glossary, by its term."""
    lines = "".join(blocks(GLOSSARY, "{glossary}")).splitlines()
    return {term: line.strip() for term, line in pairwise(lines) if term[:1] > " " and line[:1] == " "}


def test_the_statuses_of_the_glossary_are_those_of_the_code():
    told = entries()
    assert [told[s.word] for s in vi.Status] == [f"Code {s.value}: {s.sentence}." for s in vi.Status]
    assert [s.has_indices for s in vi.Status] == [True] * 4 + [False] * 7  # "the first four"


def test_the_glossary_has_the_words_symbols_and_units_of_results():
    rows = table(GLOSSARY, "| word | symbol")
    assert rows == [
        [name, symbol, words, unit]
        for name, (words, unit, symbol) in VARIABLES.items()
        if name not in EVERY or name in PARAMETERS
    ]
    told = entries()
    for index in EVERY.values():
        unit = "a pure number" if index.units == "1" else f"in {index.units}"
        assert told[index.name] == f"`{index.symbol}`, {unit}: {index.long_name}."


@pytest.mark.parametrize("page", [*DOCS.glob("[grst]*/*.md"), DOCS / "index.md"], ids=named)
def test_a_table_or_caption_links_a_status_or_an_index_to_the_glossary_where_it_names_it_first(page):
    words = [*(s.word for s in vi.Status), *(name for name in EVERY if name not in PARAMETERS)]
    names = {"Std": "std", **{name: name for name in words}}
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    for part in re.findall(r"(?:^\|.*\n)+|^\*[^*\s][^*]*\*$", text, re.MULTILINE):
        first = {}
        for linked, code, plain in re.findall(r"{term}`(?:[^`<]*<)?(\w+)>?`|[`\"](\w+)[`\"]|\b(Std)\b", part):
            first.setdefault(names.get(linked or code or plain), bool(linked))
        assert [name for name, link in first.items() if name and not link] == [], part


def test_the_page_on_gpus_states_what_was_measured():
    run = json.loads((ROOT / "benchmarks" / "results" / "gpu.json").read_text())
    page = (DOCS / "about" / "gpu.md").read_text()
    assert f"On an {run['gpu']}, on {run['date']}, for one map of {run['every_impact']['cells']:,} cells" in page
    rows = table(DOCS / "about" / "gpu.md", "| map | time")
    for row, way in zip(rows, ("every_impact", "early_closing"), strict=True):
        rates = [f"{run[way][f'impacts_{kind}_per_s']:.2e}".replace("+0", "") for kind in ("answered", "computed")]
        assert row[1:] == [f"{run[way]['median_s']:.3f} s", *rates]
    notes = (DOCS / "about" / "benchmarks.md").read_text()
    for count in ("429", "98,907", "1,305", "2,282"):
        assert count in page
        assert count in notes


def test_the_command_line_page_lists_every_command():
    from vibroimpact.cli import commands

    assert [row[0] for row in table(DOCS / "reference" / "cli.md", "| command")] == list(commands().commands)


def test_every_public_name_has_a_page_of_its_own():
    listed = " ".join(page.read_text() for page in API.glob("*.md")).split()
    names = [f"vibroimpact.{name}" for name in vi.__all__ if name not in ("contact", "models", "plotting")]
    names += [f"vibroimpact.contact.{name}" for name in vi.contact.__all__ if name not in ("LAWS", "law_of")]
    names += [f"vibroimpact.models.{name}" for name in vi.models.__all__]
    names += [f"vibroimpact.plotting.{name}" for name in vi.plotting.__all__ if name != "KINDS"]
    assert [name for name in names if name not in listed] == []


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_links_and_pictures_lead_to_files_that_are_there(page):
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    targets = [target.split("#")[0] for target in re.findall(r"\]\(([^)\s]+)\)", text)]
    paths = [page.parent / target for target in targets if target and "://" not in target]
    assert [path for path in paths if not source_of(path).exists()] == []


def source_of(path):
    """Return what the build of the documentation makes a page of the gallery from; other paths as they are."""
    gallery = DOCS / "gallery"
    if not path.resolve().is_relative_to(gallery):
        return path
    return (ROOT / "examples" / path.resolve().relative_to(gallery)).with_suffix(".py")


@pytest.mark.parametrize("name", re.findall(r"tests/[\w/]+\.py", "".join(page.read_text() for page in PAGES)))
def test_a_test_that_a_page_names_is_there(name):
    assert (ROOT / name).is_file()


def test_the_numbers_in_the_prose_of_the_std_page_are_settings_or_computed_on_it():
    page = DOCS / "guide" / "stability_map.md"
    prose = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    computed = "\n".join(blocks(page, "python"))
    numbers = set(re.findall(r"(?<![\w.])\d+(?:\.\d+)?(?:e-?\d+)?", prose))
    settings = {"5000", "100"}  # the window of impacts, held by the defaults' own tests
    assert {number for number in numbers - settings if number not in computed} <= {"0", "1"}
