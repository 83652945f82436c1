"""Columns that hold other numbers than their headers say: exchanged, mirrored, in another unit."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ropeode.checking.simple_numbers import shortest, shortest_factor
from ropeode.checking.trajectories.run_files import Run
from ropeode.checking.written_precision import (
    DIGITS_OF_FLOAT64,
    digits_of,
    epsilon,
    last_digit,
)
from ropeode.validation import listed

# An arrangement is tried if it leaves at most this part of the variation of the numbers.
_LEFT_OVER = 0.5
# Of more coordinates only those in order are tried.
_MOST_AXES = 3
# What varies less than this part of the rest has no sign and no unit that could be seen.
_FLAT = 1e-6
# No unit is larger; what blew up may be.
_LARGEST_FACTOR = 1e12
# By how much an extrapolated number may be off, in units of its estimated error.
_SAFETY = 5.0
# Units of rounding of a number that is read off the first sample.
_ROUNDINGS = 64.0
# Velocities may be multiplied by these powers of dt.
_POWERS = (0, 1, -1)
# What columns hold, where there are no velocities beside them.
_NUMBERS = {"": "positions", "state": "numbers"}


@dataclasses.dataclass(frozen=True)
class Held:
    """What the columns of one quantity hold.

    Arguments:
        source: the quantity that they hold; None if they are zero in each row.
        axes: for each column the coordinate of the source that it holds.
        signs: for each column 1; -1 if it is negated; 0 if it varies too little to tell.
        factor: by which the source is multiplied.
        power: of the step size by which it is multiplied, too.
        offset: what is added in each column.
        reverse: whether the nodes are in reverse order.
        weights: by which each node's numbers are multiplied, too; none if they are not.
    """

    source: str | None
    axes: tuple[int, ...]
    signs: tuple[int, ...]
    factor: float = 1.0
    power: int = 0
    offset: tuple[float, ...] = ()
    reverse: bool = False
    weights: tuple[float, ...] = ()

    def applied(self, source: np.ndarray, dt: float) -> np.ndarray:
        """What the columns hold of the source's values ``(times, nodes, dim)``."""
        source = source[:, ::-1] if self.reverse else source
        return self._scale(dt) * source[:, :, list(self.axes)] + self._offset

    def undone(self, values: np.ndarray, dt: float) -> np.ndarray:
        """The source's values from what the columns hold, both ``(times, nodes, dim)``."""
        source = np.empty_like(values)
        source[:, :, list(self.axes)] = (values - self._offset) / self._scale(dt)
        return source[:, ::-1] if self.reverse else source

    def _scale(self, dt: float) -> np.ndarray:
        signs = np.array(self.signs)
        weights = np.array(self.weights or (1.0,))[:, None]
        return self.factor * dt**self.power * np.where(signs == 0, 1, signs) * weights

    @property
    def _offset(self) -> np.ndarray:
        return np.array(self.offset or (0.0,) * len(self.axes))


@dataclasses.dataclass(frozen=True)
class Arrangement:
    """What all columns hold.

    Arguments:
        held: of positions, and of velocities if there are any.
        after: the number of rows before, which are right.
    """

    held: tuple[Held, ...]
    after: int = 0

    @property
    def moves_positions(self) -> bool:
        """Whether the positions are not where their columns say."""
        return not _is_right(self.held[0], self.held[0].source)

    def undone_in(self, runs: Sequence[Run]) -> tuple[Run, ...]:
        """Runs as they should have been written, without quantities that they lack."""
        return tuple(map(self._undone, runs))

    def _undone(self, run: Run) -> Run:
        names, dim, parts = run.problem.quantities, run.layout.dim, {}
        blocks = {name: run.values[:, :, i * dim : (i + 1) * dim] for i, name in enumerate(names)}
        for name, held in zip(names, self.held, strict=False):
            if held.source is not None:
                undone = _rounded(held, blocks[name], run.dt)
                right = blocks[held.source][: self.after]
                parts[held.source] = np.concatenate([right, undone[self.after :]])
        kept = [parts[name] for name in names if name in parts]
        return dataclasses.replace(run, values=np.concatenate(kept, axis=2))


def _rounded(held: Held, values: np.ndarray, dt: float) -> np.ndarray:
    """What columns stand for, with no more digits than they have."""
    source, (digits, decimals) = held.undone(values, dt), digits_of(values)
    if digits > DIGITS_OF_FLOAT64:
        return source
    return np.round(source, decimals + math.floor(math.log10(held.factor * dt**held.power)))


def arrangements(states: np.ndarray, runs: Sequence[Run], after: int = 0) -> list[Arrangement]:
    """Arrangements of the columns that come close to the right states, beside the right one.

    The sign, the factor and the offset of each column are read off the first sample, or fitted
    to all samples where that says nothing.

    Arguments:
        states: of the first sample times, ``(samples, *state)``.
        runs: from coarse to fine.
        after: the number of rows before, which are right.
    """
    names = runs[0].problem.quantities
    each = [list(_holding(states, runs, name, after)) for name in runs[0].quantities]
    return [
        Arrangement(held, after)
        for held in itertools.product(*each)
        if held[0].source is not None
        # Positions cannot be left out.
        and names[0] in {part.source for part in held}
        and not all(map(_is_right, held, names))
    ]


def _is_right(held: Held, name: str | None) -> bool:
    signs = tuple(1 if sign == 0 else sign for sign in held.signs)
    usual = Held(name, tuple(range(len(held.axes))), (1,) * len(held.axes))
    return dataclasses.replace(held, signs=signs) == usual


def _holding(states: np.ndarray, runs: Sequence[Run], quantity: str, after: int) -> Iterator[Held]:
    """What the columns of a quantity may hold."""
    problem, dim, rows = runs[0].problem, runs[0].layout.dim, slice(after, len(states))
    place, states = problem.quantities.index(quantity) * dim, states[after:]
    files = [run.values[rows, :, place : place + dim] for run in runs]
    in_order = tuple(range(dim))
    if not any(np.any(values) for values in files):
        right = problem.quantity(quantity, states)
        yield Held(None if np.any(right) else quantity, in_order, (0,) * dim)
        return
    orders = [*itertools.permutations(in_order)] if dim <= _MOST_AXES else [in_order]
    held = [
        Held(source, axes, (), reverse=reverse)
        for source in problem.quantities
        for axes in orders
        for reverse in ((False, True) if runs[0].layout.nodes > 1 else (False,))
    ]
    mass = np.ravel(getattr(problem.args, "mass", ()))
    if problem.mechanics is not None and len(mass) == runs[0].layout.nodes and np.ptp(mass):
        held.append(Held(problem.quantities[-1], in_order, (), weights=tuple(mass.tolist())))
    for each in held:
        fitted = _fitted(
            each,
            [run.dt for run in runs],
            files,
            problem.quantity(str(each.source), states),
            moves=each.source == problem.quantities[0],
            exact=not after,
            scale=problem.scale,
        )
        if fitted is not None:
            yield fitted


def _fitted(
    held: Held,
    dts: Sequence[float],
    files: Sequence[np.ndarray],
    source: np.ndarray,
    *,
    moves: bool,
    exact: bool,
    scale: float,
) -> Held | None:
    """With the signs, the factor and the offset that the files show; None if they show none.

    Arguments:
        held: the source and its order.
        dts: the step sizes of the runs, from coarse to fine.
        files: the columns of one quantity, ``(times, nodes, dim)``, of each run.
        source: its right values.
        moves: whether the source has an origin that may be moved.
        exact: whether the first sample is that of the initial state.
        scale: of positions, for their rounding.
    """
    ordered = dataclasses.replace(held, signs=(1,) * len(held.axes)).applied(source, 1.0)
    found = [_fit(each, ordered, moves, exact) for each in files]
    fits = [fit for fit in found if fit is not None]
    if len(fits) < len(files):
        return None
    values, dt = files[-1], dts[-1]
    size = float(np.max(np.abs(values)))
    room = _ROUNDINGS * epsilon(values) * max(size, scale if moves else 0.0)
    room += 2.0 * last_digit(values)
    power, factor = _factor(dts, [fit.factor for fit in fits], room / size, fits[-1].exact)
    held = dataclasses.replace(held, signs=fits[-1].signs, factor=factor, power=power)
    if moves and exact:
        off = np.mean(values[0] - held.applied(source[:1], dt)[0], axis=0)
        offset = tuple(shortest(float(each), room) for each in off)
        held = dataclasses.replace(held, offset=offset if any(offset) else ())
    left = _rms(values - held.applied(source, dt))
    return held if left <= _LEFT_OVER * _rms(values - np.mean(values, axis=(0, 1))) else None


class _Fit(NamedTuple):
    """The factor and the signs of columns; `exact` if they are read off the first sample."""

    factor: float
    signs: tuple[int, ...]
    exact: bool


def _fit(values: np.ndarray, source: np.ndarray, moves: bool, exact: bool) -> _Fit | None:
    """Of columns to a source in the same order; the first sample counts most if it is exact."""

    def products(rows: slice) -> tuple[np.ndarray, np.ndarray]:
        a, b = values[rows], source[rows]
        if moves:
            a, b = a - np.mean(a, axis=(0, 1)), b - np.mean(b, axis=(0, 1))
        return np.sum(a * b, axis=(0, 1)), np.sum(b * b, axis=(0, 1))

    (first, first_size), (every, size) = products(slice(0, 1)), products(slice(None))
    total = float(np.sum(size))
    if not (0.0 < total < np.inf) or not np.all(np.isfinite(every)):
        return None
    signs = np.where(size > _FLAT * total, np.sign(every), 0.0)
    if exact:
        signs = np.where(first_size > _FLAT * total, np.sign(first), signs)
    exact &= bool(np.sum(first_size) > _FLAT * total)
    near, near_size = (first, first_size) if exact else (every, size)
    factor = float(np.sum(np.abs(near)) / np.sum(near_size))
    if not 1.0 / _LARGEST_FACTOR < factor < _LARGEST_FACTOR:
        return None
    return _Fit(factor, tuple(int(sign) for sign in signs), exact)


def _factor(
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


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


class Mistake(NamedTuple):
    """One mistake, and how to mend it."""

    words: str
    fix: str


def mistakes_in(arrangement: Arrangement, run: Run) -> list[Mistake]:
    """The mistakes that make an arrangement of the columns of a run."""
    axes, names = run.layout.axes, run.problem.quantities
    positions, *others = arrangement.held
    if not others:
        return _alone(positions, axes, "" if run.layout.mechanical else "state")
    (velocities,) = others
    speeds = tuple(f"v{axis}" for axis in axes)
    leave_out = "write the velocities, or leave their columns out"
    if velocities.source is None:
        return [
            *_alone(positions, axes),
            Mistake("the velocities are zero", leave_out),
        ]
    if velocities.source == names[0] == positions.source:
        mistake = Mistake("the columns of the velocities hold positions", leave_out)
        return [*_alone(positions, axes), mistake]
    found = []
    if positions.source == names[1]:
        words = "the columns hold the velocities before the positions"
        found.append(Mistake(words, "write the positions before the velocities"))
        positions, velocities = velocities, positions
    if not _alike(positions, velocities):
        return [*found, *_alone(positions, axes), *_alone(velocities, speeds, "velocities")]
    found += [*_order_of_nodes(positions, ""), *_exchanged(positions, axes)]
    both = tuple(a or b for a, b in zip(positions.signs, velocities.signs, strict=True))
    found += _mirrored(both, axes)
    same = positions.power == velocities.power and positions.factor == velocities.factor
    if same and not velocities.weights:
        found += _scaled(positions, "all numbers")
    else:
        found += [*_scaled(positions, "positions"), *_scaled(velocities, "velocities")]
    return [*found, *_moved(positions, "positions")]


def _alone(held: Held, axes: Sequence[str], name: str = "") -> list[Mistake]:
    """The mistakes in one quantity; without its name if there is no other."""
    if name == "velocities" and all(sign <= 0 for sign in held.signs):
        sign = [Mistake("the velocities have the wrong sign", "write them with the other sign")]
    else:
        sign = _mirrored(held.signs, axes)
    return [
        *_order_of_nodes(held, name),
        *_exchanged(held, axes),
        *(sign if -1 in held.signs else []),
        *_scaled(held, _NUMBERS.get(name, name)),
        *_moved(held, _NUMBERS.get(name, name)),
    ]


def _alike(a: Held, b: Held) -> bool:
    """Whether positions and velocities have the same axes, signs and order of nodes."""
    signs = all(x == y or not x * y for x, y in zip(a.signs, b.signs, strict=True))
    return a.axes == b.axes and a.reverse == b.reverse and signs


def _order_of_nodes(held: Held, name: str) -> list[Mistake]:
    if not held.reverse:
        return []
    if name == "state":
        return [Mistake("the components are in reverse order", "write the first one first")]
    whose = f" of the {name}" if name else ""
    return [Mistake(f"the nodes{whose} are in reverse order", "number nodes from the other end")]


def _exchanged(held: Held, axes: Sequence[str]) -> list[Mistake]:
    moved = [(axes[k], axes[axis]) for k, axis in enumerate(held.axes) if k != axis]
    if not moved:
        return []
    words = [f"column {column} holds {axis}" for column, axis in moved]
    return [Mistake(listed(words), f"write {' before '.join(axes)}")]


def _mirrored(signs: Sequence[int], axes: Sequence[str]) -> list[Mistake]:
    fix = "let {} point in the direction of the spec"
    return [
        Mistake(f"{axis} points the other way", fix.format(axis))
        for axis, sign in zip(axes, signs, strict=True)
        if sign < 0
    ]


def _scaled(held: Held, what: str) -> list[Mistake]:
    if held.weights:
        words = f"{what} are multiplied by the masses"
        return [Mistake(words, "divide them by the masses"), *_scaled(_without(held), what)]
    if held.factor == 1.0 and held.power == 0:
        return []
    factor = "" if held.factor == 1.0 else f"{held.factor:.6g} "
    if held.power == 0:
        words, fix = f"{factor}times those of the problem", "write them in the problem's units"
    elif held.power == 1:
        words, fix = f"{factor}dt times those of the problem: per step", "divide them by dt"
    else:
        words, fix = f"{factor}1/dt times those of the problem", "multiply them by dt"
    return [Mistake(f"{what} are {words}", fix)]


def _without(held: Held) -> Held:
    return dataclasses.replace(held, weights=())


def _moved(held: Held, what: str) -> list[Mistake]:
    if not held.offset:
        return []
    words = f"{what} are shifted by ({', '.join(f'{each:.6g}' for each in held.offset)})"
    return [Mistake(words, "use the origin of the spec")]
