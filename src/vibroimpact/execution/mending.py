"""What describes a store, written anew where it is damaged: all of it follows from the request."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from zarr.core.buffer import Buffer, default_buffer_prototype
from zarr.core.sync import sync
from zarr.storage import MemoryStore

from vibroimpact.cells import Tiling
from vibroimpact.execution.layout import DRAWN, LIST, NEEDED, lay_out, refined, tiling_of
from vibroimpact.guard import DESCRIPTION, RECORDS, GuardedStore
from vibroimpact.request import Request, key_of


def mend(folder: Path, request: Request, identity: dict[str, Any]) -> None:
    """Write anew what is damaged of the descriptions and axes of a request's store; leave alone what is another's.

    Tiles stay as they are: those of which a chunk is lost or altered are found and computed again afterwards.
    """
    store = GuardedStore(folder, read_only=False)
    attrs = _attributes(store, DESCRIPTION)
    if attrs is None or attrs.get("key") != key_of(identity):
        return
    tiling = _tiling(store, request, attrs)
    if tiling is None:
        return
    whole: dict[str, Buffer] = {}
    lay_out(MemoryStore(whole), request, identity, tiling)
    for key, buffer in whole.items():
        wanted = buffer.to_bytes()
        if key.endswith(DESCRIPTION):
            wanted = _with_what_was_noted(key, wanted, _attributes(store, key) or {}, refined(identity))
        if not _holds(store, key, wanted):
            sync(store.set(key, default_buffer_prototype().buffer.from_bytes(wanted)))


def _attributes(store: GuardedStore, key: str) -> dict[str, Any] | None:
    """Return the attributes of a description; None where that is damaged."""
    try:
        content = store.content(key)
        return None if content is None else dict(json.loads(content).get("attributes", {}))
    except (OSError, ValueError):
        return None


def _tiling(store: GuardedStore, request: Request, attrs: dict[str, Any]) -> Tiling | None:
    """Return the tiles of a store, as most of its arrays and its own attribute have them."""
    found = []
    lists = refined(request.further)
    for name in (*request.indices, "status"):
        try:
            array = store.declared(f"{LIST}/{name}" if lists else name)
        except (OSError, ValueError):
            continue
        found += [array.chunk] if array else []
    if isinstance(attrs.get("tile"), list):
        found.append(tuple(attrs["tile"]))
    right = [tile for tile in found if all(type(side) is int and side > 0 for side in tile)]
    right = [tile for tile in right if len(tile) == (1 if lists else len(request.shape))]
    if not right:
        return None
    tile = max(right, key=right.count)
    return tiling_of(request, math.prod(tile)) if lists else Tiling(request.shape, tile)


def _with_what_was_noted(key: str, wanted: bytes, attrs: dict[str, Any], refining: bool) -> bytes:
    """Return a description with the attributes that runs add, as they were."""
    described = json.loads(wanted)
    kept = {"command": attrs["command"]} if isinstance(attrs.get("command"), str) else {}
    if key == DESCRIPTION and refining:
        kept |= {name: value for name, value in attrs.items() if name not in described["attributes"]}
    if key == f"{RECORDS}/{DESCRIPTION}":
        kept = {name: attrs[name] for name in (NEEDED, DRAWN) if type(attrs.get(name)) is int}
    elif key != DESCRIPTION:
        kept = {}
    described["attributes"] |= kept
    return json.dumps(described, indent=2).encode()


def _holds(store: GuardedStore, key: str, wanted: bytes) -> bool:
    """Whether a file of the store holds that, or a description that means the same."""
    try:
        found = store.content(key)
        same = found == wanted
        return same or (key.endswith(DESCRIPTION) and json.loads(found or b"0") == json.loads(wanted))
    except (OSError, ValueError):
        return False
