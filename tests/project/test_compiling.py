"""What is compiled is told before it begins, is kept, and can be interrupted."""

import contextlib
import gc
import io
import os
import pty
import re
import select
import signal
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numba.core.event import Event, EventStatus

import vibroimpact as vi
from processes import COMMAND, python, until
from vibroimpact import beside, compiling, progress
from vibroimpact.execution import threads
from vibroimpact.execution.threads import worker_count
from vibroimpact.kernels.shared import deferred, interrupts, machine

TOLD = re.compile(r"compiling (.+): about (\d+) s, once on this machine")


def with_cache(folder):
    """Return the environment of a process that keeps its kernels in a folder."""
    return os.environ | {"NUMBA_CACHE_DIR": str(folder)}


def run(cache, *arguments):
    """Return what a command says on its error stream, with kernels in a folder."""
    done = subprocess.run([*COMMAND, *arguments], env=with_cache(cache), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stderr.splitlines()


def on_a_terminal(cache, *arguments, **how):
    """Start a command on a terminal, with kernels in a folder; return it and what it says there."""
    mine, theirs = pty.openpty()
    ends = dict.fromkeys(("stdin", "stdout", "stderr"), theirs)
    process = subprocess.Popen([*COMMAND, *arguments], env=with_cache(cache), **ends, **how)
    os.close(theirs)
    return process, mine


@pytest.mark.long
def test_a_command_says_what_it_compiles_after_its_model_and_once(tmp_path):
    first, second = (run(tmp_path, "section", "-p", "omega=1.4") for _ in range(2))
    (at,) = (number for number, line in enumerate(first) if TOLD.fullmatch(line))
    assert "omega" in "".join(first[:at])
    assert [line for line in first if not TOLD.fullmatch(line)] == second


@pytest.mark.long
def test_a_cache_cut_off_by_a_full_disk_or_by_another_program_is_none(tmp_path):
    run(tmp_path, "section")
    files = list(tmp_path.rglob("*.nb[ci]"))
    assert files
    for file in files:
        file.write_bytes(file.read_bytes()[:20])
    assert any(TOLD.fullmatch(line) for line in run(tmp_path, "section"))
    assert not any(TOLD.fullmatch(line) for line in run(tmp_path, "section"))


@pytest.mark.long
def test_without_a_folder_to_write_to_each_process_compiles_and_says_how_to_change_that():
    lines = [line for line in run("/proc/none", "section") if line.startswith("compiling")]
    assert len(lines) == 1
    assert "in each process, as /proc/none/" in lines[0]
    assert "NUMBA_CACHE_DIR" in lines[0]


@pytest.mark.long
def test_two_processes_may_compile_the_same_at_once(tmp_path):
    where = with_cache(tmp_path)
    both = [subprocess.Popen([*COMMAND, "section"], env=where, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    said = [process.communicate()[0].partition("computed in")[0] for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert said[0] == said[1]


@pytest.mark.long(but=1)
@pytest.mark.parametrize("arguments", [("map", "--x", "frequency=1:2:3"), ("simulate",)])
def test_ctrl_c_while_compiling_ends_the_process(tmp_path, arguments):
    """On a terminal, with the line on the model before; a compiler that is waited for would have ended with 0."""
    process, mine = on_a_terminal(tmp_path, *arguments, "--model", "impact_damper", start_new_session=True)
    said = ""
    while "once on this machine" not in said:
        said += os.read(mine, 4096).decode()
    process.send_signal(signal.SIGINT)
    assert process.wait() == 130
    assert "impact_damper" in said[: said.index("compiling")]
    assert "interrupted" in os.read(mine, 4096).decode()  # by the compiler's thread, or between two parts by its own


def processor_time(process):
    """Return what a process has taken, in seconds."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs the processor time of another process")
@pytest.mark.parametrize("arguments", [("simulate",), ("explore", "--no-browser", "--model", "tube_in_supports")])
def test_nothing_is_silent_on_a_terminal(tmp_path, arguments):
    """Never for a second of its processor time, with an empty cache: a busy machine may show it later, not it less."""
    process, mine = on_a_terminal(tmp_path, *arguments)
    said, times = "", [0.0]
    with contextlib.suppress(OSError):  # at the end of what it says
        while "http://" not in said:
            said += os.read(mine, 4096).decode()
            times.append(processor_time(process))
    process.terminate()
    process.wait()
    assert len(times) > 3
    assert max(np.diff(times)) <= 1.0, said
    assert "loading ... " in said or times[1] < 0.5


def test_a_passing_line_goes_on_after_whole_lines_and_leaves_alone_what_others_write(monkeypatch):
    stream = io.StringIO()
    monkeypatch.setattr(progress, "PULSE", 0.0)
    monkeypatch.setattr(sys, "stderr", stream)
    with progress.Pulse() as pulse:
        for text, waits_for in ("a line\n", "computing"), ("half of one", ""), ("\r", "computing"):
            sys.stderr.write(text)
            assert pulse.waits_for == waits_for
        progress.wait_for_others()
        assert pulse.waits_for == ""
    assert stream.getvalue().endswith("\r")
    assert progress.Pulse.latest is None  # what is called in this process later on shows its own progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


def shown_at_once(stream):
    """Return a report after which the thread that shows it has its turn, however short the computation is."""
    report = progress.Passing.__call__

    def reported(line, *news):
        report(line, *news)
        shown = len(stream.getvalue())
        until(lambda: len(stream.getvalue()) > shown)

    return reported


@pytest.fixture
def said(monkeypatch):
    """Run a call on a terminal, without patience; return the lines that passed."""

    def of(call, stream=None):
        monkeypatch.setattr(progress, "PULSE", 1e-4)
        monkeypatch.setattr(compiling, "SILENT", 0.0)
        stream = stream or Terminal()
        with monkeypatch.context() as within:
            within.setattr(sys, "stderr", stream)
            within.setattr(progress.Passing, "__call__", shown_at_once(stream))
            call()
        return [line for line in stream.getvalue().split("\r") if line.strip()]

    return of


OSC, GRID = vi.ImpactOscillator(omega=2.8), {"omega": np.linspace(2.0, 3.0, 40), "early_closing": False}
LONG = {
    "cells": lambda **how: vi.parameter_map(OSC, **GRID, **how),
    "values": lambda **how: vi.bifurcation_diagram(OSC, omega=GRID["omega"], sample_impacts=2000, **how),
    "initial conditions": lambda **how: vi.attractors(OSC, **how),
    "orbits": lambda **how: vi.continue_orbit(vi.find_orbit(OSC)[0], "omega", (2.0, 3.0), **how),
    "parts": lambda **how: vi.describe(OSC, **how),
}


@pytest.mark.parametrize("label", LONG)
def test_on_a_terminal_a_long_computation_shows_how_far_it_is_unless_it_is_told_not_to(said, label):
    lines = said(LONG[label])
    assert lines
    assert all(line.startswith((label, "compiling", "orbits ... ")) for line in lines)
    assert any(" % of " in line or line.startswith(f"{label}: ") for line in lines)
    quiet = said(lambda: LONG[label](progress=False))
    assert [line for line in quiet if not line.startswith(("compiling", "orbits ... "))] == []
    assert said(LONG[label], io.StringIO()) == []  # a file


@pytest.mark.parametrize(("shell", "seen"), [(SimpleNamespace(kernel=...), True), (object(), False), (None, False)])
def test_a_passing_line_is_shown_in_notebooks_of_any_kind(said, monkeypatch, shell, seen):
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    assert bool(said(LONG["cells"], io.StringIO())) == seen


def test_a_passing_line_is_gone_at_the_end_and_is_not_shown_within_another_nor_in_threads(said):
    stream = Terminal()
    said(lambda: vi.simulate(OSC, periods=200_000, samples_per_period=1), stream)
    assert "motion ... " in stream.getvalue()
    assert stream.getvalue().endswith("\r")
    mine = []
    assert said(lambda: vi.describe(OSC, progress=lambda *news: mine.append(news))) == []
    assert mine

    def in_a_thread():
        thread = threading.Thread(target=LONG["cells"])
        thread.start()
        thread.join()

    assert said(in_a_thread) == []


COUNT = """
import sys
import numba.core.event as event
import vibroimpact as vi
from vibroimpact import compiling

compiling.SILENT = float("inf")
compiled = []
event.register("numba:compile", type("Count", (event.Listener,), {
    "on_start": lambda self, event: compiled.append(event.data["dispatcher"].__name__), "on_end": lambda *_: None})())
"""


def counted(cache, *lines):
    """Return how many functions each of some lines compiles, in one process."""
    counts = "".join(f"before = len(compiled); {line}; print(len(compiled) - before)\n" for line in lines)
    told = python(COUNT + counts, env=with_cache(cache))
    return [int(line) for line in told.stdout.splitlines()]


@pytest.mark.long
def test_a_first_map_of_a_system_compiles_about_as_much_as_one_of_one_mass(tmp_path):
    """Functions are what compiling takes its time for; there were 337 once of any system, in each kernel anew."""
    (one,) = counted(tmp_path / "one", "vi.parameter_map(vi.ImpactOscillator(), omega=[1.0, 2.0])")
    first, closing, section, simulated = counted(
        tmp_path / "system",
        "vi.parameter_map(vi.models.impact_damper(), omega=[1.0, 2.0])",
        "vi.parameter_map(vi.models.two_sided_oscillator(), omega=[1.0, 2.0])",
        "vi.impact_section(vi.models.impact_damper())",
        "vi.simulate(vi.models.two_sided_oscillator(), periods=3)",
    )
    assert first < one
    assert first + closing < 1.5 * one
    assert section + simulated < 0.75 * one


LAW = """vi.ImpactSystem(
    mass=1.0, damping=0.1, stiffness=1.0, force=vi.Force(omega=1.0, harmonics={1: 1.0}),
    stops=[vi.Stop(direction=1.0, gap=0.1, restitution=lambda v: 1.0 / (1.0 + v))],
)"""


def test_python_calls_only_kernels_that_are_kept_and_not_interrupted():
    """One that other kernels are meant to call would be compiled in each process, where Ctrl-C would be lost."""
    code = (
        "import threading, numba.core.event as event, vibroimpact as vi\n"
        "from vibroimpact import compiling\n"
        "from vibroimpact.kernels.shared import interrupts\n"
        "def begun(self, event):\n"
        "    if threading.current_thread() is not threading.main_thread(): return  # Ctrl-C does not come there\n"
        "    if not compiling.under_way() and interrupts._kept is None: print(event.data['dispatcher'].__name__)\n"
        "methods = {'on_start': begun, 'on_end': lambda *_: None}\n"
        "event.register('numba:compile', type('Begun', (event.Listener,), methods)())\n"
        f"for model in (vi.ImpactOscillator(), vi.models.impact_damper(), {LAW}):\n"
        "    for compute in (vi.simulate, vi.impact_section, vi.attractors, vi.describe, vi.find_orbit):\n"
        "        compute(model)\n"
        "    vi.parameter_map(model, omega=[1.0, 1.2], indices='all')\n"
    )
    done = python(code)
    assert (done.stdout, done.returncode) == ("", 0), done.stderr


@pytest.mark.long
def test_what_a_kernel_is_interrupted_at_is_compiled_before_the_interrupt_is_felt(tmp_path):
    """No exception can pass through a kernel that waits for a part of it."""
    code = (
        "import os, signal, xarray, vibroimpact as vi\n"
        "from vibroimpact import compiling\n"
        "def interrupt():\n"
        "    if compiling.under_way() == 'starts of systems': os.kill(os.getpid(), signal.SIGINT)\n"
        "compiling.SILENT = 0.0\n"
        "compiling.watching.append(interrupt)\n"
        "try:\n"
        "    for _ in range(1000): vi.impact_section(vi.models.impact_damper())\n"
        "except KeyboardInterrupt:\n"
        "    print('felt', len(vi.impact_section(vi.models.impact_damper()).impact) > 0)\n"
    )
    ended = python(code, env=with_cache(tmp_path))
    assert (ended.stdout, ended.returncode) == ("felt True\n", 0), ended.stderr


def test_an_interrupt_that_comes_as_a_kernel_asks_for_a_part_is_felt_later(monkeypatch):
    """On a busy machine the kept signal may arrive between two parts: an exception there would end the process."""
    later, felt = [], []
    monkeypatch.setattr(interrupts, "_raise_later", later.append)
    former = signal.signal(signal.SIGINT, lambda number, frame: felt.append(number))
    try:
        with interrupts.uninterrupted():
            with interrupts.uninterrupted():  # a part of a kernel is compiled while a kernel asks for it
                signal.raise_signal(signal.SIGINT)
            assert (later, felt) == ([], [])
        assert (later, felt) == ([signal.SIGINT], [])
        asked = SimpleNamespace(f_code=deferred._address.__code__, f_back=None)
        # asked for a part, it waits for the thread that raises the signal later
        waits = SimpleNamespace(f_code=threading.Thread.start.__code__, f_back=asked)
        signal.getsignal(signal.SIGINT)(signal.SIGINT, waits)
        assert (later, felt) == ([signal.SIGINT] * 2, [])
        signal.raise_signal(signal.SIGINT)
        assert (later, felt) == ([signal.SIGINT] * 2, [signal.SIGINT])
    finally:
        signal.signal(signal.SIGINT, former)


def test_a_kept_interrupt_wakes_a_program_that_waits_for_events():
    """As the explorer does: raised in another thread, the signal would be felt only when the next event comes."""
    events, source = os.pipe()
    event = threading.Timer(60.0, os.write, [source, b"a click"])
    former = signal.signal(signal.SIGINT, signal.default_int_handler)
    event.start()
    try:
        with interrupts.uninterrupted():
            signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            select.select([events], [], [])
        assert not event.finished.is_set()
    finally:
        event.cancel()
        event.join()
        signal.signal(signal.SIGINT, former)
        os.close(events)
        os.close(source)


@pytest.mark.long
def test_warming_up_compiles_every_driver():
    # In a process of its own, as another test may have imported the paper's scheme, which is compiled when asked for.
    code = """
from vibroimpact import warming
from vibroimpact.kernels.shared import deferred, machine
for family in warming.FAMILIES:
    family()
done = set()
while parts := set(deferred.noted()) - done:  # a part may ask for others
    done |= parts
    for part in parts:
        deferred.compile_part(part)
told = machine._announcements
print(len(told), [what for driver, (what, *_) in told.items() if not driver.signatures])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    number, _, left = done.stdout.partition(" ")
    assert int(number) > 0
    assert left.strip() == "[]"


def test_a_process_that_has_computed_nothing_compiles_any_part():
    """As one that helps to warm up, and gets parts of kernels that another one has compiled."""
    vi.parameter_map(vi.models.impact_damper(), indices=["std", "lyapunov"], omega=[1.0, 2.0], sample_impacts=50)
    code = (
        "import sys, pickle; from vibroimpact.kernels.shared import deferred\n"
        "parts = deferred.noted(); print(len(parts))\n"
        "for part in parts: pickle.loads(part); deferred.compile_part(part)"
    )
    (count,) = python(code).stdout.split()
    assert int(count) > 10


def test_garbage_is_looked_for_again_once_nothing_is_compiled(monkeypatch):
    announcer, outer, inner = machine._Announcer(), "outer", "inner"
    monkeypatch.setattr(machine, "_announcements", dict.fromkeys((outer, inner), ("nothing", 0.1, "")))
    begun, ended = (
        [Event("numba:compile", status, {"dispatcher": what}) for what in (outer, inner)]
        for status in (EventStatus.START, EventStatus.END)
    )
    announcer.on_start(begun[0])
    announcer.on_start(begun[1])
    announcer.on_end(ended[1])
    assert not gc.isenabled()
    announcer.on_end(ended[0])
    assert gc.isenabled()


def test_what_is_compiled_does_not_count_as_computing(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(compiling, "perf_counter", lambda: now[0])
    before = compiling.clock()
    compiling.begin("nothing", 0.1, "")
    now[0] = 5.0
    assert (compiling.under_way(), compiling.clock() - before) == ("nothing", 0.0)
    compiling.end()
    now[0] = 6.0
    assert (compiling.under_way(), compiling.clock() - before) == ("", 1.0)


def test_of_two_processes_one_compiles_and_the_other_waits(tmp_path):
    """Both come to the same driver at the same moment; whoever waits finds what was compiled."""
    code = (
        "import sys; from vibroimpact.kernels import recorder\n"
        "import vibroimpact as vi; print('ready', flush=True); sys.stdin.readline()\n"
        "vi.simulate(vi.ImpactOscillator(), periods=1)\n"
        "print(sum(recorder.record.stats.cache_misses.values()))"
    )
    where, pipe = with_cache(tmp_path), subprocess.PIPE
    both = [
        subprocess.Popen([sys.executable, "-c", code], env=where, stdin=pipe, stdout=pipe, text=True) for _ in range(2)
    ]
    for process in both:
        assert process.stdout.readline() == "ready\n"
    for process in both:
        process.stdin.write("\n")
        process.stdin.flush()
    assert sorted(int(process.communicate()[0]) for process in both) == [0, 1]


@pytest.mark.long
@pytest.mark.skipif(worker_count(None) < 2, reason="needs a second core")
def test_beside_a_first_command_a_second_process_compiles_what_a_next_one_needs(tmp_path):
    model = "--model", "two_sided_oscillator"
    lines = [line for line in run(tmp_path, "map", *model, "--x", "frequency=24:26:3") if TOLD.fullmatch(line)]
    assert any("maps of systems" in line for line in lines)
    assert list(tmp_path.rglob("walk._follow*.nbc"))  # what follows single motions, which a map has no need of


@pytest.fixture
def two_cores(monkeypatch):
    """Let there be room for a second process, and none yet."""
    monkeypatch.setattr(beside, "_processes", [])
    monkeypatch.setattr(compiling, "watching", [])
    monkeypatch.setattr(threads, "worker_count", lambda workers: 2)


@pytest.mark.usefixtures("two_cores")
def test_a_model_that_cannot_be_handed_on_is_compiled_for_by_its_own_process(monkeypatch):
    monkeypatch.setattr(compiling, "under_way", lambda: "maps")
    beside.compile_beside(lambda: vi.ImpactOscillator(restitution=lambda velocity: 0.5))
    (start,) = compiling.watching
    start()
    assert not beside._processes
    assert not compiling.watching


@pytest.mark.usefixtures("two_cores")
def test_one_second_process_at_most_waits_and_none_begins_when_nothing_is_compiled(monkeypatch):
    begun = []
    monkeypatch.setattr(
        beside.subprocess, "Popen", lambda *how, **what: begun.append(how) or SimpleNamespace(stdin=None)
    )
    for _ in range(100):  # commands of one process
        beside.compile_beside(vi.ImpactOscillator)
    compiling.begin("what is not told", 0.1, "")
    compiling.end()
    assert not begun
    monkeypatch.setattr(compiling, "SILENT", 1.0)
    for _ in range(3):
        compiling.begin("what is told", 2.0, "")
        compiling.end()
        beside.compile_beside(vi.ImpactOscillator)
    assert len(begun) == 1
