"""One writer a file format; each gives up by raising `OSError`."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


def _write_zarr(dataset: xr.Dataset, part: Path) -> None:
    dataset.to_zarr(part, mode="w-", zarr_format=3, consolidated=False)


def _write_netcdf(dataset: xr.Dataset, part: Path) -> None:
    import h5netcdf
    from xarray.backends import H5NetCDFStore

    # By way of memory: HDF5 crashes the process some time after a full disk.
    image = BytesIO()
    with h5netcdf.File(image, "w") as file:
        dataset.dump_to_store(H5NetCDFStore(file))
    part.write_bytes(image.getbuffer())


def _write_csv(dataset: xr.Dataset, part: Path) -> None:
    tables = {dims[-1] if dims else "result": _table(dataset, dims) for dims in _outermost(dataset)}
    with part.open("w", encoding="utf-8", newline="") as file:
        for name, value in dataset.attrs.items():
            file.write(f"# {name}: {value}\n")
        for name in dict.fromkeys(column for table in tables.values() for column in table.columns):
            attrs = dataset[name].attrs if name in dataset.variables else {}
            file.write(f"# {name}: {attrs.get('long_name', 'number')} [{attrs.get('units', '1')}]\n")
        _joined(tables).to_csv(file, index=False)


def _outermost(dataset: xr.Dataset) -> list[tuple[str, ...]]:
    """Return the dimensions of the variables that do not fit inside another variable's."""
    found = sorted({tuple(map(str, v.dims)) for v in dataset.data_vars.values()}, key=len, reverse=True)
    kept: list[tuple[str, ...]] = []
    for dims in found:
        if not any(set(dims) <= set(other) for other in kept):
            kept.append(dims)
    return sorted(kept)


def _table(dataset: xr.Dataset, dims: tuple[str, ...]) -> pd.DataFrame:
    """Return one row an entry of `dims`, without the NaN padding of ragged rows."""
    import pandas as pd

    mine = dataset[[str(name) for name, v in dataset.data_vars.items() if set(v.dims) <= set(dims)]]
    if "status" in mine:
        words = np.array(mine.status.attrs["flag_meanings"].split())
        mine = mine.assign(status=(mine.status.dims, words[mine.status.values]))
    if not dims:
        return pd.DataFrame({str(name): [v.item()] for name, v in mine.data_vars.items()})
    table: pd.DataFrame = mine.to_dataframe(dim_order=list(dims)).reset_index()
    ragged = [str(name) for name, v in mine.data_vars.items() if "count" in mine and len(v.dims) == len(dims)]
    if ragged:
        first = table[dims[-1]] == table[dims[-1]].iloc[0]  # keeps a row of a cell without any impact
        table = table[first | table[ragged].notna().any(axis=1)]
    return table


def _joined(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    import pandas as pd

    if len(tables) == 1:
        return next(iter(tables.values()))
    return pd.concat([table.assign(record=name) for name, table in tables.items()]).set_index("record").reset_index()


def _write_mat(dataset: xr.Dataset, part: Path) -> None:
    from scipy.io import savemat

    content: dict[str, Any] = {str(name): variable.values for name, variable in dataset.variables.items()}
    content["units"] = {str(name): v.attrs.get("units", "1") for name, v in dataset.variables.items()}
    content["long_names"] = {str(name): v.attrs.get("long_name", str(name)) for name, v in dataset.variables.items()}
    content["dimensions"] = {str(name): ", ".join(map(str, v.dims)) for name, v in dataset.variables.items()}
    content["provenance"] = {str(name): str(value) for name, value in dataset.attrs.items()}
    if "status" in dataset:
        content["status_meanings"] = np.array(dataset.status.attrs["flag_meanings"].split(), dtype=object)
    with part.open("wb") as file:
        savemat(file, content, oned_as="column", long_field_names=True)


WRITERS: dict[str, Callable[[xr.Dataset, Path], None]] = {
    ".zarr": _write_zarr,
    ".nc": _write_netcdf,
    ".csv": _write_csv,
    ".mat": _write_mat,
}
