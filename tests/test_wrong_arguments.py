"""Whatever is given to a public function for an argument, it is refused by the argument's name, or means something."""

import inspect

import numpy as np
import pytest

import vibroimpact as vi

WRONG = ["x", 3, float("nan"), [], {}, object(), 10**400, [1, "a"], b"b", 1j, np.zeros((2, 2))]
OSC = vi.ImpactOscillator(omega=1.4)
BRIEF = {"sample_impacts": 20, "transient_impacts": 5, "sample_periods": 5, "transient_periods": 2, "periods": 1}
LINE = {"omega": [1.0, 1.1]}
# What is right in each; the rest is left out.
CALLS = {
    "simulate": {"osc": OSC},
    "impact_section": {"osc": OSC},
    "stroboscopic_section": {"osc": OSC},
    "bifurcation_diagram": {"osc": OSC, **LINE},
    "parameter_map": {"osc": OSC, **LINE},
    "attractors": {"osc": OSC, "starts": [vi.State(-1.0)]},
    "basins": {"osc": OSC, "phase": [0.0, 0.5], "velocity": [0.0, 1.0]},
    "find_orbit": {"osc": OSC},
    "describe": {"osc": OSC, "parameters": []},
    "compare": {"a": OSC, "b": OSC, "parameters": []},
    "classify": {},
    "recognise": {},
    "continue_orbit": {"parameter": "omega", "range": (1.39, 1.41)},
    "boundary_curves": {"osc": OSC, "parameters": ("omega", "gap"), "ranges": ((1.3, 1.4), (0.0, 0.1))},
    "save": {"path": "result.nc"},
    "load": {},
}


def faults(name, right):
    function = getattr(vi, name)
    known = inspect.signature(function).parameters
    brief = {key: value for key, value in BRIEF.items() if key in known}
    for parameter in known.values():
        if parameter.kind in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL):
            continue
        for wrong in WRONG:
            try:
                function(**brief | right | {parameter.name: wrong})
            except (ValueError, TypeError) as error:
                if "`" not in str(error) and "unknown" not in str(error):
                    yield parameter.name, wrong, type(error).__name__, str(error)
            except OSError as error:
                if repr(wrong) not in str(error):
                    yield parameter.name, wrong, type(error).__name__, str(error)
            except Exception as error:
                yield parameter.name, wrong, type(error).__name__, str(error)


@pytest.mark.parametrize("name", CALLS)
def test_a_wrong_argument_is_refused_by_its_name(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    right = dict(CALLS[name])
    if name == "continue_orbit":
        right["orbit"] = vi.find_orbit(OSC)[0]
    if name == "recognise":
        right["section"] = vi.impact_section(OSC, sample_impacts=20)
    if name in ("save", "classify"):
        right["dataset" if name == "save" else "sweep"] = vi.parameter_map(OSC, **LINE, sample_impacts=20)
    found = list(faults(name, right))
    assert not found, found[0]
    assert not list(tmp_path.glob(".*"))  # nothing half written
