"""Compute the stored values anew, beside those in tests/data/values.json: `python tests/oracles/values.py`.

What is stored was computed by other code: that the two agree is the proof. `recomputed` yields the values
one by one, so that a test can check a few.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import mpmath as mp

sys.path.insert(0, str(Path(__file__).parents[1]))

from oracles.cycles import by_flights, grazing, one_impact, period_doubling, stability
from oracles.motion import Oscillator, by_matrix, end_of_chatter, impacts

STORED = Path(__file__).parents[1] / "data" / "values.json"
Pair = tuple[str, mp.mpf, str]  # what it is, its value, and what is stored


def recomputed(stored: dict[str, Any], impacts_each: int = 20) -> Iterator[Pair]:
    """Yield every value but the averages over chaos, with as many impacts of each listed orbit as asked for."""
    yield from _one_impact(stored["period_n_impact_1"])
    yield from _boundaries(stored)
    yield from _two_impacts(stored["period_1_impact_2"])
    yield from _listed(stored["first_20_impacts"], impacts_each)
    yield from _sticking(stored["sticking_w=0.1"], 3 * impacts_each)
    yield from _flows(stored["flow_values"])
    chatter = 2 * mp.nsum(lambda j: mp.atan(mp.mpf("0.8") ** j), [1, mp.inf])
    yield "static chatter", chatter, stored["static_chatter_f=0_c=0_m=k=1_g=-1"]["t_inf"]


def _one_impact(stored: dict[str, Any]) -> Iterator[Pair]:
    for name, known in stored.items():
        osc = Oscillator(w=mp.mpf(name[2:5]))
        v, phase = one_impact(osc)
        trace, determinant = stability(osc, [(phase * osc.period, v), ((phase + 1) * osc.period, v)])
        again = by_flights(osc, [phase * osc.period, v])
        for what, value in (("v", v), ("phase_frac", phase), ("trace", trace), ("det", determinant)):
            yield f"{name} {what}", value, known[what]
        yield f"{name} v by flights", again[1], known["v"]


def _boundaries(stored: dict[str, Any]) -> Iterator[Pair]:
    for known in stored["period_doubling_w_of_n=1"]:
        guess = mp.mpf(known["w"][:5])
        yield "period doubling", period_doubling((guess, guess + mp.mpf("1e-3"))), known["w"]
    (known,) = stored["grazing_w_of_n=1"]
    w, turns = grazing((known["w"][:5], known["tau_graze_over_T"][:4]))
    yield "grazing", w, known["w"]
    yield "grazing, turns", turns, known["tau_graze_over_T"]


def _two_impacts(stored: dict[str, Any]) -> Iterator[Pair]:
    for name, known in stored.items():
        osc = Oscillator(w=mp.mpf(name[2:]))
        guess = [mp.mpf(known["t_a"][:4]), mp.mpf(known["t_a"][:4]) + mp.mpf(known["t_b_minus_t_a"][:4])]
        a, b, v_a, v_b = by_flights(osc, [*guess, mp.mpf(known["v_a"][:5]), mp.mpf(known["v_b"][:5])])
        trace, determinant = stability(osc, [(a, v_a), (b, v_b), (a + osc.period, v_a)])
        found = {"v_a": v_a, "v_b": v_b, "t_a": a, "t_b_minus_t_a": b - a, "trace": trace, "det": determinant}
        found |= {"mean": (v_a + v_b) / 2, "std": abs(v_a - v_b) / 2}
        for what, value in found.items():
            yield f"{name} {what}", value, known[what]


def _listed(stored: dict[str, Any], number: int) -> Iterator[Pair]:
    starts = {"w=2.8,y-1": (mp.mpf(0), mp.mpf(-1)), "w=0.9,liftoff": (None, mp.mpf(0))}
    for name, known in stored.items():
        osc = Oscillator(w=mp.mpf(name[2:5]))
        time, y = starts[name]
        time = osc.period / 2 if time is None else time
        for listed, (t, v) in zip(islice(known["impacts"], number), impacts(osc, time, y, mp.mpf(0)), strict=False):
            yield f"{name} t of impact {listed['j']}", t, listed["t"]
            yield f"{name} v of impact {listed['j']}", v, listed["v"]


def _sticking(known: dict[str, Any], number: int) -> Iterator[Pair]:
    osc = Oscillator(w=mp.mpf("0.1"))
    release = osc.period / 2
    yield "release", release, known["lift_off_t"]
    hits = list(islice(impacts(osc, release, mp.mpf(0), mp.mpf(0)), number))
    for listed, (t, v) in zip(known["impacts"], hits, strict=False):
        yield f"chatter t of impact {listed['j']}", t - release, listed["t_minus_liftoff"]
        yield f"chatter v of impact {listed['j']}", v, listed["v"]
    for cut, (count, mean, std) in known["std_if_series_cut_at_v_threshold"].items():
        kept = [v for _, v in hits if v > mp.mpf(cut)]
        if int(count) < number:
            average = mp.fsum(kept) / len(kept)
            yield f"impacts above {cut}", mp.mpf(len(kept)), count
            yield f"mean above {cut}", average, mean
            yield f"std above {cut}", mp.sqrt(mp.fsum((v - average) ** 2 for v in kept) / len(kept)), std
    if number >= 150:  # its end is exact to third order in the tail, some 1e-14 after 150 impacts
        end = end_of_chatter(osc, *hits[-1]) - release
        yield "end of the chatter", end, known["t_accumulation_minus_liftoff"]
        yield "time stuck", osc.period - end, known["stuck_duration"]


def _flows(stored: dict[str, Any]) -> Iterator[Pair]:
    for name, known in stored.items():
        m, c, k, f, w = map(mp.mpf, known["m_c_k_f_w"])
        start = (mp.mpf("0.2"), mp.mpf("-0.3"), mp.mpf("0.4"), mp.mpf(known["tau"]))
        for what, value, text in zip("yv", by_matrix(Oscillator(m, c, k, f, w), *start), known["y_v"], strict=True):
            yield f"flow {name} {what}", value, text


def agrees(value: mp.mpf, text: str) -> bool:
    """Return whether a value is what is stored, to all the digits that are but the last."""
    digits = len(text.split("e")[0].partition(".")[2])
    return bool(abs(value - mp.mpf(text)) <= mp.mpf(10) ** (1 - digits))


def main() -> int:
    """Print every value; return how many differ."""
    wrong = 0
    for what, value, text in recomputed(json.loads(STORED.read_text(encoding="utf-8")), impacts_each=60):
        same = agrees(value, text)
        wrong += not same
        print(f"{'' if same else 'DIFFERS '}{what}: {mp.nstr(value, 50)} (stored {text})")
    return wrong


if __name__ == "__main__":
    sys.exit(main())
