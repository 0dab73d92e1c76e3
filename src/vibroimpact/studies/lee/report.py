"""The report: one self-contained HTML file."""

from __future__ import annotations

from base64 import b64encode
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template

from vibroimpact.studies.lee.claims import Claim, Outcome
from vibroimpact.studies.lee.paper import CITATION, TIME_STEP, WINDOW, Plate
from vibroimpact.studies.lee.rules import Verdict

Tested = tuple[Claim, Outcome]

TITLE = "Impact vibration with one and two control parameters: the study, computed again"
HEADINGS = {
    "3": "Control of one parameter",
    "3.1": "Sticking motion",
    "3.2": "Chaotic motion I",
    "3.3": "Periodic motion",
    "3.4": "Chaotic motion II",
    "3.5": "Statistical index of the diagram",
    "4.1": "Driving frequency and mass",
    "4.2": "Driving frequency and damping",
    "4.3": "Driving frequency and stiffness",
    "4.4": "Driving frequency and forcing amplitude",
    "4.5": "Driving frequency and restitution coefficient",
    "5": "Conclusions",
}
# Sentences of sections 3 to 5 that state no result, and why they are not tested.
NOT_TESTED = (
    ("3, 4", "parameters, sampling and mesh", "settings; they are used as printed"),
    ("3", "numerical solutions are provided for the full region; knowledge ... is essential", "an aim, not a result"),
    ("4.1", "This diagram is a useful tool for designing an impact system", "an opinion"),
    ("5", "To minimize the computing cost, the statistical index of Std is calculated", "a motive, not a result"),
    ("5", "The present findings expand our understanding", "an opinion"),
)
BADGES = {Verdict.HOLDS: ("holds", "✓"), Verdict.LAST_DIGIT: ("last", "≈"), Verdict.FAILS: ("fails", "✗")}


def write(
    path: Path, plates: Sequence[Plate], tested: Sequence[Tested], facts: Mapping[str, str], level: float
) -> None:
    """Write the report next to the folders `figures` and `data`."""
    template = Template(files("vibroimpact.studies.lee").joinpath("report.html").read_text(encoding="utf-8"))
    sections = dict.fromkeys(claim.section for claim, _ in tested)
    page = template.substitute(
        title=escape(TITLE),
        subtitle=escape(CITATION),
        summary=_summary(tested, level),
        contents=_contents(plates, list(sections)),
        figures="\n".join(_figure(plate, path.parent) for plate in plates),
        claims_intro=_introduction(),
        claims="\n".join(
            _section(number, [pair for pair in tested if pair[0].section == number]) for number in sections
        ),
        not_tested=_table("facts", ("section", "sentence", "why"), NOT_TESTED),
        provenance=_table("facts", ("", ""), facts.items()),
    )
    path.write_text(page, encoding="utf-8")


def tally(tested: Sequence[Tested]) -> dict[Verdict, int]:
    """Return the numbers of statements that hold, hold to the last digit, and do not hold."""
    counts = Counter(outcome.assessment.verdict for _, outcome in tested)
    return {verdict: counts[verdict] for verdict in Verdict}


def discrepancies(tested: Sequence[Tested]) -> list[Tested]:
    """Return up to five statements that do not hold, most important first, each sentence once."""
    failed = [pair for pair in tested if pair[1].assessment.verdict is Verdict.FAILS]
    failed.sort(key=lambda pair: -pair[0].importance)
    once: dict[str, Tested] = {}
    for claim, outcome in failed:
        once.setdefault(outcome.because, (claim, outcome))
    return list(once.values())[:5]


def _summary(tested: Sequence[Tested], level: float) -> str:
    boxes = "".join(
        f'<div><b class="{BADGES[verdict][0]}">{BADGES[verdict][1]} {count}</b>{verdict.value}</div>'
        for verdict, count in tally(tested).items()
    )
    worst = "".join(
        f'<li>“{escape(claim.quotation)}” (<a href="#c{claim.id}">{claim.id}</a>): {escape(outcome.because)}.</li>'
        for claim, outcome in discrepancies(tested)
    )
    return (
        f"<p>{len(tested)} statements about results in the paper's sections 3 to 5 were tested against exact "
        "event-driven motion, each by a written rule from numbers computed in this run.</p>"
        f'<div class="tally">{boxes}</div>'
        f"<p>The most important discrepancies:</p><ol>{worst}</ol>"
        f"<p>Boundaries of stability are drawn at Std = {level:g} m/s, the argument <code>level</code>. "
        "The paper's equation 1 prints <em>k</em> times the velocity; the spring force is <em>k</em> times the "
        "displacement, a misprint, since its w_n = √(k/m) needs the displacement.</p>"
    )


def _introduction() -> str:
    return (
        "<p>“Exact engine” steps from contact to contact without a time step: impacts, chatter, stick and release are "
        "found to rounding, and motions are named by the recurrence of their settled impacts. “Fixed-step window” is "
        f"the paper's own scheme, fourth-order Runge-Kutta at {TIME_STEP:g} s from rest at the stop, read between "
        f"{WINDOW[0]:g} and {WINDOW[1]:g} s; it is given where it explains a number. The rule behind each "
        "verdict is in small print. <em>Last digit</em>: off by one unit of the last digit printed.</p>"
    )


def _contents(plates: Sequence[Plate], sections: Sequence[str]) -> str:
    entries = [("#summary", "Summary")]
    entries += [(f"#{plate.name}", f"Figure {plate.number}. {plate.title}") for plate in plates]
    entries += [(f"#s{number}", f"Statements of section {number}: {HEADINGS[number]}") for number in sections]
    entries += [("#not-tested", "Sentences not tested"), ("#provenance", "Settings and provenance")]
    return "<ul>" + "".join(f'<li><a href="{link}">{escape(text)}</a></li>' for link, text in entries) + "</ul>"


def _figure(plate: Plate, folder: Path) -> str:
    picture = b64encode((folder / "figures" / f"{plate.name}.png").read_bytes()).decode("ascii")
    links = [(f"figures/{plate.name}.{ending}", ending.upper()) for ending in ("png", "svg")]
    links += [(f"data/{key}.zarr/", f"{key}.zarr") for key in plate.data]
    shown = ", ".join(f'<a href="{link}">{text}</a>' for link, text in links)
    return (
        f'<figure id="{plate.name}"><img alt="{escape(plate.caption, quote=True)}" '
        f'src="data:image/png;base64,{picture}"><figcaption><strong>Figure {plate.number}.</strong> '
        f"{escape(plate.caption)} [{shown}]</figcaption></figure>"
    )


def _section(number: str, tested: Sequence[Tested]) -> str:
    rows = "".join(_row(claim, outcome) for claim, outcome in tested)
    counts = ", ".join(f"{count} {verdict.value}" for verdict, count in tally(tested).items() if count)
    return (
        f'<h3 id="s{number}">Section {number}: {HEADINGS[number]} <span class="note">({counts})</span></h3>'
        '<div class="wide"><table class="claims"><thead><tr><th>id</th><th>the paper says</th><th>exact engine</th>'
        f"<th>fixed-step window</th><th>verdict, and why</th></tr></thead><tbody>{rows}</tbody></table></div>"
    )


def _row(claim: Claim, outcome: Outcome) -> str:
    style, mark = BADGES[outcome.assessment.verdict]
    verdict = f'<span class="badge {style}">{mark} {outcome.assessment.verdict.value}:</span>'
    return (
        f'<tr id="c{claim.id}"><td>{claim.id}</td><td>“{escape(claim.quotation)}”'
        f'<span class="says">{escape(claim.says)}</span></td><td>{escape(outcome.exact)}</td>'
        f"<td>{escape(outcome.fixed_step)}</td><td>{verdict}{escape(outcome.because)}"
        f'<span class="rule">Rule: {escape(outcome.assessment.rule)}.</span></td></tr>'
    )


def _table(style: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head) if any(head) else ""
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<table class="{style}">{top and f"<thead><tr>{top}</tr></thead>"}<tbody>{body}</tbody></table>'
