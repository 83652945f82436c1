"""Trajectories stored as named arrays, in NPZ or NetCDF4: checked, and read in blocks."""

from __future__ import annotations

import abc
import contextlib
import os
import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any, ClassVar, NamedTuple

import h5py
import numpy as np

from ropeode.checking.trajectories.layout import Block, Layout
from ropeode.errors import InputError
from ropeode.files import open_to_read
from ropeode.validation import bad_value, shortly

_BLOCK = 2**22
TIMES, POSITIONS, VELOCITIES, STEP = "t", "positions", "velocities", "dt"
SAMPLES = (TIMES, POSITIONS, VELOCITIES)
_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
# A chunk is read as a whole.
_LARGEST_CHUNK = 2**28


class Stored(NamedTuple):
    """An array in a file, not yet read.

    Fields:
        shape: of the array.
        dtype: of its numbers.
        read: reads so many further entries along the first axis.
    """

    shape: tuple[int, ...]
    dtype: np.dtype
    read: Callable[[int], np.ndarray]


class ArrayFile(abc.ABC):
    """A file of the arrays `t`, `positions`, `velocities` and `dt`; the last two are optional.

    Arguments:
        path: of the file.
        layout: of its samples.

    Raises:
        InputError: it cannot be read, or has other contents.
    """

    format: ClassVar[str]

    def __init__(self, path: Path, layout: Layout):
        self.path, self.layout = path, layout
        with self._opened() as arrays:
            self.dt = self._step(arrays[STEP]) if STEP in arrays else None
            self.velocities = _check_arrays(path, layout, arrays)

    @abc.abstractmethod
    def arrays(self) -> contextlib.AbstractContextManager[dict[str, Stored]]:
        """Open the file; those of the four arrays that it has."""

    def blocks(self) -> Iterator[Block]:
        """All samples, in blocks of a few megabytes.

        Raises:
            InputError: the file is damaged.
        """
        with self._opened() as arrays:
            yield from _blocks_of(self.layout, arrays, self.velocities)

    @contextlib.contextmanager
    def _opened(self) -> Iterator[dict[str, Stored]]:
        # Some readers report a file that is not there like one of another format.
        with open_to_read("file", self.path) as file:
            self.size = os.fstat(file.fileno()).st_size
        try:
            with self.arrays() as arrays:
                yield arrays
        except InputError:
            raise
        except Exception as error:
            # Readers raise errors of many kinds on other files.
            allowed = f"{self.format} ({shortly(error)})"
            raise bad_value("file", str(self.path), allowed, "write it again") from error

    def _step(self, stored: Stored) -> str:
        if stored.shape not in ((), (1,)) or stored.dtype.kind not in "fiu":
            given = f"{stored.dtype} of the shape {stored.shape}"
            self.refuse(STEP, given, "one real number", "store dt as a number")
        return repr(float(stored.read(1).reshape(-1)[0]))

    def refuse(self, name: str, given: object, allowed: str, fix: str) -> None:
        """Complain of one array.

        Raises:
            InputError: always.
        """
        raise bad_value(f"{self.path}, {name}", given, allowed, fix)


def _check_arrays(path: Path, layout: Layout, arrays: Mapping[str, Stored]) -> bool:
    """Check names, shapes and types; returns whether there are velocities."""
    for name in (TIMES, POSITIONS):
        if name not in arrays:
            allowed = f"arrays named {TIMES!r}, {POSITIONS!r}" + (
                f" and optionally {VELOCITIES!r}" if layout.mechanical else ""
            )
            raise bad_value(str(path), sorted(arrays), allowed, f"add the array {name!r}")
    count = arrays[TIMES].shape[0] if arrays[TIMES].shape else 0
    whole = (count, layout.nodes, layout.dim)
    wanted = {TIMES: (count,), POSITIONS: whole}
    if layout.mechanical and VELOCITIES in arrays:
        wanted[VELOCITIES] = whole
    for name, shape in wanted.items():
        stored = arrays[name]
        if stored.shape != shape:
            words = "(times, nodes, dim)" if len(shape) > 1 else "(times,)"
            allowed = f"the shape {shape}, that is {words} of this problem"
            fix = "reorder the axes, or grade the file with its own spec"
            raise bad_value(f"{path}, {name}", stored.shape, allowed, fix)
        if stored.dtype.kind not in "fiu":
            allowed, fix = "real numbers", "store float64"
            raise bad_value(f"{path}, {name}", str(stored.dtype), allowed, fix)
    return VELOCITIES in wanted


def _blocks_of(layout: Layout, arrays: Mapping[str, Stored], velocities: bool) -> Iterator[Block]:
    names = (POSITIONS, VELOCITIES) if velocities else (POSITIONS,)
    columns = layout.columns(velocities)
    count, each = arrays[TIMES].shape[0], 8 * layout.nodes * len(columns)
    block = max(1, _BLOCK // each)
    for first in range(0, count, block):
        size = min(block, count - first)

        def where(sample: int, node: int | None, column: int | None, first: int = first) -> str:
            if node is None or column is None:
                return f"{TIMES}[{first + sample}]"
            name, axis = names[column // layout.dim], column % layout.dim
            return f"{name}[{first + sample}, {node}, {axis}]"

        parts = [np.asarray(arrays[name].read(size), dtype=np.float64) for name in names]
        times = np.asarray(arrays[TIMES].read(size), dtype=np.float64)
        yield Block(times, np.concatenate(parts, axis=2), where)


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
