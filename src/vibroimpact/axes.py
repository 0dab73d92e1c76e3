"""The parameters of an oscillator that an axis may vary."""

from __future__ import annotations

from vibroimpact.oscillator import PARAMETERS

NAMES = (*PARAMETERS, "frequency")
