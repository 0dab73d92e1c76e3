"""Results on disk: written whole or not at all, in the format the file's ending names."""

from __future__ import annotations

import errno
import os
import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroimpact.formats import WRITERS, in_order

if TYPE_CHECKING:
    import xarray as xr

DATA_ENDINGS = tuple(WRITERS)
MOVES = 1000  # times that one output is tried to be put in the place of others that are put there meanwhile


def save(dataset: xr.Dataset, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Write a result in the format its ending names, whole or not at all.

    The result is written under a temporary name in the same folder and moved to its own name when it is
    complete; what stood there before goes only then.

    Parameters
    ----------
    dataset : xarray.Dataset
        What any function of this package returned.
    path : path
        `.zarr`: Zarr format 3, opens with ``xarray.open_zarr(path, consolidated=False)``;
        `.nc`: NetCDF-4; `.csv`: long form, see Notes; `.mat`: MATLAB 5, one array a variable.
    overwrite : bool
        Whether an existing output may be replaced.

    Returns
    -------
    pathlib.Path
        Where the result lies.

    Raises
    ------
    ValueError
        The ending is none of the four, or `dataset` is no Dataset.
    OSError
        The output exists and `overwrite` is false, or it cannot be written (folder, rights, full disk).

    Notes
    -----
    A `.csv` starts with lines ``# name: meaning [unit]``, so that ``pandas.read_csv(path, comment="#")`` reads
    it; then one row a cell, impact, look or instant. Where a result has variables over dimensions that do not nest, a
    first column `record` names those a row is over, such as `time` or `point x impact`; variables over fewer of them
    are repeated in each row. Padding is left out; statuses, kinds and other codes are words.

    Examples
    --------
    >>> import tempfile, numpy as np, xarray as xr
    >>> folder = tempfile.TemporaryDirectory()
    >>> sweep = xr.Dataset({"std": ("omega", [0.0, 0.1])}, {"omega": [1.0, 2.0]})
    >>> path = save(sweep, folder.name + "/sweep.zarr")
    >>> load(path)["std"].values.tolist()
    [0.0, 0.1]
    >>> folder.cleanup()
    """
    import xarray as xr

    if not isinstance(dataset, xr.Dataset):
        raise ValueError(
            f"`dataset` is of type {type(dataset).__name__}; allowed is an xarray.Dataset, which functions of this "
            "package return; save such a result, of a branch or boundary its .dataset"
        )
    target = check_output(path, overwrite=overwrite)
    with replacing(target, overwrite=overwrite) as part:
        WRITERS[target.suffix.lower()](dataset, part)
    return target


def load(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a result that `save` wrote as `.zarr` or `.nc`.

    Parameters
    ----------
    path : path
        A `.zarr` folder or a `.nc` file.

    Returns
    -------
    xarray.Dataset
        The result, in memory, with labels, provenance and the order of its variables as they were; by name where a
        file does not tell their order.

    Raises
    ------
    ValueError
        The ending is another one; `.csv` and `.mat` are exports that do not keep every label.
    OSError
        Nothing is there, or it cannot be read.

    Examples
    --------
    >>> load("map.csv")
    Traceback (most recent call last):
    ValueError: `path` is 'map.csv'; allowed are .zarr and .nc (.csv, .mat are exports); save the result as .zarr too
    """
    import xarray as xr

    source = Path(path)
    ending = source.suffix.lower()
    if ending not in (".zarr", ".nc"):
        raise ValueError(
            f"`path` is {str(path)!r}; allowed are .zarr and .nc (.csv, .mat are exports); save the result as .zarr too"
        )
    if not source.exists():
        raise FileNotFoundError(f"`path` is {str(path)!r}; nothing is there; check the spelling")
    try:
        with xr.open_dataset(source, **_OPEN[ending]) as stored:
            return _as_it_was(stored.load())
    except Exception as error:  # each library under xarray has its own words for a damaged file
        raise OSError(
            f"`path` is {str(path)!r}, which cannot be read ({_first_line(error)}); give a result this package saved"
        ) from error


def load_lazily(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open a Zarr store as `load` does, but read from disk what is looked at, when it is."""
    import xarray as xr

    return _as_it_was(xr.open_dataset(Path(path), **_OPEN[".zarr"]))


def _as_it_was(dataset: xr.Dataset) -> xr.Dataset:
    for variable in dataset.variables.values():
        if "flag_values" in variable.attrs:  # JSON knows lists only, NetCDF makes a number of a list of one
            values = np.asarray(variable.attrs["flag_values"], dtype=variable.dtype)
            variable.attrs["flag_values"] = np.atleast_1d(values)
        variable.encoding = {}
    return in_order(dataset)


def check_output(
    path: str | os.PathLike[str], *, overwrite: bool = False, endings: Sequence[str] = DATA_ENDINGS
) -> Path:
    """Return the path if an output can be put there, else raise before anything is computed.

    Parameters
    ----------
    path : path
        Where the output shall lie.
    overwrite : bool
        Whether an existing output may be replaced.
    endings : sequence of str
        The endings allowed.

    Returns
    -------
    pathlib.Path
        The same path.

    Raises
    ------
    ValueError
        The ending is not allowed.
    OSError
        The folder is missing or not writable, or the output exists and must not, or cannot, be replaced.

    Examples
    --------
    >>> check_output("map.xls")
    Traceback (most recent call last):
    ValueError: `out` is 'map.xls'; allowed are .zarr, .nc, .csv, .mat; give it one of these endings
    """
    target, shown = Path(path), repr(str(path))
    if target.suffix.lower() not in endings:
        raise ValueError(f"`out` is {shown}; allowed are {', '.join(endings)}; give it one of these endings")
    if not target.parent.is_dir():
        raise FileNotFoundError(f"`out` is {shown}; its folder does not exist; make {str(target.parent)!r} first")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise PermissionError(f"`out` is {shown}; its folder cannot be written to; choose another one")
    if not os.path.lexists(target):
        return target
    if not overwrite:
        raise FileExistsError(f"`out` is {shown}, which exists; overwrite it (--overwrite) or choose another name")
    if target.is_dir() and not (target.suffix.lower() == ".zarr" and _is_store(target)):
        raise IsADirectoryError(f"`out` is {shown}, a folder that is no Zarr store; choose another name")
    return target


@contextmanager
def replacing(path: str | os.PathLike[str], *, overwrite: bool = False) -> Iterator[Path]:
    """Yield a temporary name in the same folder; move what was written there to `path` if all went well.

    Parameters
    ----------
    path : path
        The final name; whatever is there stays until the new output is complete.
    overwrite : bool
        Whether an output that has appeared there may be replaced.

    Yields
    ------
    pathlib.Path
        A name with the same ending that does not exist yet, for a file or a folder.

    Raises
    ------
    OSError
        The output could not be written; nothing is left behind.
    """
    target = Path(path)
    try:
        scratch = Path(mkdtemp(prefix=f".{target.stem}-", suffix=".part", dir=target.parent))
        try:
            part = scratch / target.name
            yield part
            if os.path.lexists(target) and not overwrite:
                raise _exists_by_now(target)
            _move(part, target, old=scratch.with_suffix(".old"), overwrite=overwrite)
            shutil.rmtree(scratch)
        except BaseException:
            remove_folder(scratch)
            raise
    except OSError as error:
        if str(error).startswith("`out`"):
            raise
        message = f"`out` is {str(path)!r}, which could not be written ({_first_line(error)}); nothing was changed"
        raise OSError(error.errno, message) from error


def remove_folder(folder: Path) -> None:
    """Remove a folder that threads of a failed writer may still be filling, or making anew, for a moment."""
    quiet = 0
    for _ in range(100):
        quiet = 0 if folder.exists() else quiet + 1
        if quiet == 5:
            return
        shutil.rmtree(folder, ignore_errors=True)
        time.sleep(0.02)


def _move(part: Path, target: Path, *, old: Path, overwrite: bool) -> None:
    """Put `part` in the place of `target`; a folder cannot be replaced in one step, so the old one steps aside.

    Other processes may do the same at the same moment: whoever finds the place taken, or what stood there gone, looks
    again. In the end the last one's output stands there, whole.
    """
    aside: list[Path] = []
    try:
        for turn in range(MOVES):
            if _moved(part, target):
                return
            if not overwrite:
                raise _exists_by_now(target)
            with suppress(FileNotFoundError):  # somebody else has set it aside
                os.rename(target, old.with_name(f"{old.name}{turn}"))
                aside.append(old.with_name(f"{old.name}{turn}"))
        raise OSError(errno.EBUSY, "others keep writing there")
    except BaseException:
        if aside and not os.path.lexists(target):
            with suppress(OSError):  # somebody else's stands there by now
                os.rename(aside.pop(), target)
        raise
    finally:
        for folder in aside:
            shutil.rmtree(folder, ignore_errors=True)


def _moved(part: Path, target: Path) -> bool:
    """Move `part` to `target`, unless a folder stands there that holds something; return whether it was moved."""
    try:
        os.replace(part, target)
    except OSError as error:
        taken = error.errno in (errno.ENOTEMPTY, errno.EEXIST) or (target.is_dir() and not target.is_symlink())
        if not taken or not part.exists():
            raise
        return False
    return True


def _exists_by_now(target: Path) -> FileExistsError:
    return FileExistsError(f"`out` is {str(target)!r}, which exists by now; choose another name")


def _is_store(folder: Path) -> bool:
    return any((folder / name).exists() for name in ("zarr.json", ".zgroup")) or not any(folder.iterdir())


def _first_line(error: BaseException) -> str:
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return str(text).splitlines()[0]


_OPEN: dict[str, dict[str, Any]] = {
    ".zarr": {"engine": "zarr", "backend_kwargs": {"consolidated": False}},
    ".nc": {"engine": "h5netcdf"},
}
