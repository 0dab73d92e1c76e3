"""Study files: a whole request in TOML, with all its faults told at once."""

from vibroimpact.cli.study.reading import make_study, read_study
from vibroimpact.cli.study.tables import Study

__all__ = ["Study", "make_study", "read_study"]
