"""Trajectories stored as named arrays, in NPZ or NetCDF4."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

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


class ArrayFile:
    """A file of the arrays `t`, `positions`, `velocities` and `dt`; the last two are optional.

    Dimensions of NetCDF have any names, and `dt` is a global attribute. Nothing is unpickled.

    Arguments:
        path: of the file.
        layout: of its samples.

    Raises:
        InputError: it cannot be read, or lacks an array.
    """

    def __init__(self, path: Path, layout: Layout):
        self.path, self.layout = path, layout
        with self._opened() as arrays:
            for name in (TIMES, POSITIONS):
                if name not in arrays:
                    allowed = f"arrays named {TIMES!r}, {POSITIONS!r}" + (
                        f" and optionally {VELOCITIES!r}" if layout.mechanical else ""
                    )
                    raise bad_value(str(path), sorted(arrays), allowed, f"add the array {name!r}")
            self.velocities = layout.mechanical and VELOCITIES in arrays
            self.dt = None
            if STEP in arrays:
                step = self._numbers(arrays, STEP)
                if step.size != 1:
                    self._refuse(STEP, step.shape, "one real number", "store dt as a number")
                self.dt = repr(float(step.reshape(())))

    def samples(self) -> Written:
        """All samples.

        Raises:
            InputError: the file is damaged, or an array has another shape or type.
        """
        names = (POSITIONS, VELOCITIES) if self.velocities else (POSITIONS,)
        with self._opened() as arrays:
            times, *parts = (self._numbers(arrays, name) for name in (TIMES, *names))
        whole = (len(times) if times.ndim else 0, self.layout.nodes, self.layout.dim)
        for name, part in zip((TIMES, *names), (times, *parts), strict=True):
            shape = whole[: 1 if name == TIMES else None]
            if part.shape != shape:
                words = "(times, nodes, dim)" if len(shape) > 1 else "(times,)"
                allowed = f"the shape {shape}, that is {words} of this problem"
                fix = "reorder the axes, or grade the file with its own spec"
                self._refuse(name, part.shape, allowed, fix)

        def where(sample: int, node: int | None, column: int | None) -> str:
            if node is None or column is None:
                return f"{self.path}, {TIMES}[{sample}]"
            name, axis = names[column // self.layout.dim], column % self.layout.dim
            return f"{self.path}, {name}[{sample}, {node}, {axis}]"

        return Written(times, np.concatenate(parts, axis=2), where)

    @contextlib.contextmanager
    def _opened(self) -> Iterator[Mapping[str, Any]]:
        """The arrays of the file, of which none is read yet."""
        # Some readers report a file that is not there like one of another format.
        with open_to_read("file", self.path) as file:
            self.size = os.fstat(file.fileno()).st_size
        suffix = self.path.suffix.lower()
        try:
            if suffix == ".npz":
                # Not numpy.load, which advises to trust what is no archive.
                with self.path.open("rb") as file, np.lib.npyio.NpzFile(file) as archive:
                    yield archive
            else:
                # Not h5netcdf, which complains once more when it closes what it could not open.
                with h5py.File(self.path, "r") as file:
                    yield {**file, **{name: file.attrs[name] for name in {STEP} & {*file.attrs}}}
        except InputError:
            raise
        except Exception as error:
            # Readers raise errors of many kinds on other files.
            allowed = f"{_FORMATS[suffix]} ({shortly(error)})"
            raise bad_value("file", str(self.path), allowed, "write it again") from error

    def _numbers(self, arrays: Mapping[str, Any], name: str) -> np.ndarray:
        """The numbers of one array."""
        stored = arrays[name]
        if isinstance(stored, h5py.Dataset) and (
            stored.is_virtual or stored.external or stored.nbytes > _COMPRESSED * self.size
        ):
            given, allowed = "numbers that are not in the file", "all numbers in the file itself"
            self._refuse(name, given, allowed, "write all numbers into one file")
        numbers = np.asarray(stored)
        if numbers.dtype.kind not in "fiu":
            self._refuse(name, str(numbers.dtype), "real numbers", "store float64")
        return numbers.astype(np.float64, copy=False)

    def _refuse(self, name: str, given: object, allowed: str, fix: str) -> None:
        raise bad_value(f"{self.path}, {name}", given, allowed, fix)
