"""Encoding of parts of the page as one websocket message: their text, then their arrays in binary form."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

ALIGNED = 8  # bytes: a browser reads arrays in place, only at multiples of the item size


def packed(parts: dict[str, dict[str, Any]]) -> bytes:
    """Return a message.

    Notes
    -----
    The first four bytes, little-endian, give the length of the text (JSON), which is padded with spaces. The text maps
    names to contents; ``{"array": [type, place, length]}`` refers to an array of numbers at that place, counted from
    the end of the text. NaN, which JSON does not have, becomes null.
    """
    arrays: list[bytes] = []
    place = 0

    def plain(content: Any) -> Any:
        nonlocal place
        if isinstance(content, bytes):
            content = np.frombuffer(content, np.uint8)
        if isinstance(content, np.ndarray):
            numbers = content.astype(content.dtype.newbyteorder("<"), copy=False).tobytes()
            entry = {"array": [content.dtype.name, place, content.size]}
            arrays.append(numbers.ljust(_aligned(len(numbers)), b"\0"))
            place += len(arrays[-1])
            return entry
        if isinstance(content, np.generic):
            content = content.item()
        if isinstance(content, dict):
            return {key: plain(part) for key, part in content.items()}
        if isinstance(content, (list, tuple)):
            return [plain(part) for part in content]
        return None if isinstance(content, float) and not math.isfinite(content) else content

    text = json.dumps([[name, plain(content)] for name, content in parts.items()], ensure_ascii=False).encode()
    text = text.ljust(_aligned(4 + len(text)) - 4)
    return b"".join([len(text).to_bytes(4, "little"), text, *arrays])


def _aligned(length: int) -> int:
    return -(-length // ALIGNED) * ALIGNED
