"""The source paper's study, computed again: its figures, and a verdict on every statement about results."""

from __future__ import annotations

from vibroimpact.studies.lee.pipeline import run

__all__ = ["run"]
