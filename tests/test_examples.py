"""The examples and whatever the README and the documentation tell a reader to type."""

import runpy
import shlex

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest

from fenced import ROOT, blocks, commands
from vibroimpact.cli import main

EXAMPLES = ROOT / "examples"
SHELL_PAGES = [ROOT / "README.md", ROOT / "docs" / "reference" / "cli.md"]


@pytest.fixture(autouse=True)
def in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plt, "show", lambda: None)
    with mpl.rc_context({"backend": "Agg"}):
        yield
    plt.close("all")


@pytest.mark.long
@pytest.mark.parametrize("script", sorted(EXAMPLES.glob("*/*.py")), ids=lambda script: script.stem)
def test_an_example_finds_its_numbers_shows_a_figure_and_leaves_no_file(script, tmp_path):
    assert "assert " in script.read_text()
    runpy.run_path(str(script), run_name="__main__")
    assert plt.get_fignums()
    assert list(tmp_path.iterdir()) == []


def test_first_orbit_names_the_motion(capsys):
    runpy.run_path(str(EXAMPLES / "ideas" / "first_orbit.py"))
    assert capsys.readouterr().out == "period-1 impact-2, hits at 1.62 and 1.19 m/s every 6.61 s\n"


def test_the_python_blocks_of_the_readme_run():
    python = blocks(ROOT / "README.md", "python")
    assert len(python) == 2
    for block in python:
        exec(compile(block, "README.md", "exec"), {})


@pytest.mark.long
@pytest.mark.parametrize("page", SHELL_PAGES, ids=lambda page: page.name)
def test_shell_lines_run_and_print_what_the_page_shows(page, tmp_path, capsys):
    for study in blocks(page, "toml"):
        (tmp_path / "study.toml").write_text(study)
    shown = commands(page)
    assert shown
    for line, output in shown:
        program, *arguments = shlex.split(line)
        assert program == "vibroimpact"
        assert main(arguments) == 0, line
        lines = capsys.readouterr().out.splitlines()
        assert [text for text in lines if not text.startswith(("computed in", "wrote"))] == output
