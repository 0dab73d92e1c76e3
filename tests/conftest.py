"""What several test files share: the 50-digit values and a shorthand for oscillators."""

import json
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture(scope="session")
def values() -> dict[str, Any]:
    """Return values computed with 50 digits by independent code; numbers are strings."""
    return json.loads((Path(__file__).parent / "data" / "values.json").read_text())
