"""What is said of the package stands in pyproject.toml; all other places agree with it."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


@pytest.fixture
def recipe():
    return yaml.safe_load((ROOT / "recipe" / "recipe.yaml").read_text())


def test_the_version_is_the_same_everywhere(recipe):
    cited = re.search(r"^version: (.*)$", (ROOT / "CITATION.cff").read_text(), re.M).group(1)
    latest = re.search(r"^## \[(\d[^]]*)\]", (ROOT / "CHANGELOG.md").read_text(), re.M).group(1)
    assert {cited, latest, recipe["context"]["version"]} == {PROJECT["version"]}


def test_the_conda_recipe_asks_for_what_the_wheel_asks_for(recipe):
    requirements = [
        entry.replace(" ", "").replace("matplotlib-base", "matplotlib") for entry in recipe["requirements"]["run"]
    ]
    assert sorted(requirements) == sorted([*PROJECT["dependencies"], f"python{PROJECT['requires-python']}"])


def test_the_conda_recipe_makes_the_same_command(recipe):
    (entry,) = recipe["build"]["python"]["entry_points"]
    assert entry.split(" = ") == list(*PROJECT["scripts"].items())


def test_the_wheel_that_the_page_on_installing_names_is_this_version():
    named = re.findall(r"vibroimpact-([\d.]+)-py3", (ROOT / "docs" / "start" / "install.md").read_text())
    assert set(named) == {PROJECT["version"]}
