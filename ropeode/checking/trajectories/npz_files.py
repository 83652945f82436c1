"""Trajectories in NPZ, as `numpy.savez` writes them."""

from __future__ import annotations

import contextlib
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import numpy as np

from ropeode.checking.trajectories import array_files
from ropeode.checking.trajectories.array_files import Stored
from ropeode.checking.trajectories.layout import Block, Layout
from ropeode.errors import InputError
from ropeode.validation import complaint

_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


class NpzFile:
    """An archive of the arrays `t`, `positions`, `velocities` and `dt`; the last two are optional.

    Arrays are read in blocks, and nothing is unpickled.

    Arguments:
        path: of the file.
        layout: of its samples.

    Raises:
        InputError: it cannot be read, or has other contents.
    """

    def __init__(self, path: Path, layout: Layout):
        self.path, self.layout = path, layout
        self.dt: str | None = None
        with self._opened() as archive:
            self.size = path.stat().st_size
            arrays = self._arrays(archive, (*array_files.SAMPLES, array_files.STEP))
            step = arrays.pop(array_files.STEP, None)
            if step is not None:
                if step.shape not in ((), (1,)) or step.dtype.kind not in "fiu":
                    given, fix = f"{step.dtype} of the shape {step.shape}", "store dt as a number"
                    raise InputError(complaint(f"{path}, dt", given, "one real number", fix))
                self.dt = repr(float(step.read(1).reshape(-1)[0]))
            self.velocities = array_files.check_arrays(path, layout, arrays)

    def blocks(self) -> Iterator[Block]:
        """All samples, in blocks.

        Raises:
            InputError: the file is damaged.
        """
        with self._opened() as archive:
            arrays = self._arrays(archive, array_files.SAMPLES)
            yield from array_files.blocks_of(self.layout, arrays, self.velocities)

    @contextlib.contextmanager
    def _opened(self) -> Iterator[zipfile.ZipFile]:
        try:
            with zipfile.ZipFile(self.path) as archive:
                yield archive
        except InputError:
            raise
        except OSError as error:
            allowed = f"a file that can be read ({error.strerror or error})"
            raise InputError(
                complaint("file", str(self.path), allowed, "check the path")
            ) from error
        except (
            zipfile.BadZipFile,
            zlib.error,
            EOFError,
            ValueError,
            NotImplementedError,
            RuntimeError,
        ) as error:
            allowed = f"an archive written by numpy.savez ({' '.join(str(error).split())})"
            raise InputError(
                complaint("file", str(self.path), allowed, "write it again")
            ) from error

    def _arrays(self, archive: zipfile.ZipFile, names: tuple[str, ...]) -> dict[str, Stored]:
        there = {info.filename for info in archive.infolist()}
        return {name: self._stored(archive, name) for name in names if f"{name}.npy" in there}

    def _stored(self, archive: zipfile.ZipFile, name: str) -> Stored:
        """An array, of which only the header is read."""
        info = archive.getinfo(f"{name}.npy")
        stream = archive.open(info)
        version = np.lib.format.read_magic(stream)  # type: ignore[arg-type]
        if version not in _HEADERS:
            raise ValueError(f"{name} is stored in version {version} of the format")
        shape, fortran, dtype = _HEADERS[version](stream)  # type: ignore[operator]
        if dtype.hasobject:
            fix = "store numbers"
            raise InputError(complaint(f"{self.path}, {name}", "objects", "real numbers", fix))
        if fortran and len(shape) > 1:
            allowed, fix = "an array in C order", f"store numpy.ascontiguousarray({name})"
            given = "an array in Fortran order"
            raise InputError(complaint(f"{self.path}, {name}", given, allowed, fix))
        declared = int(np.prod(shape, dtype=object)) * dtype.itemsize
        if stream.tell() + declared != info.file_size:
            allowed = f"{declared} bytes, as its header says"
            given = f"{info.file_size - stream.tell()} bytes of numbers"
            raise InputError(complaint(f"{self.path}, {name}", given, allowed, "write it again"))

        def read(count: int) -> np.ndarray:
            size = count * int(np.prod(shape[1:], dtype=object)) * dtype.itemsize
            return np.frombuffer(_exactly(stream, size), dtype).reshape(-1, *shape[1:])

        return Stored(shape, dtype, read)


def _exactly(stream: IO[bytes], size: int) -> bytes:
    data = stream.read(size)
    if len(data) != size:
        raise EOFError("the file is cut off")
    return data
