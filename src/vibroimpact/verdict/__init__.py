"""What a design does, how far it is from other motions, and what softens its impacts; two designs side by side."""

from vibroimpact.verdict.advice import Advice
from vibroimpact.verdict.compare import Comparison, compare
from vibroimpact.verdict.describe import Verdict, describe
from vibroimpact.verdict.edges import Edge
from vibroimpact.verdict.present import Coexisting

__all__ = ["Advice", "Coexisting", "Comparison", "Edge", "Verdict", "compare", "describe"]
