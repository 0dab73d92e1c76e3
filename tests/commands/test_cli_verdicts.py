"""The commands on verdicts, comparisons and coexisting motions, as a user types them."""

import json
import re

import pytest

import vibroimpact as vi
from processes import is_png

# Verdicts


def test_a_verdict_is_told_in_words_and_as_json(run):
    code, lines, _ = run("describe -p omega=1.4 --vary w --full")
    assert code == 0
    assert any(line.startswith("motion      from rest period-1 impact-1") for line in lines)
    assert any(re.match(r"  omega \[rad/s\] +1.25896 +period doubling", line) for line in lines)
    assert any(line.strip().startswith("0.20037 Hz") for line in lines)
    assert lines == str(vi.describe(vi.ImpactOscillator(omega=1.4), parameters=["omega"])).splitlines()
    _, lines, _ = run("describe -p omega=1.4 --vary omega --json")
    assert json.loads("\n".join(lines))["motion"]["name"] == "period-1 impact-1"


@pytest.mark.long
@pytest.mark.parametrize(
    ("options", "lines"),
    [
        (
            "-p omega=2.6",
            ["motion .*", r"hardest .*, from 67 % of the initial .*: period-3 impact-3", "advice .*softer"],
        ),
        ("-p gap=3", ["motion .* no impact", "advice .*no impacts from rest or from any of"]),
        (
            "-p omega=2.8",
            ["motion .* chaotic", "hardest .* of those sampled, from 100 %", "advice .*no longer chaotic"],
        ),
        ("--model two_sided_oscillator", ["motion .*", "hardest .* m/s on left, from 100 %", "advice .*"]),
    ],
)
def test_a_verdict_is_short_unless_all_of_it_is_asked_for(run, options, lines):
    vary = "frequency" if "model" in options else "omega"
    code, printed, complaints = run(f"describe {options} --vary {vary}")
    assert (code, len(printed) <= 6) == (0, True)  # of 88 characters
    assert re.search(".*".join(lines), " ".join(" ".join(printed).split()))
    assert complaints[-1].startswith("--full shows")


def test_two_designs_are_set_side_by_side_and_drawn(run, tmp_path):
    (tmp_path / "slow.toml").write_text("[oscillator]\nomega = 1.4\n")
    (tmp_path / "fast.toml").write_text("[oscillator]\nomega = 2.0\n")
    for out in ("both.nc", "both.json"):
        code, lines, _ = run(f"compare slow.toml fast.toml --vary gap --out {out}")
        assert (code, lines[0].split()) == (0, ["slow", "fast"])
        assert lines[-1] == f"wrote {out}"
    assert run("plot both.nc --out both.png --dpi 50")[0] == 0
    assert is_png(tmp_path / "both.png")
    assert list(json.loads((tmp_path / "both.json").read_text())) == ["slow", "fast"]
    assert run("plot both.nc")[1][0] == "slow and fast: period-1 impact-1 and period-1 impact-1"


def test_a_design_compared_with_itself_has_two_names(run, tmp_path):
    (tmp_path / "a.toml").write_text("[oscillator]\nomega = 2.0\n")
    _, lines, _ = run("compare a.toml a.toml --vary gap")
    assert lines[0].split() == ["a", "A", "a", "B"]


@pytest.mark.usefixtures("stopped_early")
def test_an_interrupted_verdict_tells_what_it_found(run, tmp_path):
    code, lines, complaints = run("describe -p omega=2.0")
    assert code == 130
    assert any(line.startswith("motion      from rest period-1 impact-1") for line in lines)
    assert "what was found so far is shown" in complaints[-1]


# Attractors


def test_the_motions_that_coexist_are_listed_with_their_shares(run):
    found = vi.attractors(vi.ImpactOscillator(omega=1.45))
    _, lines, notes = run("attractors -p frequency=0.2307747Hz")
    assert lines[0] == "2 attractors found; shares of the initial conditions:"
    assert [re.match(r"  (\S+) % (\S+ \S+), hardest hit (\S+) m/s", line).groups() for line in lines[1:3]] == [
        (f"{100 * one.share:.3g}", one.name, f"{one.max_velocity:.4g}") for one in found
    ]
    assert "frequency 0.230775 Hz" in "\n".join(notes)
    assert any("initial conditions" in note and "100 %" in note for note in notes)


def test_attractors_as_json_are_those_of_the_function(run):
    found = vi.attractors(vi.ImpactOscillator(omega=3.0))
    content = json.loads("\n".join(run("attractors -p omega=3 --json")[1]))
    assert content["oscillator"]["omega"] == 3.0
    assert [(row["name"], row["share"]) for row in content["attractors"]] == [(one.name, one.share) for one in found]
    assert [row["velocities"] for row in content["attractors"]] == [list(one.velocities) for one in found]
    assert content["attractors"][1]["lyapunov"] == "-inf"  # it sticks
    start = content["attractors"][0]["start"]
    assert vi.State(**start) == found[0].start
    slot = json.loads("\n".join(run("attractors --model two_sided_oscillator --json")[1]))["attractors"]
    assert slot[0]["stops"] == ["left", "right"]
    assert "orbit" not in slot[0]


def test_attractors_without_a_stop_are_refused(refused, tmp_path):
    (tmp_path / "free.py").write_text("import vibroimpact as vi\nfree = vi.ImpactSystem(mass=1.0, stiffness=1.0)\n")
    assert "must have a stop" in refused("attractors --model free.py:free")
