"""The table of what columns of files may hold instead of what their headers say."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ropeode.checking.simple_numbers import shortest, shortest_factor
from ropeode.checking.trajectories.run_files import Run
from ropeode.validation import listed

# Of more coordinates only those in order are tried.
_MOST_AXES = 3
# What varies less than this part of the rest has no unit that could be seen.
_FLAT = 1e-6
# No unit is larger; what blew up may be.
_LARGEST_FACTOR = 1e12
# By how much an extrapolated number may be off, in units of its estimated error.
_SAFETY = 5.0
# Units of rounding of a number that is read off the first sample.
_ROUNDINGS = 64.0
# Numbers may be multiplied by these powers of dt, with these words and remedies.
_POWERS = {
    0: ("{}times those of the problem", "write them in the problem's units"),
    1: ("{}dt times those of the problem: per step", "divide them by dt"),
    -1: ("{}1/dt times those of the problem", "multiply them by dt"),
}
_LEAVE_OUT = "write the velocities, or leave their columns out"

# The right numbers ``(rows, nodes, columns)`` from those of a file, and its step size.
Undo = Callable[[np.ndarray, float], np.ndarray]


class Transform(NamedTuple):
    """One mistake in writing numbers: its words, how it is mended, and how it is undone."""

    words: str
    fix: str
    undo: Undo


class Samples(NamedTuple):
    """Rows of files, as far as they are read otherwise already, beside the right ones.

    Fields:
        run: one of the runs, for their layout.
        dts: step sizes, from coarse to fine.
        files: the numbers of each run, ``(rows, nodes, columns)``.
        truth: the right ones.
        begins: whether the first row is that of the initial state.
        precision: how far a number may be off that is read off the first row, as a part of it.
    """

    run: Run
    dts: Sequence[float]
    files: Sequence[np.ndarray]
    truth: np.ndarray
    begins: bool
    precision: float


def precision_of(run: Run) -> float:
    """How precisely a number is read off a row of a run, as a part of the largest ones."""
    sizes = np.array([np.max(np.abs(part)) for part in run.parts_of(run.values)])
    digits = np.divide(run.rounding[:: run.layout.dim], sizes, where=sizes > 0.0, out=0.0 * sizes)
    return _ROUNDINGS * run.epsilon + 2.0 * float(np.max(digits))


class _Part(NamedTuple):
    """Quantities that one mistake changes alike: of their blocks ``(rows, nodes, k, dim)``."""

    blocks: slice
    columns: tuple[str, ...]
    name: str
    of: str = ""
    alone: str = ""


def transforms(samples: Samples) -> Iterator[Transform]:
    """The rows of the table for some files: numbers are read off them, or fitted to them."""
    layout, dim = samples.run.layout, samples.run.layout.dim
    two = samples.files[-1].shape[2] > dim
    speeds = tuple(f"v{axis}" for axis in layout.axes)
    if not two:
        name = "positions" if layout.mechanical else "numbers"
        parts = [_Part(slice(None), layout.axes, name)]
    else:
        yield from _of_velocities(samples)
        parts = [
            _Part(slice(None), layout.axes, "all numbers"),
            _Part(slice(1, 2), speeds, "velocities", " of the velocities"),
            _Part(slice(0, 1), layout.axes, "positions", " of the positions", "in the positions, "),
        ]
    for part in parts:
        for words, fix, change in (*_rearranged(samples, part), *_scaled(samples, part)):
            yield Transform(words, fix, _on(part, dim, change))


def _on(part: _Part, dim: int, change: Undo) -> Undo:
    """A change of some blocks alone."""

    def undo(values: np.ndarray, dt: float) -> np.ndarray:
        new = values.reshape(*values.shape[:2], -1, dim).copy()
        new[:, :, part.blocks] = change(new[:, :, part.blocks], dt)
        return new.reshape(values.shape)

    return undo


def _rearranged(samples: Samples, part: _Part) -> Iterator[Transform]:
    """Nodes or columns in another order, or an axis that points the other way."""
    layout, columns, dim = samples.run.layout, part.columns, samples.run.layout.dim
    if layout.nodes > 1:
        nodes, fix = (
            ("nodes", "number nodes from the other end")
            if layout.mechanical
            else ("components", "write the first one first")
        )
        words = f"the {nodes}{part.of} are in reverse order"
        yield Transform(words, fix, lambda v, _: v[:, ::-1])
    for order in itertools.permutations(range(dim)) if dim <= _MOST_AXES else ():
        holds = [(columns[k], columns[axis]) for k, axis in enumerate(order) if k != axis]
        if holds:
            words = listed(f"column {one} holds {other}" for one, other in holds)
            back = np.argsort(order)
            fix = f"write {' before '.join(columns)}"
            yield Transform(words, fix, lambda v, _, back=back: v[..., back])
    for signs, column in zip(1.0 - 2.0 * np.eye(dim), columns, strict=True):
        fix = f"let {column} point in the direction of the spec"
        words = f"{part.alone}{column} points the other way"
        yield Transform(words, fix, lambda v, _, signs=signs: v * signs)


def _of_velocities(samples: Samples) -> Iterator[Transform]:
    """What velocities may be instead."""
    dim, values = samples.run.layout.dim, samples.files[-1]
    velocities = _Part(slice(1, 2), (), "velocities")

    def without(values: np.ndarray, dt: float) -> np.ndarray:
        return values[:, :, :dim]

    if all(not np.any(each[:, :, dim:]) for each in samples.files):
        if np.any(samples.truth[:, :, dim:]):
            yield Transform("the velocities are zero", _LEAVE_OUT, without)
        return
    if np.array_equal(values[:, :, dim:], values[:, :, :dim]):
        yield Transform("the columns of the velocities hold positions", _LEAVE_OUT, without)
    yield Transform(
        "the columns hold the velocities before the positions",
        "write the positions before the velocities",
        lambda values, dt: np.concatenate([values[..., dim:], values[..., :dim]], axis=2),
    )
    yield Transform(
        "the velocities have the wrong sign",
        "write them with the other sign",
        _on(velocities, dim, lambda v, _: -v),
    )
    mass = np.ravel(getattr(samples.run.problem.args, "mass", ()))
    if len(mass) == samples.run.layout.nodes and np.ptp(mass):
        yield Transform(
            "velocities are multiplied by the masses",
            "divide them by the masses",
            _on(velocities, dim, lambda v, _: v / mass[:, None, None]),
        )


def _scaled(samples: Samples, part: _Part) -> Iterator[Transform]:
    """Another unit, or a factor of dt."""
    dim, problem = samples.run.layout.dim, samples.run.problem
    # Of all numbers the first block tells.
    block = part.blocks.start or 0
    columns = slice(block * dim, (block + 1) * dim)
    truth, moves = samples.truth[:, :, columns], block == 0
    fits = [_factor_of(each[:, :, columns], truth, moves, samples.begins) for each in samples.files]
    known = [fit for fit in fits if fit is not None]
    if len(known) < len(fits):
        return
    size = float(np.max(np.abs(samples.files[-1][:, :, columns])))
    room = samples.precision * max(1.0, problem.scale / size if moves else 0.0)
    power, factor = _simplest(samples.dts, [each for each, _ in known], room, known[-1][1])
    if not factor or (power, factor) == (0, 1.0):
        return
    words, fix = _POWERS[power]
    words = words.format("" if factor == 1.0 else f"{factor:.6g} ")
    yield Transform(f"{part.name} are {words}", fix, lambda v, dt: v / (factor * dt**power))


def _factor_of(
    values: np.ndarray, truth: np.ndarray, moves: bool, begins: bool
) -> tuple[float, bool] | None:
    """The factor of numbers, whatever their signs; and whether it is read off the first row."""

    def products(rows: slice) -> tuple[np.ndarray, np.ndarray]:
        a, b = values[rows], truth[rows]
        if moves:
            a, b = a - np.mean(a, axis=(0, 1)), b - np.mean(b, axis=(0, 1))
        return np.sum(a * b, axis=(0, 1)), np.sum(b * b, axis=(0, 1))

    (first, first_size), (every, size) = products(slice(0, 1)), products(slice(None))
    total = float(np.sum(size))
    if not (0.0 < total < np.inf) or not np.all(np.isfinite(every)):
        return None
    exact = begins and bool(np.sum(first_size) > _FLAT * total)
    near, near_size = (first, first_size) if exact else (every, size)
    factor = float(np.sum(np.abs(near)) / np.sum(near_size))
    return (factor, exact) if 1.0 / _LARGEST_FACTOR < factor < _LARGEST_FACTOR else None


def _simplest(
    dts: Sequence[float], factors: Sequence[float], rounding: float, exact: bool
) -> tuple[int, float]:
    """The power of dt and the number whose product is the factor of each run."""

    def limit(power: int) -> tuple[float, float]:
        """The number at the finest dt, and how far its limit may be from it."""
        near, *rest = (factors[k] / dts[k] ** power for k in range(-1, -1 - min(len(dts), 2), -1))
        return near, sum(abs(near - far) / min(dts[-2] / dts[-1] - 1.0, 1.0) for far in rest)

    power = min(_POWERS, key=lambda each: limit(each)[1] / limit(each)[0])
    factor, spread = limit(power)
    spread = rounding * factor + (0.0 if exact else _SAFETY * spread)
    return power, shortest_factor(factor, spread)


def linear(undo: Undo, run: Run, dt: float) -> np.ndarray:
    """What becomes of 1 in each column of a file, ``(columns, nodes, columns as read)``."""
    columns = np.arange(run.values.shape[2])
    units = np.zeros((len(columns) + 1, run.layout.nodes, len(columns)))
    units[columns, :, columns] = 1.0
    read = undo(units, dt)
    return read[:-1] - read[-1]


def shifted(samples: Samples, undo: Undo) -> Transform | None:
    """Another origin of positions, read off the first row.

    Arguments:
        samples: read otherwise already.
        undo: how; the words say by how much the numbers in the file are shifted.
    """
    dim, dt = samples.run.layout.dim, samples.dts[-1]
    values = samples.files[-1][:, :, :dim]
    size = max(float(np.max(np.abs(values))), samples.run.problem.scale)
    off = np.mean(values[0] - samples.truth[0, :, :dim], axis=0)
    offset = np.array([shortest(float(each), samples.precision * size) for each in off])
    if not np.any(offset):
        return None
    # Of the file's columns those that positions are read from.
    read = linear(undo, samples.run, dt)[:, 0, :dim]
    in_file = np.linalg.lstsq(read.T, offset, rcond=None)[0].reshape(-1, dim).sum(axis=0)

    def back(values: np.ndarray, _: float) -> np.ndarray:
        new = values.copy()
        new[:, :, :dim] -= offset
        return new

    words = f"positions are shifted by ({', '.join(f'{each + 0.0:.6g}' for each in in_file)})"
    return Transform(words, "use the origin of the spec", back)
