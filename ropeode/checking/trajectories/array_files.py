"""Trajectories stored as arrays: names, shapes, and reading in slices."""

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
    """An array in a file, not yet read.

    Fields:
        shape: of the array.
        dtype: of its numbers.
        read: reads so many further entries along the first axis.
    """

    shape: tuple[int, ...]
    dtype: np.dtype
    read: Callable[[int], np.ndarray]


def check_arrays(path: Path, layout: Layout, arrays: Mapping[str, Stored]) -> bool:
    """Check names, shapes and types; returns whether there are velocities.

    Raises:
        InputError: an array is missing, or has a wrong shape or type.
    """
    for name in (TIMES, POSITIONS):
        if name not in arrays:
            allowed = f"arrays named {TIMES!r}, {POSITIONS!r}" + (
                f" and optionally {VELOCITIES!r}" if layout.mechanical else ""
            )
            raise InputError(
                complaint(str(path), sorted(arrays), allowed, f"add the array {name!r}")
            )
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
            raise InputError(complaint(f"{path}, {name}", stored.shape, allowed, fix))
        if stored.dtype.kind not in "fiu":
            allowed, fix = "real numbers", "store float64"
            raise InputError(complaint(f"{path}, {name}", str(stored.dtype), allowed, fix))
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
