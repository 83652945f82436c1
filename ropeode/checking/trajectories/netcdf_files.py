"""Trajectories in NetCDF4."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import h5py
import numpy as np

from ropeode.checking.trajectories.array_files import SAMPLES, STEP, ArrayFile, Stored

# A chunk is read as a whole.
_LARGEST_CHUNK = 2**28


class NetcdfFile(ArrayFile):
    """An `ArrayFile` of variables with dimensions of any names; `dt` is a global attribute."""

    format = "a NetCDF4 file"

    @contextlib.contextmanager
    def arrays(self) -> Iterator[dict[str, Stored]]:
        """Open the file; those of the four arrays that it has."""
        # Not h5netcdf, which complains once more when a file is closed that it could not open.
        with h5py.File(self.path, "r") as file:
            arrays = {name: self._stored(name, file[name]) for name in SAMPLES if name in file}
            if STEP in file.attrs:
                step = file.attrs.get_id(STEP)
                arrays[STEP] = Stored(
                    step.shape, step.dtype, lambda _: np.asarray(file.attrs[STEP])
                )
            yield arrays

    def _stored(self, name: str, data: Any) -> Stored:
        """A variable, if all its numbers are in the file itself."""
        if not isinstance(data, h5py.Dataset):
            self.refuse(name, "a group", "a variable", "write numbers")
        size = int(np.prod(data.shape, dtype=object)) * data.dtype.itemsize
        if data.chunks is None:
            whole = data.id.get_storage_size() == size
        else:
            counts = (-(-n // c) for n, c in zip(data.shape, data.chunks, strict=True))
            whole = data.id.get_num_chunks() == int(np.prod([*counts], dtype=object))
            chunk = int(np.prod(data.chunks, dtype=object)) * data.dtype.itemsize
            if chunk > _LARGEST_CHUNK:
                allowed = f"chunks of up to {_LARGEST_CHUNK} bytes"
                self.refuse(name, chunk, allowed, "write smaller ones")
        if data.is_virtual or data.external or not whole:
            given, allowed = "numbers that are not in the file", "all numbers in the file itself"
            self.refuse(name, given, allowed, "write all numbers into one file")
        at = 0

        def read(count: int) -> np.ndarray:
            nonlocal at
            at += count
            return data[at - count : at]

        return Stored(tuple(data.shape), data.dtype, read)
