"""Trajectories stored as named arrays, whatever the format: checked, and read in blocks."""

from __future__ import annotations

import abc
import contextlib
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np

from ropeode.checking.trajectories.layout import Block, Layout
from ropeode.errors import InputError
from ropeode.files import open_to_read
from ropeode.validation import bad_value, shortly

_BLOCK = 2**22
TIMES, POSITIONS, VELOCITIES, STEP = "t", "positions", "velocities", "dt"
SAMPLES = (TIMES, POSITIONS, VELOCITIES)


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
