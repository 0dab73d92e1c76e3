"""Whatever is asked for, in whatever words, is answered or refused by name; seeded, ten times as much in `make fuzz`.

No exception but `ValueError` and `TypeError` that name an argument and `OSError` that names a path, no exit code but 0,
1 and 2 with one line, no call over 30 s of processor time (15 s on two cores), nothing half written, no memory beside
what was asked for.
"""

import json
import os
import re
import resource
import shlex
import signal
import sys
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from itertools import product
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import vibroimpact as vi
from calls import BRIEF, ODD, WRONG, arguments, calls
from vibroimpact.cli import main
from vibroimpact.report import sentences_of

TIMES = int(os.environ.get("FUZZ", "1"))
GIGABYTE = 1 << (20 if sys.platform != "darwin" else 30)  # in the unit of `ru_maxrss`
COMMANDS = [
    "simulate -p omega=1.4 --periods 2 --samples-per-period 10",
    "section -p w=1.4 --kind impact --sample-impacts 20 --transient-impacts 5",
    "section -p w=1.4 --kind stroboscopic --sample-periods 5 --phase 0.2 --start -1,0.5,0",
    "diagram --x omega=1:1.2:3 --sample-impacts 20 --indices std,lyapunov --direction up",
    "map --x omega=1:1.2:3 --y mass=1:2:2 --sample-impacts 20 --indices std --workers 1 --out a.nc --overwrite",
    "map --x omega=1:1.2:3 --sample-impacts 20 --starts 2 --out a.csv --overwrite --backend cpu",
    "orbit -p omega=1.4 --periods 1 --impacts 1",
    "continue -p omega=1.4 --x omega=1.39:1.41 --step 0.1",
    "basins -p omega=1.4 --phase 0:0.5:2 --velocity 0:1:2",
    "plot a.nc --kind index-curve --out a.svg --overwrite --size 5x4 --dpi 50",
    "info a.nc",
]
SCRAPS = [
    *("-1", "0", "1e999", "nan", "1e-320", "1e308", "1e12", "0x10", "1:2", "1:2:3", "2:1:3", "5x", "1e9x1e9", "0x0"),
    *(
        "omega=",
        "=1",
        "omega=1",
        "omega=1:2:0",
        "omega=1:2:1e9",
        "omega=a:b:c",
        "std",
        "std,std",
        "all",
        "a.nc",
        "a.zarr",
    ),
    *(".", "/", "/dev/null", "a.xyz", "--", "-h", "--x", "--out", "--overwrite", "--every-impact", "-p"),
]
STUDY = {
    "oscillator": {"mass": 1.0, "w": 2.0, "gap": 0.0},
    "axes": {"omega": {"from": 1.0, "to": 1.1, "points": 2}, "r": [0.5, 0.6]},
    "start": {"displacement": -1.0, "velocity": 0.0, "time": 0.0},
    "sampling": {"transient_impacts": 5, "sample_impacts": 20},
    "run": {"indices": ["std"], "backend": "cpu", "workers": 1, "early_closing": True},
    "tolerances": {"chatter_velocity": 1e-9},
}

scraps = st.one_of(
    st.sampled_from(ODD),
    st.text(max_size=8),
    st.floats(),
    st.integers(-3, 4),
    st.integers(min_value=2**40),
    st.lists(st.floats() | st.text(max_size=3) | st.none(), max_size=4),
    st.dictionaries(st.sampled_from(["omega", "mass", "a", "gap"]), st.floats() | st.text(max_size=3), max_size=2),
)
words = st.one_of(
    st.sampled_from(SCRAPS),
    st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=6),
)
values = st.recursive(
    st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=4)
    | st.sampled_from([10**400, "std", "cpu", "omega"]),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text("abx", min_size=1, max_size=2), inner, max_size=2)
    ),
    max_leaves=5,
)


def cases(number):
    return settings(
        max_examples=number * TIMES, derandomize=True, database=None, deadline=None,
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip


@contextmanager
def watched(*allowed, seconds=30):
    """Let a call fail in words only; let it end some time, leave nothing half written and no gigabyte behind."""

    def late(*_):
        raise AssertionError(f"a call of more than {seconds} s of processor time")

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, seconds)  # of processor time, which no other work lengthens
    marks: tuple[str, ...] = ()
    try:
        yield
    except (ValueError, TypeError) as error:
        refusal, marks = str(error), ("`", "unknown ", *(f"'{name}'" for name in allowed))
    except OSError as error:
        refusal, marks = str(error), ("`", *map(str, allowed))
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        plt.close("all")
    assert not marks or any(mark in refusal for mark in marks), refusal
    assert not [name for name in os.listdir() if name.startswith(".")]
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < GIGABYTE


def assert_ends_in_words(line):
    output, complaint = StringIO(), StringIO()
    with redirect_stdout(output), redirect_stderr(complaint):
        code = main(line)
    assert code in (0, 1, 2), code
    if code:
        (why,) = complaint.getvalue().splitlines()
        assert not re.match(r"vibroimpact: \w+(Error|Exception|Warning):", why), why


def toml(value):
    """Return a value as TOML writes it."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {toml(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return repr(value) if isinstance(value, float) else json.dumps(value)


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.long(but=1)
@pytest.mark.parametrize("part", range(4))
def test_each_argument_of_each_function_by_itself(part):
    for name in sorted(calls())[part::4]:
        function, right = calls()[name]
        known = arguments(function)
        for argument, wrong in product(known, WRONG):
            with watched(argument, wrong):
                function(**{name: BRIEF[name] for name in BRIEF if name in known} | right | {argument: wrong})


@cases(200)
@given(st.data())
def test_arguments_of_the_api(data):
    function, right = calls()[data.draw(st.sampled_from(sorted(calls())))]
    known = arguments(function)
    wrong = data.draw(st.dictionaries(st.sampled_from(known), scraps, min_size=1, max_size=2))
    with watched(*wrong, *wrong.values()):
        function(**{name: BRIEF[name] for name in BRIEF if name in known} | right | wrong)


@pytest.mark.long
@cases(150)
@given(st.data())
def test_study_files(data):
    study = {name: dict(table) for name, table in STUDY.items()}
    for _ in range(data.draw(st.integers(1, 2))):
        table = data.draw(st.sampled_from(sorted(study)))
        if data.draw(st.booleans()) and isinstance(study[table], dict):
            study[table][data.draw(st.sampled_from([*sorted(study[table]), "x"]))] = data.draw(values)
        else:
            study[table] = data.draw(values)
    text = "\n".join(f"{name} = {toml(value)}" for name, value in study.items())
    cut, deep = data.draw(st.integers(0, 2 * len(text))), data.draw(st.sampled_from(["", "", "[", "{a="]))
    Path("study.toml").write_text(text[:cut] + 3000 * deep, encoding="utf-8")
    with watched():
        assert_ends_in_words(["map", "study.toml"])


@pytest.mark.long
@cases(150)
@given(st.data())
def test_command_lines(data):
    line = shlex.split(data.draw(st.sampled_from(COMMANDS)))
    for _ in range(data.draw(st.integers(1, 2))):
        at = data.draw(st.integers(1, len(line)))
        line[at : at + data.draw(st.integers(0, 1))] = [data.draw(words)]
    with watched():
        assert_ends_in_words(line)


def degenerate(rng):
    """Return a system of one to three coordinates: free masses, equal modes, no force, no damping, one stop or two."""
    n, stops, chain = int(rng.integers(1, 4)), [], np.zeros((3, 3))
    for i in range(2):
        chain[i : i + 2, i : i + 2] += [[1.0, -1.0], [-1.0, 1.0]]
    stiffness = [np.zeros((n, n)), 4.0 * np.eye(n), np.diag([1.0, 0.0, 0.0][:n]), chain[:n, :n]][rng.integers(4)]
    damping = rng.choice([0.0, 0.0, 0.1, 0.5]) * [np.eye(n), stiffness, np.diag([1.0, 0.0, 0.0][:n])][rng.integers(3)]
    for sign in (1, -1)[: rng.integers(1, 3)]:
        direction = rng.integers(-1, 2, n)
        direction[rng.integers(n)] = sign
        kind = {"restitution": rng.choice([0.0, 0.5, 1.0])} if rng.random() < 0.6 else {
            "stiffness": rng.choice([10.0, 1e4]), "damping": rng.choice([0.0, 1.0])}  # fmt: skip
        moves = {1: 0.1} if rng.random() < 0.15 else {}
        stops.append(vi.Stop(direction=direction, gap=rng.choice([0.0, 0.0, 0.3, 1.0]), motion=moves, **kind))
    load = {"harmonics": {1: rng.integers(-1, 2, n)}} if rng.random() < 0.5 else {}
    load |= {"constant": rng.integers(-1, 2, n)} if rng.random() < 0.4 else {}
    force = vi.Force(omega=rng.choice([1.3, 2.6]), **load)
    return vi.ImpactSystem(mass=np.eye(n), damping=damping, stiffness=stiffness, force=force, stops=stops)


def uses_of(model):
    """Return what may be asked of a system, each with the pictures of what comes back."""
    few, short = {"sample_impacts": 20, "transient_impacts": 5}, vi.Tolerances(flight_periods=30, steps_per_impact=30)
    gap, moving = model.stops[0].gap, np.ones(len(model.mass))
    names = ["lyapunov", "lyapunov_per_impact", "n_periods", "n_impacts", "max_velocity"]
    axes = {"displacement_0": [-0.1, 0.0], "velocity_0": [-0.5, 0.5]}
    plane = axes if len(moving) > 1 else {name.removesuffix("_0"): values for name, values in axes.items()}

    def recognised():
        vi.recognise(vi.impact_section(model, **few))

    def classified():
        vi.classify(vi.parameter_map(model, omega=[1.3, 1.4], indices=names, **few))

    def found():
        orbits = [orbit for n in (1, 2) for orbit in vi.find_orbit(model, n_periods=n)]
        for orbit in orbits[:1]:
            vi.continue_orbit(orbit, "stop_1_gap", (gap - 0.1, gap + 0.1), step=0.1)

    def attracted():
        vi.attractors(model, [vi.State(0.0 * moving), vi.State(0.0 * moving, -0.3 * moving)], tolerances=short, **few)

    return [
        (lambda: vi.simulate(model, periods=2, samples_per_period=20), ["time_history", "phase_portrait"]),
        (lambda: vi.impact_section(model, **few), ["impact_map"]),
        (lambda: vi.impact_statistics(vi.simulate(model, periods=2), rest_time=0.1), ["impact_histogram"]),
        (lambda: vi.stroboscopic_section(model, sample_periods=5, transient_periods=2), ["stroboscopic_map"]),
        (lambda: vi.bifurcation_diagram(model, stop_1_gap=[gap, gap + 0.1], **few), ["bifurcation_diagram"]),
        (lambda: vi.bifurcation_diagram(model, omega=[1.3, 1.4], direction="up", **few), []),
        (
            lambda: vi.parameter_map(model, omega=[1.3, 1.4], stop_1_gap=[gap, gap + 0.1], indices=names, **few),
            ["motion_map", "index_contour", "exponent_map"],
        ),
        (lambda: vi.basins(model, tolerances=short, **plane, **few), ["basin_portrait"]),
        *((call, []) for call in (recognised, classified, found, attracted)),
    ]


@pytest.mark.long(but=2)
@pytest.mark.parametrize("seed", range(13 * TIMES))
def test_degenerate_systems_are_answered_or_refused_in_words(seed):
    model = degenerate(np.random.default_rng([38, seed]))
    for use, pictures in uses_of(model):
        with watched():
            result = use()
            if result is not None:
                assert sentences_of(result)
            for picture in pictures:
                getattr(vi.plotting, picture)(result)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(1, 1 + 2 * TIMES))
def test_degenerate_systems_are_described_and_compared(seed):
    model = degenerate(np.random.default_rng([39, seed]))
    for use in (vi.describe, lambda one, **how: vi.compare(one, one.replace(stop_1_gap=1.1), **how)):
        with watched(seconds=1200):  # where nothing loses energy, 256 motions are watched for long
            assert str(use(model, parameters=[], tolerances=vi.Tolerances(flight_periods=30, steps_per_impact=30)))
