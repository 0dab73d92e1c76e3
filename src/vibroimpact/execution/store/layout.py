"""What lies in a stored sweep: result variables at the root, flags and timings of tiles in a group below."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numcodecs.zstd import Zstd  # type: ignore[import-untyped]
from numpy.typing import NDArray
from zarr.codecs import ZstdCodec

from vibroimpact.dataset import missing, status_variable, variable
from vibroimpact.execution.store.records import COLUMNS
from vibroimpact.execution.store.tiling import Tiling
from vibroimpact.formats import ORDER, order_of
from vibroimpact.request import Request, key_of
from vibroimpact.status import Status

PROGRESS = "progress"
RECORDS = "tiles"
# Readers of any kind refuse a chunk that was altered since, instead of taking it for numbers.
PACKING = ZstdCodec(checksum=True)


def lay_out(folder: Path, request: Request, tiling: Tiling, command: str) -> None:
    """Write a store in which no tile is done."""
    identity = request.identity()
    root = zarr.open_group(folder, mode="w-", zarr_format=3)
    root.attrs.update(
        request.provenance("parameter_map")
        | {"study": json.dumps(identity), "key": key_of(identity), "command": command, "tile": list(tiling.tile)}
    )
    root.attrs[ORDER] = order_of((*request.indices, "status", *request.coordinates()))
    dims = list(request.dims)
    for name, axis in request.coordinates().items():
        array = root.create_array(
            name,
            shape=axis.shape,
            dtype=axis.dtype,
            chunks=axis.shape,
            compressors=PACKING,
            fill_value=np.nan if axis.dtype.kind == "f" else 0,
            dimension_names=[str(dim) for dim in axis.dims],
            attributes=axis.attrs,
        )
        array[:] = axis.values
    for name in (*request.indices, "status"):
        labelled = _label(name)
        root.create_array(
            name,
            shape=tiling.shape,
            dtype=labelled.dtype,
            chunks=tiling.tile,
            compressors=PACKING,
            fill_value=labelled.values.flat[0].item(),
            dimension_names=dims,
            attributes={key: _plain(value) for key, value in labelled.attrs.items()},
        )
    group = root.create_group(PROGRESS)
    group.create_array(
        RECORDS,
        shape=(len(tiling), COLUMNS),
        dtype="int64",
        chunks=(1, COLUMNS),
        compressors=PACKING,
        fill_value=0,
        dimension_names=["tile", "column"],
    )


def _label(name: str) -> Any:
    if name == "status":
        return status_variable("cell", np.array([Status.INTERRUPTED]))
    return variable(name, "cell", missing(name, 1))


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value


def unpacked(array: Path, place: tuple[int, ...], like: NDArray[Any]) -> NDArray[Any]:
    """Return a chunk as its file holds it, of the shape and type of `like`: for small ones ten times Zarr's speed."""
    packed = array.joinpath("c", *map(str, place)).read_bytes()
    return np.frombuffer(Zstd().decode(packed), like.dtype.newbyteorder("<")).reshape(like.shape)
