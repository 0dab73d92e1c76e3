"""What a claim is, and how the statements of a section are collected."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from vibroimpact.studies.lee.laboratory import Laboratory
from vibroimpact.studies.lee.rules import Judgement, Verdict, cut_like, printed_value


@dataclass(frozen=True)
class Finding:
    """What was measured for one statement: the verdict, the numbers, and why in a sentence."""

    judgement: Judgement
    exact: str
    because: str
    fixed_step: str = ""


@dataclass(frozen=True)
class Claim:
    """One statement of the paper and the measurement that judges it.

    `importance` orders the discrepancies that the summary names first; it has no part in a verdict.
    """

    id: str
    section: str
    quotation: str
    says: str
    measure: Callable[[Laboratory], Finding]
    importance: int = 0


@dataclass
class Section:
    """Collects the claims of one section in the order in which they are written."""

    number: str
    claims: list[Claim] = field(default_factory=list)

    def claim(
        self, quotation: str, says: str, importance: int = 0
    ) -> Callable[[Callable[[Laboratory], Finding]], Callable[[Laboratory], Finding]]:
        """Register a measurement as the judge of a statement."""

        def register(measure: Callable[[Laboratory], Finding]) -> Callable[[Laboratory], Finding]:
            identity = f"{self.number}-{len(self.claims) + 1:02d}"
            self.claims.append(Claim(identity, self.number, quotation, says, measure, importance))
            return measure

        return register

    def value(
        self,
        quotation: str,
        printed: str,
        unit: str,
        measure: Callable[[Laboratory], float],
        *,
        what: str,
        fixed_step: Callable[[Laboratory], str] | None = None,
        importance: int = 0,
    ) -> None:
        """Register a printed number; `what` names the quantity in the sentence that says why."""

        def judge(lab: Laboratory) -> Finding:
            found = measure(lab)
            judgement = printed_value(found, printed)
            because = f"{what} is {found:.5g}{unit and ' ' + unit}; the paper prints {printed}"
            if judgement.verdict is Verdict.LAST_DIGIT and cut_like(found, printed):
                because += ", cut off instead of rounded"
            told = fixed_step(lab) if fixed_step else ""
            return Finding(judgement, f"{found:.6g}{unit and ' ' + unit}", because, told)

        self.claim(quotation, f"{printed}{unit and ' ' + unit}", importance)(judge)
