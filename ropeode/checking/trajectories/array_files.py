"""Trajectories stored as named arrays, in NPZ or NetCDF4."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NoReturn

import h5py
import numpy as np

from ropeode.checking.trajectories.layout import Layout, Written
from ropeode.errors import InputError
from ropeode.files import open_to_read
from ropeode.validation import bad_value, shortly

TIMES, POSITIONS, VELOCITIES, STEP = "t", "positions", "velocities", "dt"
# No array has more bytes than so many times those of its file, however it is compressed.
_COMPRESSED = 2**11
_FORMATS = {".npz": "an archive written by numpy.savez", ".nc": "a NetCDF4 file"}


def read_arrays(path: Path, layout: Layout) -> Written:
    """Read the arrays `t`, `positions`, `velocities` and `dt`; the last two are optional.

    Dimensions of NetCDF have any names, and `dt` is a global attribute. Nothing is unpickled.

    Arguments:
        path: of the file.
        layout: of its samples.

    Raises:
        InputError: it cannot be read, lacks an array, or one has another shape or type.
    """
    with _opened(path) as arrays:
        for name in (TIMES, POSITIONS):
            if name not in arrays:
                allowed = f"arrays named {TIMES!r}, {POSITIONS!r}" + (
                    f" and optionally {VELOCITIES!r}" if layout.mechanical else ""
                )
                raise bad_value(str(path), sorted(arrays), allowed, f"add the array {name!r}")
        velocities = layout.mechanical and VELOCITIES in arrays
        names = (POSITIONS, VELOCITIES) if velocities else (POSITIONS,)
        times, *parts = (_numbers(path, arrays, name) for name in (TIMES, *names))
        step = _numbers(path, arrays, STEP) if STEP in arrays else None
    if step is not None and step.size != 1:
        _refuse(path, STEP, step.shape, "one real number", "store dt as a number")
    whole = (len(times) if times.ndim else 0, layout.nodes, layout.dim)
    for name, part in zip((TIMES, *names), (times, *parts), strict=True):
        shape = whole[: 1 if name == TIMES else None]
        if part.shape != shape:
            words = "(times, nodes, dim)" if len(shape) > 1 else "(times,)"
            allowed = f"the shape {shape}, that is {words} of this problem"
            fix = "reorder the axes, or grade the file with its own spec"
            _refuse(path, name, part.shape, allowed, fix)

    def where(sample: int, node: int | None = None, column: int | None = None) -> str:
        if node is None or column is None:
            return f"{path}, {TIMES}[{sample}]"
        name, axis = names[column // layout.dim], column % layout.dim
        return f"{path}, {name}[{sample}, {node}, {axis}]"

    dt = None if step is None else repr(float(step.reshape(())))
    return Written(path, dt, times, np.concatenate(parts, axis=2), where)


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[Mapping[str, Any]]:
    """The arrays of a file, of which none is read yet."""
    # Some readers report a file that is not there like one of another format.
    open_to_read("file", path).close()
    suffix = path.suffix.lower()
    try:
        if suffix == ".npz":
            # Not numpy.load, which advises to trust what is no archive.
            with path.open("rb") as file, np.lib.npyio.NpzFile(file) as archive:
                yield archive
        else:
            # Not h5netcdf, which complains once more when it closes what it could not open.
            with h5py.File(path, "r") as file:
                yield {**file, **{name: file.attrs[name] for name in {STEP} & {*file.attrs}}}
    except InputError:
        raise
    except Exception as error:
        # Readers raise errors of many kinds on other files.
        allowed = f"{_FORMATS[suffix]} ({shortly(error)})"
        raise bad_value("file", str(path), allowed, "write it again") from error


def _numbers(path: Path, arrays: Mapping[str, Any], name: str) -> np.ndarray:
    """The numbers of one array."""
    stored = arrays[name]
    if isinstance(stored, h5py.Dataset) and (
        stored.is_virtual or stored.external or stored.nbytes > _COMPRESSED * path.stat().st_size
    ):
        given, allowed = "numbers that are not in the file", "all numbers in the file itself"
        _refuse(path, name, given, allowed, "write all numbers into one file")
    numbers = np.asarray(stored)
    if numbers.dtype.kind not in "fiu":
        _refuse(path, name, str(numbers.dtype), "real numbers", "store float64")
    return numbers.astype(np.float64, copy=False)


def _refuse(path: Path, name: str, given: object, allowed: str, fix: str) -> NoReturn:
    raise bad_value(f"{path}, {name}", given, allowed, fix)
