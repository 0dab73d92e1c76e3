"""What several test files share: the 50-digit values and a shorthand for oscillators."""

import json
import math
import os
import shutil
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

# The witness solves 5 x 5 systems: threads of a linear algebra library only wait for each other there, tenfold the time
# on two cores. Read when NumPy is first imported, which is after this.
for library in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(library, "1")
os.environ.setdefault("MPLBACKEND", "agg")

# A shell lets what it starts in the background ignore Ctrl-C, and whatever that starts inherits it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Run one more than there are cores: tests of pages, clusters and killed runs wait for others."""
    return (os.cpu_count() or 1) + 1


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_setupnodes(config: pytest.Config) -> None:
    """Compile the kernels once, before every worker of a whole run does; a few seconds where it is done."""
    if config.args_source is pytest.Config.ArgsSource.TESTPATHS:
        subprocess.run([sys.executable, "-m", "vibroimpact", "warm-up"], check=True)


@pytest.fixture(autouse=True)
def _untold(monkeypatch):
    """Let what is compiled not be told: which test compiles first depends on how they are shared out."""
    monkeypatch.setattr("vibroimpact.compiling.SILENT", math.inf)


@pytest.fixture(autouse=True)
def _unhurried(monkeypatch):
    """Lift the explorer's limits of time: what a view shows in the end must not depend on how busy a machine is."""
    for room, limit in ("work", "PLANE_SECONDS"), ("session", "LINE_SECONDS"), ("session", "SEARCH_SECONDS"):
        if module := sys.modules.get(f"vibroimpact.explorer.{room}"):
            monkeypatch.setattr(module, limit, math.inf)


@pytest.fixture
def modal_engine(monkeypatch):
    """Let systems that are one mass, too, go to the engine of systems, whose oracle the engine of one mass is."""
    import numpy as np

    monkeypatch.setattr("vibroimpact.backends.one_mass.is_one_mass", lambda cells: np.zeros(len(cells), bool))


FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync"]  # fmt: skip
CODES = "engine", "engine of systems", "witness"


@pytest.fixture(params=CODES)
def way(request):
    """Return each code that follows oscillators."""
    from codes import Way

    if request.param == "engine of systems":
        request.getfixturevalue("modal_engine")
    return Way(request.param)


@pytest.fixture(params=CODES)
def code(request):
    """Return each code that follows systems; the engine as it comes takes that of one mass where a system is one."""
    from codes import Engine, Witness

    if request.param == "engine of systems":
        request.getfixturevalue("modal_engine")
    return Witness() if request.param == "witness" else Engine()


@pytest.fixture(scope="module", params=["one mass", "one mass as a system"])
def as_model(request):
    """Return what makes a model of an oscillator, for all tests of a file alike."""
    from systems import FORMS

    return FORMS[request.param]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with what is long, so that two workers end together; the first cases of some tests are not."""
    cases: Counter[str] = Counter()
    for item in items:
        mark = item.get_closest_marker("long")
        test = item.nodeid.partition("[")[0]
        if mark and cases[test] < mark.kwargs.get("but", 0):
            item.own_markers.remove(mark)
        cases[test] += 1
    items.sort(key=lambda item: item.get_closest_marker("long") is None)


@pytest.fixture(scope="session")
def values() -> dict[str, Any]:
    """Return values computed with 50 digits by independent code; numbers are strings."""
    return json.loads((Path(__file__).parent / "data" / "values.json").read_text())


@pytest.fixture(scope="module")
def browser():
    """Return a headless Chromium."""
    playwright_api = pytest.importorskip("playwright.sync_api", reason="no playwright: install the extra [web-test]")
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if chromium is None:
        pytest.skip("no Chromium: install Debian's package chromium")
    with playwright_api.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=chromium, args=FLAGS)
        yield started
        started.close()


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run a command in an empty folder; return exit code, lines told and lines of complaint."""
    from vibroimpact.cli import main

    monkeypatch.chdir(tmp_path)

    def ran(command: str):
        capsys.readouterr()
        code = main(command.split())
        told = capsys.readouterr()
        return code, told.out.splitlines(), told.err.splitlines()

    return ran


@pytest.fixture
def refused(run, tmp_path):
    """Run a command that exits 2 with one line and touches nothing; return the line."""

    def kept():
        return {
            path: path.stat().st_mtime_ns for path in tmp_path.rglob("*") if path.is_file() and path.suffix != ".pyc"
        }

    def complaint(command: str):
        before = kept()
        code, lines, complaints = run(command)
        assert (code, lines, len(complaints)) == (2, [], 1), complaints
        assert kept() == before
        return complaints[0]

    return complaint


@pytest.fixture
def memory(monkeypatch):
    """Let the machine have so many bytes of memory."""
    return lambda size: monkeypatch.setattr("vibroimpact.parameters.installed", lambda: size)


@pytest.fixture
def stopped_early(monkeypatch):
    """Stop what the command line computes when it first tells how far it is."""
    from vibroimpact.progress import Meter

    def stop(meter, done, total, partial):
        meter.stopped = True
        return False

    monkeypatch.setattr(Meter, "__call__", stop)


@pytest.fixture
def heard():
    """Return what the listener of an explorer hears."""
    return []


@pytest.fixture
def ax():
    """Return new axes."""
    from matplotlib.figure import Figure

    return Figure(layout="constrained").add_subplot()


@pytest.fixture
def shown():
    """Return the functions of figures; each figure is closed after its test."""
    import matplotlib.pyplot as plt

    import vibroimpact as vi

    yield vi.plotting
    plt.close("all")


@pytest.fixture(params=["one mass", "its system"])
def form(request):
    """Return what makes the model of an oscillator: itself, or its system, which the engine of systems then follows."""
    if request.param == "one mass":
        return lambda osc: osc
    request.getfixturevalue("modal_engine")
    return lambda osc: osc.system
