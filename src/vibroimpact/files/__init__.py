"""Results on disk: written completely or not at all, in the format given by the ending of the name."""

from __future__ import annotations

import errno
import glob
import os
import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import numpy as np

from vibroimpact.dataset import check_attributes
from vibroimpact.files.formats import WRITERS, in_order, write_labels
from vibroimpact.parameters import check_fits, invalid, truth

if TYPE_CHECKING:
    import xarray as xr

DATA_ENDINGS = tuple(WRITERS)
MOVES = 1000  # attempts to replace an output that other processes keep replacing
RECORD = "object"  # the variable of a dataset that holds an orbit, a branch or an attractor as such
RECORDS = "vibroimpact.records"  # the module that makes it, which imports this one
PART, ASIDE = ".part", ".old"  # endings of outputs that are being written, and that are being replaced


def save(dataset: Any, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Write a result in the format that the ending names, completely or not at all.

    It is written under a temporary name in the same folder; a previous output is replaced only once it is complete.

    Parameters
    ----------
    dataset : xarray.Dataset, Orbit, Branch, Boundary, Attractor or list
        The result of any function of this package; a list of orbits or of attractors.
    path : path
        `.zarr`: Zarr format 3, opens with ``xarray.open_zarr(path, consolidated=False)``;
        `.nc`: NetCDF-4; `.csv`: long form, see Notes; `.mat`: MATLAB 5, one array per variable.
    overwrite : bool
        Whether an existing output may be replaced.

    Returns
    -------
    pathlib.Path
        The path of the result.

    Raises
    ------
    ValueError
        The ending is not one of the four, or `dataset` cannot be saved.
    OSError
        The output exists and `overwrite` is false, or it cannot be written (folder, permissions, full disk).

    Notes
    -----
    A `.csv` has one row per cell, impact, sample or time, for ``pandas.read_csv(path)``. The meaning and the units of
    its columns, and its provenance, are saved next to it as `NAME.csv.json`. If a result has variables over dimensions
    that do not nest, a first column `record` names the dimensions of each row, such as `time` or `point x impact`;
    variables over fewer of them are repeated. Padding is left out; statuses, kinds and other codes are written as
    words.

    For an orbit, branch, boundary or attractor, `.zarr` and `.nc` contain the labelled dataset and, as JSON in the
    variable `object`, the object with its model. `load` returns this object, equal to the bit.

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
        dataset = import_module(RECORDS).labelled(dataset)
    target = check_output(path, overwrite=overwrite)
    if target.suffix.lower() not in _OPEN:  # an export
        dataset = dataset.drop_vars(RECORD, errors="ignore")
    with replacing(target, overwrite=overwrite) as part:
        WRITERS[target.suffix.lower()](dataset, part)
    if target.suffix.lower() == ".csv":
        with replacing(_labels(target), overwrite=overwrite) as part:
            write_labels(dataset, part)
    return target


def load(path: str | os.PathLike[str]) -> Any:
    """Read a result that `save` wrote as `.zarr` or `.nc`.

    Parameters
    ----------
    path : path
        A `.zarr` folder or a `.nc` file.

    Returns
    -------
    xarray.Dataset, Orbit, Orbits, Branch, Boundary, Attractor or list
        What was saved: a dataset, in memory, with labels, provenance and the order of its variables (sorted by name if
        the file has none); or an orbit, a branch or an attractor, with its model, equal to the bit.

    Raises
    ------
    ValueError
        The ending is not `.zarr` or `.nc` (`.csv` and `.mat` are exports that do not keep every label), or the values
        take more memory than this machine has.
    OSError
        The file does not exist, cannot be read, or was not saved by this package.

    Notes
    -----
    A `.zarr` folder from an unknown source is safe to load: only regular files inside it are read, and only values of
    the size and packing that `save` and stores use. HDF5 unpacks whatever a `.nc` file holds: load only trusted ones.

    Examples
    --------
    >>> load("map.csv")
    Traceback (most recent call last):
    ValueError: `path` must be a .zarr folder or a .nc file, got 'map.csv'; .csv and .mat are exports only
    """
    dataset = _loaded(source := _path("path", path))
    if RECORD not in dataset:
        return dataset
    with _explained(source):
        return import_module(RECORDS).restored(dataset)


def load_dataset(path: str | os.PathLike[str]) -> xr.Dataset:
    """Return a result as `load` does, always as a dataset."""
    return _loaded(_path("path", path)).drop_vars(RECORD, errors="ignore")


def _loaded(source: Path) -> xr.Dataset:
    """Return the dataset in a file or a store."""
    import xarray as xr

    from vibroimpact.files.guard import GuardedStore, netcdf_size

    ending = source.suffix.lower()
    if ending not in _OPEN:
        raise invalid("path", str(source), "a .zarr folder or a .nc file", ".csv and .mat are exports only")
    if not source.exists():
        raise FileNotFoundError(f"`path` {str(source)!r} does not exist; {aside_hint(source) or 'check the spelling'}")
    with _explained(source):
        place: Any = GuardedStore(source) if ending == ".zarr" else source
        size = netcdf_size(source) if place is source else place.size()
    check_fits("path", f"{str(source)!r} has values that take", size, "xarray.open_zarr(path) reads a store in parts")
    with _explained(source), xr.open_dataset(place, **_OPEN[ending]) as stored:
        loaded = _restored(stored.load())
        if place is not source:
            place.check_sweep(map(str, loaded.coords), map(str, loaded.data_vars))
        return loaded


def load_lazily(path: Path) -> xr.Dataset:
    """Open a Zarr store as `load` does, but read values from disk only when they are used."""
    import xarray as xr

    from vibroimpact.files.guard import GuardedStore

    place: Any = GuardedStore(path)
    with _explained(path):
        return _restored(xr.open_dataset(place, **_OPEN[".zarr"]))


def _path(name: str, path: Any) -> Path:
    if not isinstance(path, (str, os.PathLike)):
        raise invalid(name, path, "the name of a file or folder")
    return Path(path)


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """Turn the errors that libraries raise for damaged files, or files of another kind, into one `OSError`."""
    try:
        yield
    except MemoryError:
        raise
    except Exception as error:
        raise OSError(
            f"`path` {str(path)!r} cannot be read ({_first_line(error)}); give a result that this package saved"
        ) from error


def _restored(dataset: xr.Dataset) -> xr.Dataset:
    check_attributes(dataset)
    for variable in dataset.variables.values():
        if "flag_values" in variable.attrs:  # JSON has lists only, NetCDF turns a list of one into a number
            values = np.asarray(variable.attrs["flag_values"], dtype=variable.dtype)
            variable.attrs["flag_values"] = np.atleast_1d(values)
        variable.encoding = {}
        if variable.dtype == object and not variable.size:  # NetCDF does not keep the length of texts
            variable.data = variable.values.astype(str)
    return in_order(dataset)


def _labels(table: Path) -> Path:
    """Return the name of the file next to a table that describes its columns."""
    return table.with_name(f"{table.name}.json")


def check_output(
    path: str | os.PathLike[str], *, overwrite: bool = False, endings: Sequence[str] = DATA_ENDINGS
) -> Path:
    """Return the path if an output can be written there; otherwise, raise before anything is computed.

    `ValueError`: the ending is not one of `endings`. `OSError`: the folder is missing or not writable, or the output
    exists and may not, or cannot, be replaced.

    Examples
    --------
    >>> check_output("map.xls")
    Traceback (most recent call last):
    ValueError: `out` must end in .zarr, .nc, .csv or .mat, got 'map.xls'
    """
    target, shown, overwrite = _path("out", path), repr(str(path)), truth("overwrite", overwrite)
    if target.suffix.lower() not in endings:
        raise ValueError(f"`out` must end in {', '.join(endings[:-1])} or {endings[-1]}, got {shown}")
    if target.suffix.lower() == ".csv":
        check_output(_labels(target), overwrite=overwrite, endings=(".json",))
    if not target.parent.is_dir():
        raise FileNotFoundError(f"`out` {shown}: its folder does not exist; create {str(target.parent)!r} first")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise PermissionError(f"`out` {shown}: its folder cannot be written to; choose another one")
    if not os.path.lexists(target):
        return target
    if not overwrite:
        raise FileExistsError(f"`out` {shown} exists; overwrite it (--overwrite) or choose another name")
    if target.is_dir() and not (target.suffix.lower() == ".zarr" and _is_store(target)):
        raise IsADirectoryError(f"`out` {shown} is a folder, but not a Zarr store; choose another name")
    return target


@contextmanager
def replacing(path: str | os.PathLike[str], *, overwrite: bool = False) -> Iterator[Path]:
    """Yield a temporary name in the same folder; move the file or folder written there to `path` if no error occurs.

    An existing output stays until the new one is complete; one that appears meanwhile is replaced only if `overwrite`.
    `OSError`: the output could not be written; nothing is left behind.
    """
    target = Path(path)
    try:
        with scratch_beside(target) as scratch:
            part = scratch / target.name
            yield part
            if os.path.lexists(target) and not overwrite:
                raise _appeared(target)
            replace_output(part, target, overwrite=overwrite)
    except OSError as error:
        if str(error).startswith("`out`"):
            raise
        message = f"`out` {str(path)!r} could not be written ({_first_line(error)}); nothing was changed"
        raise OSError(error.errno, message) from error


@contextmanager
def scratch_beside(target: Path) -> Iterator[Path]:
    """Yield a temporary folder next to the target; remove it in the end, and those left by killed processes."""
    sweep_up(target)
    for _ in range(MOVES):
        scratch = Path(mkdtemp(prefix=f".{target.stem}-", suffix=PART, dir=target.parent))
        with _locked(scratch) as locked:
            if locked is False:  # another process has just removed it as a leftover
                continue
            try:
                yield scratch
                shutil.rmtree(scratch)
            except BaseException:
                _remove_folder(scratch)
                raise
            return
    raise OSError(errno.EBUSY, "other processes keep removing what is written there")


def sweep_up(target: Path) -> None:
    """Remove partial outputs that killed processes left next to a target.

    The system releases the lock of a process that ends, however it ends.
    """
    for leftover in target.parent.glob(f".{glob.escape(target.stem)}-*{PART}"):
        with _locked(leftover) as locked:
            if locked:
                shutil.rmtree(leftover, ignore_errors=True)


@contextmanager
def _locked(folder: Path) -> Iterator[bool | None]:
    """Lock a folder; yield whether that succeeded, or None if this system cannot lock folders."""
    try:
        import fcntl
    except ImportError:
        yield None
        return
    handle, locked = None, None
    try:
        handle = os.open(folder, os.O_RDONLY)
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        locked = os.path.samestat(os.fstat(handle), os.stat(folder))
    except (BlockingIOError, FileNotFoundError):
        locked = False
    except OSError:  # some file systems have no locks
        locked = None
    try:
        yield locked
    finally:
        if handle is not None:
            os.close(handle)


def partial_name(path: Path) -> Path:
    """Return the name of a partial output, which must not replace a complete one."""
    return path.with_name(f"{path.stem}.partial{path.suffix}")


def aside_hint(path: Path) -> str:
    """Return the place of the previous output if a process died while replacing it; an empty string otherwise."""
    aside = max(path.parent.glob(f".{glob.escape(path.name)}-*{ASIDE}"), key=os.path.getmtime, default=None)
    return f"its previous content is in {str(aside)!r}, moved there by a process that died: rename it" if aside else ""


def _remove_folder(folder: Path) -> None:
    """Remove a folder to which threads of a failed writer may still write for a moment."""
    quiet = 0
    for _ in range(100):
        quiet = 0 if folder.exists() else quiet + 1
        if quiet == 5:
            return
        shutil.rmtree(folder, ignore_errors=True)
        time.sleep(0.02)


def replace_output(part: Path, target: Path, *, overwrite: bool = True) -> None:
    """Replace `target` by `part`; a folder cannot be replaced in one step, so the old one is moved aside first.

    Other processes may do the same at the same moment: each tries again if the name is taken or the old output is gone.
    In the end, the name holds the complete output of the last one.
    """
    aside: list[Path] = []
    try:
        for _ in range(MOVES):
            if _moved(part, target):
                return
            if not overwrite:
                raise _appeared(target)
            old = target.with_name(f".{target.name}-{uuid4().hex[:8]}{ASIDE}")
            with suppress(FileNotFoundError):  # another process has moved it aside
                os.rename(target, old)
                aside.append(old)
        raise OSError(errno.EBUSY, "other processes keep writing there")
    except BaseException:
        if aside and not os.path.lexists(target):
            with suppress(OSError):  # another process has put its output there
                os.rename(aside.pop(), target)
        raise
    finally:
        for folder in aside:  # under a name that marks it as incomplete, in case this process is killed now
            leftover = target.with_name(f".{target.stem}-{uuid4().hex[:8]}{PART}")
            with suppress(OSError):
                os.rename(folder, leftover)
            shutil.rmtree(leftover, ignore_errors=True)


def _moved(part: Path, target: Path) -> bool:
    """Move `part` to `target`, unless that is a folder with content; return whether it was moved."""
    try:
        os.replace(part, target)
    except OSError as error:
        occupied = error.errno in (errno.ENOTEMPTY, errno.EEXIST) or (target.is_dir() and not target.is_symlink())
        if not occupied or not part.exists():
            raise
        return False
    return True


def _appeared(target: Path) -> FileExistsError:
    return FileExistsError(f"`out` {str(target)!r} exists now; choose another name")


def _is_store(folder: Path) -> bool:
    return any((folder / name).exists() for name in ("zarr.json", ".zgroup")) or not any(folder.iterdir())


def _first_line(error: BaseException) -> str:
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return str(text).splitlines()[0]


_OPEN: dict[str, dict[str, Any]] = {
    ".zarr": {"engine": "zarr", "backend_kwargs": {"consolidated": False, "zarr_format": 3}},
    ".nc": {"engine": "h5netcdf"},
}
