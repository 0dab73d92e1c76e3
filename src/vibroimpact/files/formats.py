"""One writer per file format; each fails by raising `OSError`."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.dataset import flag_meanings

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

ORDER = "variable_order"  # an attribute of the file, not of the result


@contextmanager
def with_texts() -> Iterator[None]:
    """Suppress Zarr's warning about strings, such as names of stops: Zarr itself reads them back."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "The data type .* does not have a Zarr V3 specification")
        yield


def _write_zarr(dataset: xr.Dataset, part: Path) -> None:
    from zarr.storage import LocalStore  # Zarr may take a bare path for a URL, which ends at a `?`

    with with_texts():
        _with_order(dataset).to_zarr(LocalStore(part), mode="w-", zarr_format=3, consolidated=False)


def _write_netcdf(dataset: xr.Dataset, part: Path) -> None:
    import h5netcdf
    from xarray.backends import H5NetCDFStore

    # Written to HDF5's own memory first: HDF5 crashes the process some time after a full disk or an error in a file
    # object.
    with h5netcdf.File(part, "w", driver="core", backing_store=False) as file:
        _with_order(dataset).dump_to_store(H5NetCDFStore(file))
        file.flush()
        image = file._h5file
        image.flush()
        part.write_bytes(image.id.get_file_image())


def _with_order(dataset: xr.Dataset) -> xr.Dataset:
    return dataset.assign_attrs({ORDER: order_of(dataset.variables)})


def order_of(names: Iterable[Any]) -> str:
    """Return the attribute that records the order of variables, which Zarr and NetCDF do not keep."""
    return json.dumps([str(name) for name in names])


def in_order(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset with its variables in the order of its attribute, the others after them by name."""
    rank = {name: at for at, name in enumerate(json.loads(dataset.attrs.pop(ORDER, "[]")))}
    return dataset[sorted(map(str, dataset.variables), key=lambda name: (rank.get(name, len(rank)), name))]


def _write_csv(dataset: xr.Dataset, part: Path) -> None:
    tables = {" x ".join(dims) or "result": _table(dataset, dims) for dims in _outermost(dataset)}
    with part.open("w", encoding="utf-8", newline="") as file:
        _joined(tables).to_csv(file, index=False)


def write_labels(dataset: xr.Dataset, part: Path) -> None:
    """Write as JSON what a table cannot hold: the meaning and units of its columns, and its provenance."""
    columns = {
        str(name): {"meaning": v.attrs.get("long_name", "number"), "units": v.attrs.get("units", "1")}
        for name, v in dataset.variables.items()
    }
    content = {"columns": columns, "provenance": {str(name): _parsed(value) for name, value in dataset.attrs.items()}}
    part.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def _parsed(value: Any) -> Any:
    """Return an attribute as plain numbers, strings, lists and dictionaries."""
    try:
        return json.loads(value)
    except (TypeError, ValueError):
        return value.tolist() if hasattr(value, "tolist") else value


def _outermost(dataset: xr.Dataset) -> list[tuple[str, ...]]:
    """Return the dimensions of each variable, unless another, non-empty variable has all of them."""
    candidates = {tuple(map(str, v.dims)) for v in dataset.variables.values()}
    kept: list[tuple[str, ...]] = []
    for dims in sorted(candidates, key=lambda dims: (-len(dims), dims)):
        around = [other for other in kept if set(dims) <= set(other)]
        if not any(_entries(dataset, other) or not _entries(dataset, dims) for other in around):
            kept.append(dims)
    return sorted(kept)


def _entries(dataset: xr.Dataset, dims: tuple[str, ...]) -> int:
    return math.prod(dataset.sizes[dim] for dim in dims)


def _table(dataset: xr.Dataset, dims: tuple[str, ...]) -> pd.DataFrame:
    """Return one row per entry of `dims`, without the NaN padding of ragged rows."""
    import pandas as pd

    inside = [name for name, v in dataset.variables.items() if set(v.dims) <= set(dims)]
    part = _in_words(dataset[inside])
    if not dims:
        return pd.DataFrame({str(name): [v.values.item()] for name, v in part.variables.items()})
    table: pd.DataFrame = part.to_dataframe(dim_order=list(dims)).reset_index()
    ragged = [str(name) for name, v in part.data_vars.items() if len(v.dims) == len(dims) > 1]
    if ragged and len(table) and dims[-1] not in part.coords:  # rows without coordinate values are padded
        first = table[dims[-1]] == table[dims[-1]].iloc[0]  # keeps one row of a cell without impacts
        table = table[first | table[ragged].notna().any(axis=1)]
    return table


def _in_words(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset with words in place of codes."""
    coded = {name: v for name, v in dataset.variables.items() if "flag_meanings" in v.attrs}
    words = {name: (v.dims, _worded(v)) for name, v in coded.items()}
    axes = {name: word for name, word in words.items() if name in dataset.coords}
    return dataset.assign({name: word for name, word in words.items() if name not in axes}).assign_coords(axes)


def _worded(variable: xr.Variable) -> NDArray[Any]:
    words = flag_meanings(variable)
    meanings = dict(zip(np.asarray(variable.attrs.get("flag_values", range(len(words)))).tolist(), words, strict=True))
    codes, at = np.unique(variable.values, return_inverse=True)
    return np.array([meanings.get(code, str(code)) for code in codes.tolist()], str)[at].reshape(variable.shape)


def _joined(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    import pandas as pd

    if len(tables) == 1:
        return next(iter(tables.values()))
    columns = ["record", *dict.fromkeys(column for table in tables.values() for column in table.columns)]
    filled = [_whole(table).assign(record=name) for name, table in tables.items() if len(table)]
    return pd.concat(filled or list(tables.values())).reindex(columns=columns)


def _whole(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table whose integers stay integers next to rows without a value."""
    return table.astype({name: "Int64" for name, kind in table.dtypes.items() if kind.kind in "iu"})


def _write_mat(dataset: xr.Dataset, part: Path) -> None:
    from scipy.io import savemat

    content: dict[str, Any] = {str(name): variable.values for name, variable in dataset.variables.items()}
    content["units"] = {str(name): v.attrs.get("units", "1") for name, v in dataset.variables.items()}
    content["long_names"] = {str(name): v.attrs.get("long_name", str(name)) for name, v in dataset.variables.items()}
    content["dimensions"] = {str(name): ", ".join(map(str, v.dims)) for name, v in dataset.variables.items()}
    content["provenance"] = {str(name): str(value) for name, value in dataset.attrs.items()}
    if "status" in dataset:
        content["status_meanings"] = np.array(flag_meanings(dataset["status"]), dtype=object)
    with part.open("wb") as file:
        savemat(file, content, oned_as="column", long_field_names=True)


WRITERS: dict[str, Callable[[xr.Dataset, Path], None]] = {
    ".zarr": _write_zarr,
    ".nc": _write_netcdf,
    ".csv": _write_csv,
    ".mat": _write_mat,
}
