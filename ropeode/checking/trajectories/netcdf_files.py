"""Trajectories in NetCDF4."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5netcdf
import numpy as np

from ropeode.checking.trajectories import array_files
from ropeode.checking.trajectories.array_files import Stored
from ropeode.checking.trajectories.layout import Block, Layout
from ropeode.errors import InputError
from ropeode.validation import complaint, in_one_line

# A chunk is read as a whole.
_LARGEST_CHUNK = 2**28


class NetcdfFile:
    """A file with the variables `t`, `positions`, `velocities` and the global attribute `dt`.

    The last two are optional. Dimensions may have any names.

    Arguments:
        path: of the file.
        layout: of its samples.

    Raises:
        InputError: it cannot be read, or has other contents.
    """

    def __init__(self, path: Path, layout: Layout):
        self.path, self.layout = path, layout
        self.dt: str | None = None
        with self._opened() as file:
            self.size = path.stat().st_size
            if array_files.STEP in file.attrs:
                step = np.asarray(file.attrs[array_files.STEP])
                if step.size != 1 or step.dtype.kind not in "fiu":
                    given, fix = str(step), "store dt as a number"
                    raise InputError(complaint(f"{path}, dt", given, "one real number", fix))
                self.dt = repr(float(step.reshape(-1)[0]))
            self.velocities = array_files.check_arrays(path, layout, self._arrays(file))

    def blocks(self) -> Iterator[Block]:
        """All samples, in blocks.

        Raises:
            InputError: the file is damaged.
        """
        with self._opened() as file:
            yield from array_files.blocks_of(self.layout, self._arrays(file), self.velocities)

    @contextlib.contextmanager
    def _opened(self) -> Iterator[h5netcdf.File]:
        try:
            # Distinguishes a file that cannot be read from one that is not NetCDF.
            self.path.open("rb").close()
        except OSError as error:
            allowed = f"a file that can be read ({error.strerror})"
            raise InputError(
                complaint("file", str(self.path), allowed, "check the path")
            ) from error
        try:
            with h5netcdf.File(self.path, "r") as file:
                yield file
        except InputError:
            raise
        except Exception as error:
            # HDF5 and h5netcdf raise errors of many kinds on other files.
            allowed = f"a NetCDF4 file ({in_one_line(error)})"
            raise InputError(
                complaint("file", str(self.path), allowed, "write it again")
            ) from error

    def _arrays(self, file: h5netcdf.File) -> dict[str, Stored]:
        return {
            name: self._stored(name, file.variables[name])
            for name in array_files.SAMPLES
            if name in file.variables
        }

    def _stored(self, name: str, variable: Any) -> Stored:
        """A variable, if all its numbers are in the file itself."""
        data = variable._h5ds
        size = int(np.prod(data.shape, dtype=object)) * data.dtype.itemsize
        if data.chunks is None:
            whole = data.id.get_storage_size() == size
        else:
            counts = (-(-n // c) for n, c in zip(data.shape, data.chunks, strict=True))
            whole = data.id.get_num_chunks() == int(np.prod([*counts], dtype=object))
            chunk = int(np.prod(data.chunks, dtype=object)) * data.dtype.itemsize
            if chunk > _LARGEST_CHUNK:
                allowed, fix = f"chunks of up to {_LARGEST_CHUNK} bytes", "write smaller ones"
                raise InputError(complaint(f"{self.path}, {name}", chunk, allowed, fix))
        if data.is_virtual or data.external or not whole:
            given, allowed = "numbers that are not in the file", "all numbers in the file itself"
            fix = "write all numbers into one file"
            raise InputError(complaint(f"{self.path}, {name}", given, allowed, fix))
        at = 0

        def read(count: int) -> np.ndarray:
            nonlocal at
            at += count
            return np.asarray(variable[at - count : at])

        return Stored(tuple(data.shape), data.dtype, read)
