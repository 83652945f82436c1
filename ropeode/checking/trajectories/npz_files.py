"""Trajectories in NPZ, as `numpy.savez` writes them."""

from __future__ import annotations

import contextlib
import zipfile
from collections.abc import Iterator
from typing import IO

import numpy as np

from ropeode.checking.trajectories.array_files import SAMPLES, STEP, ArrayFile, Stored

_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


class NpzFile(ArrayFile):
    """An `ArrayFile` that is an archive of arrays, of which nothing is unpickled."""

    format = "an archive written by numpy.savez"

    @contextlib.contextmanager
    def arrays(self) -> Iterator[dict[str, Stored]]:
        """Open the file; those of the four arrays that it has."""
        with zipfile.ZipFile(self.path) as archive:
            there = {name.removesuffix(".npy") for name in archive.namelist()}
            yield {name: self._stored(archive, name) for name in (*SAMPLES, STEP) if name in there}

    def _stored(self, archive: zipfile.ZipFile, name: str) -> Stored:
        """An array, of which only the header is read."""
        info = archive.getinfo(f"{name}.npy")
        stream = archive.open(info)
        version = np.lib.format.read_magic(stream)  # type: ignore[arg-type]
        if version not in _HEADERS:
            raise ValueError(f"{name} is stored in version {version} of the format")
        shape, fortran, dtype = _HEADERS[version](stream)  # type: ignore[operator]
        if dtype.hasobject:
            self.refuse(name, "objects", "real numbers", "store numbers")
        if fortran and len(shape) > 1:
            fix = f"store numpy.ascontiguousarray({name})"
            self.refuse(name, "an array in Fortran order", "an array in C order", fix)
        declared = int(np.prod(shape, dtype=object)) * dtype.itemsize
        if stream.tell() + declared != info.file_size:
            given = f"{info.file_size - stream.tell()} bytes of numbers"
            self.refuse(name, given, f"{declared} bytes, as its header says", "write it again")

        def read(count: int) -> np.ndarray:
            size = count * int(np.prod(shape[1:], dtype=object)) * dtype.itemsize
            return np.frombuffer(_exactly(stream, size), dtype).reshape(-1, *shape[1:])

        return Stored(shape, dtype, read)


def _exactly(stream: IO[bytes], size: int) -> bytes:
    data = stream.read(size)
    if len(data) != size:
        raise EOFError("the file is cut off")
    return data
