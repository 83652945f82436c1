"""What a step does besides returning a result: to arrays that are not its own, and to its process.

A trajectory is right only if nobody but the driver changes the states in it. A step that returns
the same array each time, or reads an array again that it returned, goes wrong with the first caller
who keeps one.
"""

from __future__ import annotations

import os
import random
import sys
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import numpy as np

from ropeode.simulation.python_driver import PythonStepper

# So many, that the arrays of a step that takes three in turn come round again.
_STEPS = 4
# By how much a caller changes a state between two steps: not a shift, which no force would notice.
_NUDGE = 1.0 + 2.0**-10
WRITES_OVER = "writes over results that it returned before (return a copy)"
_STREAMS = ("standard input", "standard output", "standard error")


class Results:
    """What a step has returned, and what was in it then."""

    def __init__(self) -> None:
        self._kept: list[tuple[Any, Any]] = []

    def keep(self, result: Any) -> None:
        """Remember a result."""
        self._kept.append((result, _copy(result)))

    @property
    def are_written_over(self) -> bool:
        """Whether one is no longer what it was."""
        return any(not _same(result, was) for result, was in self._kept)


def memory_effects(
    fresh: Callable[[], PythonStepper], t: float, y: np.ndarray, dt: float
) -> tuple[str, ...]:
    """What a step does to arrays that it was handed or has returned.

    Arguments:
        fresh: makes a stepper, with arguments of its own.
        t, y, dt: where it starts, and how long its steps are.
    """
    own = fresh()
    args = own.system.equations.args
    before = _copy(args)
    handed, results, modified = own.init(t, y, dt), Results(), False
    for i in range(_STEPS):
        was = _copy(handed)
        new = own.step(t + i * dt, handed, dt)
        modified |= not _same(was, handed)
        results.keep(new)
        handed = new
    disturbed, apart = (_disturbed(fresh(), t, y, dt, in_place) for in_place in (True, False))
    found = {
        f"modifies {'x or v' if own.system.mechanical else 'y'}": modified,
        "modifies args": not _same(before, args),
        WRITES_OVER: results.are_written_over,
        "keeps arrays that it was handed or has returned (keep a copy)": not modified
        and not _same(apart, disturbed),
    }
    return tuple(words for words, is_so in found.items() if is_so)


def _disturbed(own: PythonStepper, t: float, y: np.ndarray, dt: float, in_place: bool) -> Any:
    """The last result for a caller who changes each state a little before the next step.

    Arguments:
        own, t, y, dt: as for `memory_effects`.
        in_place: whether the caller writes to the arrays that are returned, and over those that
            nobody needs any more, or makes new ones.
    """
    handed = own.init(t, y, dt)
    for i in range(_STEPS):
        new = own.step(t + i * dt, handed, dt)
        changed = jax.tree.map(lambda leaf: leaf * _NUDGE if _writable(leaf) else leaf, new)
        if in_place:
            # What a stepper carries may be what it was handed.
            needed = [leaf for leaf in jax.tree.leaves(new) if isinstance(leaf, np.ndarray)]
            for old in filter(_writable, jax.tree.leaves(handed)):
                if not any(np.shares_memory(old, each) for each in needed):
                    old += 1.0
            jax.tree.map(_put, new, changed)
        handed = new if in_place else changed
    return handed


def _put(there: Any, value: Any) -> None:
    if _writable(there):
        there[...] = value


def _writable(leaf: Any) -> bool:
    return (
        isinstance(leaf, np.ndarray)
        and leaf.flags.writeable
        and np.issubdtype(leaf.dtype, np.floating)
    )


def _copy(tree: Any) -> Any:
    """A copy of the arrays of NumPy's; what else there is cannot be written to, or is not seen."""
    return jax.tree.map(lambda leaf: np.array(leaf) if isinstance(leaf, np.ndarray) else leaf, tree)


def _same(a: Any, b: Any) -> bool:
    pairs = zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True)
    return all(
        np.array_equal(one, other, equal_nan=True)
        for one, other in pairs
        if isinstance(other, np.ndarray)
    )


class ProcessState(NamedTuple):
    """What of its process a step leaves alone.

    Fields:
        folder: the working directory.
        variables: of the environment.
        streams: what identifies the three standard streams; None for one that is closed.
        others: what else there is one of in a process or a thread, by what a step does to it.
    """

    folder: str
    variables: dict[str, str]
    streams: tuple[tuple[int, int] | None, ...]
    others: dict[str, Any]


def process_state() -> ProcessState:
    """That of this process, as it is now."""
    shared: Any = np.random.get_state(legacy=False)  # noqa: NPY002
    others = {
        "draws or seeds the random numbers that all of NumPy shares": repr(shared["state"]),
        "draws or seeds the random numbers that all of Python shares": random.getstate(),
        "changes what NumPy does about floating-point errors": np.geterr(),
    }
    return ProcessState(os.getcwd(), dict(os.environ), tuple(map(_identity, range(3))), others)


def _identity(stream: int) -> tuple[int, int] | None:
    try:
        status = os.fstat(stream)
    except OSError:
        return None
    return status.st_dev, status.st_ino


def process_effects(before: ProcessState) -> Iterator[str]:
    """What has become of the process since then."""
    now = process_state()
    if now.folder != before.folder:
        yield "changes the working directory"
    if now.variables != before.variables:
        yield "changes the environment variables"
    for words, value in now.others.items():
        if value != before.others[words]:
            yield words
    for name, then, there in zip(_STREAMS, before.streams, now.streams, strict=True):
        if then != there:
            yield f"closes {name}" if there is None else f"redirects {name}"
    # Not whether it is another one: that may be a check in another thread, which keeps its output.
    if not hasattr(sys.stdout, "write"):
        yield "replaces sys.stdout"
    elif sys.stdout.closed:
        yield "closes standard output"
