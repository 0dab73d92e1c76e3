"""Every statement about results in the paper's sections 3 to 5, and the measurement that judges it."""

from vibroimpact.studies.lee.claims.base import Claim, Finding, Section
from vibroimpact.studies.lee.claims.section_3 import general
from vibroimpact.studies.lee.claims.section_3_1 import sticking
from vibroimpact.studies.lee.claims.section_3_2 import first_chaos, periodic, second_chaos
from vibroimpact.studies.lee.claims.section_3_5 import statistical
from vibroimpact.studies.lee.claims.section_4_1 import mass
from vibroimpact.studies.lee.claims.section_4_2 import damping
from vibroimpact.studies.lee.claims.section_4_3 import stiffness
from vibroimpact.studies.lee.claims.section_4_4 import amplitude
from vibroimpact.studies.lee.claims.section_4_5 import restitution
from vibroimpact.studies.lee.claims.section_5 import conclusions

SECTIONS: tuple[Section, ...] = (
    general, sticking, first_chaos, periodic, second_chaos, statistical,
    mass, damping, stiffness, amplitude, restitution, conclusions,
)  # fmt: skip
CLAIMS: tuple[Claim, ...] = tuple(claim for section in SECTIONS for claim in section.claims)

# Sentences of sections 3 to 5 that are no statement about a result, and why they are not judged.
NOT_JUDGED = (
    ("3, 4", "parameters, sampling and mesh", "settings; they are used as printed"),
    ("3", "numerical solutions are provided for the full region; knowledge ... is essential", "an aim, not a result"),
    ("4.1", "This diagram is a useful tool for designing an impact system", "an opinion"),
    ("5", "To minimize the computing cost, the statistical index of Std is calculated", "a motive, not a result"),
    ("5", "The present findings expand our understanding", "an opinion"),
)

__all__ = ["CLAIMS", "NOT_JUDGED", "SECTIONS", "Claim", "Finding", "Section"]
