"""What trajectories stored as arrays have in common: names, shapes, and reading in slices."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ropeode.checking.trajectories.layout import Block, Layout
from ropeode.errors import InputError
from ropeode.validation import complaint

_BLOCK = 2**22
TIMES, POSITIONS, VELOCITIES, STEP = "t", "positions", "velocities", "dt"
SAMPLES = (TIMES, POSITIONS, VELOCITIES)


class Stored(NamedTuple):
    """An array in a file, of which nothing has been read.

    Fields:
        shape: of the array.
        dtype: of its numbers.
        read: the next entries along the first axis, so many of them.
    """

    shape: tuple[int, ...]
    dtype: np.dtype
    read: Callable[[int], np.ndarray]


def check_arrays(path: Path, layout: Layout, arrays: Mapping[str, Stored]) -> bool:
    """See that the arrays are there, in the right shapes; whether there are velocities.

    Raises:
        InputError: they are not.
    """
    for name in (TIMES, POSITIONS):
        if name not in arrays:
            allowed = f"arrays named {TIMES!r}, {POSITIONS!r}" + (
                f" and, where they are known, {VELOCITIES!r}" if layout.mechanical else ""
            )
            raise InputError(
                complaint(str(path), sorted(arrays), allowed, f"write {name!r} as well")
            )
    count = arrays[TIMES].shape[0] if arrays[TIMES].shape else 0
    whole = (count, layout.nodes, layout.dim)
    wanted = {TIMES: (count,), POSITIONS: whole}
    if layout.mechanical and VELOCITIES in arrays:
        wanted[VELOCITIES] = whole
    for name, shape in wanted.items():
        given = arrays[name]
        if given.shape != shape:
            words = "(times, nodes, dim)" if len(shape) > 1 else "(times,)"
            allowed = f"the shape {shape}, which is {words} of this problem"
            fix = "reorder its axes, or grade it with its own spec"
            raise InputError(complaint(f"{path}, {name}", given.shape, allowed, fix))
        if given.dtype.kind not in "fiu":
            allowed, fix = "real numbers", "store float64"
            raise InputError(complaint(f"{path}, {name}", str(given.dtype), allowed, fix))
    return VELOCITIES in wanted


def blocks_of(layout: Layout, arrays: Mapping[str, Stored], velocities: bool) -> Iterator[Block]:
    """All samples, in blocks of a few megabytes."""
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
