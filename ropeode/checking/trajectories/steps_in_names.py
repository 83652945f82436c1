"""Steps per frame in the names of files, as in 32.csv, 64.csv and 128.csv."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

# Numbers with a point or an exponent are step sizes rather than numbers of steps.
_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
# Two step sizes are equal if they differ by less, as a part of them.
_SAME = 1e-3


def steps_in_names(paths: Sequence[Path]) -> list[int]:
    """The steps per frame in the names of files that differ in nothing else.

    Arguments:
        paths: of the files, at least two.

    Raises:
        ValueError: the names may mean something else; its text says why.
    """
    names = [path.stem for path in paths]
    numbers = [_NUMBER.findall(name) for name in names]
    if len({_NUMBER.sub("#", name) for name in names}) > 1:
        raise ValueError("the names differ in more than a number")
    differing = [column for column in zip(*numbers, strict=True) if len(set(column)) > 1]
    if not differing:
        raise ValueError("no number tells the names apart")
    if len(differing) > 1:
        raise ValueError("the names differ in more than one number")
    for text in differing[0]:
        if not text.isdecimal() or int(text) < 1:
            raise ValueError(f"{text} in a name is no number of steps")
    steps = [int(text) for text in differing[0]]
    if max(steps) - min(steps) == len(steps) - 1:
        raise ValueError(f"{min(steps)} to {max(steps)} in the names may number the files")
    return steps


def by_names(steps: Sequence[int], dts: Sequence[float], frame: float) -> list[float] | None:
    """Step sizes in the order of the files, whose names say how many steps are in a frame.

    Arguments:
        steps: that the name of each file says.
        dts: the step sizes in any order.
        frame: the length of a frame.

    Returns:
        The step size of each file; None if they are not those that the names say.

    Raises:
        ValueError: names and step sizes fit in another order and in another unit of time.
    """
    order = np.argsort(np.argsort(-np.asarray(steps)))
    sorted_by_names = np.sort(dts)[order]
    if _constant(sorted_by_names * steps, frame):
        return sorted_by_names.tolist()
    ratio = float(sorted_by_names[0] * steps[0])
    if _constant(sorted_by_names * steps, ratio) and not (
        _constant(np.multiply(dts, steps), dts[0] * steps[0])
        or _constant(np.divide(dts, steps), dts[0] / steps[0])
    ):
        raise ValueError("in another order, they would be proportional to one over the number")
    return None


def _constant(values: np.ndarray, value: float) -> bool:
    return bool(np.all(np.abs(values - value) <= _SAME * abs(value)))
