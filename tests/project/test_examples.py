"""The examples and whatever the README and the documentation tell a reader to type."""

import json
import runpy
import shlex

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest

from fenced import ROOT, SHELL, blocks, commands, fences
from vibroimpact.cli import commands as known
from vibroimpact.cli import main

EXAMPLES = ROOT / "examples"
FIGURES = runpy.run_path(str(ROOT / "docs" / "figures.py"))
THUMBNAILS = runpy.run_path(str(ROOT / "docs" / "thumbnails.py"))
CLI = ROOT / "docs" / "reference" / "cli.md"
README, HOME = ROOT / "README.md", ROOT / "docs" / "index.md"
PAGES = [README, ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("[a-z]*/**/*.md")), HOME]


@pytest.fixture(autouse=True)
def in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plt, "show", lambda: None)
    with mpl.rc_context({"backend": "Agg"}):
        yield
    plt.close("all")


def assert_pictures_are_drawn_by(program):
    assert plt.get_fignums()
    shown = json.loads(FIGURES["STRUCTURE"].read_text(encoding="utf-8"))
    for number, name in zip(plt.get_fignums(), FIGURES["PICTURES"].get(program, []), strict=False):
        assert FIGURES["structure"](plt.figure(number)) == shown[name], f"{name} shows other things: `make figures`"


@pytest.mark.long
@pytest.mark.parametrize("script", sorted(EXAMPLES.glob("*/*.py")), ids=lambda script: script.stem)
def test_an_example_finds_its_numbers_shows_a_figure_and_leaves_no_file(script, tmp_path):
    assert "assert " in script.read_text()
    plt.close("all")  # of the tests before
    runpy.run_path(str(script), run_name="__main__")
    assert list(tmp_path.iterdir()) == []
    assert_pictures_are_drawn_by(f"{script.parent.name}/{script.stem}")
    THUMBNAILS["square"](plt.figure(plt.get_fignums()[0]), tmp_path / "thumbnail.png")
    drawn = plt.imread(tmp_path / "thumbnail.png")
    assert drawn.shape[:2] == (THUMBNAILS["PIXELS"], THUMBNAILS["PIXELS"])
    assert len(np.unique(drawn[20:-20, 20:-20].reshape(-1, drawn.shape[2]), axis=0)) > 4


@pytest.mark.long
def test_the_program_of_the_home_page_draws_the_picture_above_it(tmp_path, capsys):
    FIGURES["run"]("index.md")
    assert "hardest" in capsys.readouterr().out
    assert_pictures_are_drawn_by("index.md")


def test_first_orbit_names_the_motion(capsys):
    runpy.run_path(str(EXAMPLES / "ideas" / "first_orbit.py"))
    assert capsys.readouterr().out == "period-1 impact-2, hits at 1.62 and 1.19 m/s every 6.61 s\n"


def test_the_python_blocks_of_the_readme_run():
    python = blocks(README, "python")
    assert len(python) == 2
    for block in python:
        exec(compile(block, "README.md", "exec"), {})


# How what no test runs begins, and why.
UNRUN = {
    "python3.11 -m venv": "makes an environment: `make dist` tries the package in one",
    ".venv/bin/python -m pip": "installs",
    ".venv/bin/vibroimpact --help": "tests/commands/test_cli.py reads the help of every command",
    "python -m pip install": "installs",
    "pip install": "installs",
    "py -3.11": "Windows",
    r".venv\Scripts": "Windows",
    "make ": "runs all of this",
    "vibroimpact warm-up": "compiles for minutes: tests/project/test_compiling.py",
    "vibroimpact explore": "serves until it is stopped: tests/explorer/test_explorer_server.py",
    "vibroimpact map study.toml --out run.zarr": "needs a cluster: tests/sweeps/test_cluster.py",
    "dask ": "needs a cluster",
    "CUDA_VISIBLE_DEVICES": "needs a GPU and a cluster",
    "export ": "sets options of Dask",
    "import vibroimpact as vi\nfrom dask": "needs a cluster",
    "import numpy as np\nimport vibroimpact as vi\nfrom dask": "needs a cluster",
    "import vibroimpact as vi\n\ntube = vi.models.tube_in_many_supports": "makes a picture: `make figures` runs it",
    "import matplotlib.pyplot as plt\nimport numpy as np\nimport vibroimpact as vi\n\nsprings": "as above",
    "import vibroimpact as vi\n\nspring = vi.Stop": "as above",
    "vi.explore(": "serves until it is stopped",
    "491,678 of": "progress of a run that takes minutes",
    "220 s elapsed": "as above",
    "ok 136,947": "as above",
    "continue with: vibroimpact": "as above",
}


def unrun(text):
    return any(text.startswith(beginning) for beginning in UNRUN)


@pytest.fixture
def files(tmp_path):
    """Write what the commands of pages read: the study and the model of the command line's page, and the examples."""
    studies = blocks(CLI, "toml")
    for name in ("study", "old", "new"):
        (tmp_path / f"{name}.toml").write_text(studies[0])
    (tmp_path / "tube.py").write_text(next(block for block in blocks(CLI, "python") if "def shaker" in block))
    (tmp_path / "examples").symlink_to(EXAMPLES)


def programs(page):
    """Yield the arguments of the package's own commands on a page, with their lines and outputs."""
    for line, output in commands(page):
        program, *arguments = shlex.split(line, comments=True, posix="\\" not in line)
        if program in ("vibroimpact", ".venv/bin/vibroimpact"):
            yield line, arguments, output


def test_whatever_a_page_prints_by_hand_is_run_or_named_with_the_reason():
    left = []
    for page in PAGES:
        ours = {line for line, *_ in programs(page)}
        left += [line for line, _ in commands(page) if line not in ours and not unrun(line)]
        for language, body in fences(page):
            runs = language in ("{code-cell}", "toml") or ">>> " in body or page in (README, HOME)
            if language not in SHELL and not (runs or unrun(body) or "def shaker" in body):
                left.append(body)
    assert left == []


def test_every_command_that_a_page_shows_is_one_that_the_program_takes(files):
    for page in PAGES:
        for line, (name, *arguments), _ in programs(page):
            if name != "--help":
                assert known().commands[name].make_context(name, arguments), line


@pytest.mark.long
@pytest.mark.parametrize("page", [page for page in PAGES if [*programs(page)]], ids=lambda page: page.stem)
def test_shell_lines_run_and_print_what_the_page_shows(page, files, capsys):
    """A block of `text` with a prompt shows an excerpt: its lines, in their order."""
    excerpts = "".join(blocks(page, "text"))
    for line, arguments, output in programs(page):
        if unrun(line):
            continue
        assert main(arguments) == 0, line
        lines = [text for text in capsys.readouterr().out.splitlines() if not text.startswith(("computed in", "wrote"))]
        if output is not None and f"$ {line}\n" in excerpts:
            left = iter(lines)
            assert [text for text in output if text not in left] == [], line
        elif output is not None:
            assert lines == output, line
