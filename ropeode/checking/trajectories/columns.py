"""What the columns of files may hold instead of what their headers say.

Each quantity is read off a file by a linear map: of these columns, with these signs, in this unit
and from this origin. All maps of a small table are fitted to the solution; a mistake is what a map
has that the usual one has not.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ropeode.checking.report import Diagnosis
from ropeode.checking.simple_numbers import shortest, shortest_factor
from ropeode.checking.trajectories.layout import samples_of
from ropeode.checking.trajectories.run_files import Run
from ropeode.validation import listed

# Readings with more mistakes than this are not tried.
_MOST_MISTAKES = 3
# Runs are looked at if at most this part of the variation of the numbers is left over.
_LEFT_OVER = 0.5
# Readings are tried whose first row is right to this part of the largest numbers.
_FIRST = 1e-3
# So many rows show which mistakes may be made.
_ROWS = 32
# Of more coordinates only those in order are tried.
_MOST_AXES = 3
# What varies less than this part of the rest has no unit and no sign that could be seen.
_FLAT = 1e-6
# No unit is larger; what blew up may be.
_LARGEST_FACTOR = 1e12
# By how much an extrapolated number may be off, in units of its estimated error.
_SAFETY = 5.0
# Units of rounding of a number that is read off the first sample.
_ROUNDINGS = 64.0
# By how much the logarithm of a written number may be off.
_ROUNDED = 1e-9
# Numbers may be multiplied by these powers of dt, with these words and remedies.
_POWERS = {
    0: ("{}times those of the problem", "write them in the problem's units"),
    1: ("{}dt times those of the problem: per step", "divide them by dt"),
    -1: ("{}1/dt times those of the problem", "multiply them by dt"),
}
_LEAVE_OUT = "write the velocities, or leave their columns out"


@dataclasses.dataclass(frozen=True)
class Explanation:
    """A mistake in writing files, without which they agree with the reference.

    Arguments:
        cause: `columns` or `times`.
        words: the mistake, in a sentence without its end.
        fix: how to mend it.
        agreement: what the files show if they are read so.
        runs: as they should have been written.
        like_another_problem: whether another problem with the same initial state moves so, too.
    """

    cause: str
    words: str
    fix: str
    agreement: str
    runs: tuple[Run, ...]
    like_another_problem: bool = False

    @property
    def line(self) -> str:
        """The mistake and its evidence."""
        return f"{self.words}; read so, {self.agreement}"

    @property
    def diagnosis(self) -> Diagnosis:
        """That a program solves the problem, and writes it wrongly."""
        return Diagnosis(self.cause, self.line, {"read_so": self.agreement}, self.fix)


class Mistake(NamedTuple):
    """One mistake in writing numbers, and how to mend it."""

    words: str
    fix: str


class Map(NamedTuple):
    """How the numbers of one quantity are read off those of a file.

    Fields:
        columns: of the file, one for each axis.
        back: whether the nodes are in reverse order.
        masses: by which the numbers of each node are multiplied, ``(nodes, 1)``, or 1.
        signs: of each axis.
        power: the unit is a number times this power of dt.
        number: likewise.
        offset: what has to be subtracted then, ``(axes,)``.
    """

    columns: tuple[int, ...]
    back: bool = False
    masses: Any = 1.0
    signs: tuple[float, ...] = ()
    power: int = 0
    number: float = 1.0
    offset: tuple[float, ...] = ()

    def unit(self, dt: float) -> float:
        """By which numbers in a file with this step size are multiplied."""
        return self.number * dt**self.power

    def read(self, values: np.ndarray, dt: float) -> np.ndarray:
        """The quantity, ``(rows, nodes, axes)``, in the numbers of a file."""
        part = values[:, :: -1 if self.back else 1, list(self.columns)]
        signs, offset = np.array(self.signs or 1.0), np.array(self.offset or 0.0)
        return part * signs / (self.unit(dt) * self.masses) - offset


class Reading(NamedTuple):
    """Numbers of files, read otherwise than their headers say.

    Fields:
        mistakes: that have been made then.
        maps: one for each quantity that can be read.
    """

    mistakes: tuple[Mistake, ...]
    maps: tuple[Map, ...]

    def read(self, values: np.ndarray, dt: float) -> np.ndarray:
        """The right numbers, ``(rows, nodes, columns)``."""
        return np.concatenate([each.read(values, dt) for each in self.maps], axis=2) + 0.0

    def undone(self, run: Run, after: int) -> Run:
        """A run as it should have been written; the rows before are right."""
        values = self.read(run.values, run.dt)
        # No more digits than are in the file.
        off = np.concatenate(
            [
                run.rounding[list(each.columns)] / (each.unit(run.dt) * np.min(each.masses))
                for each in self.maps
            ]
        )
        for column in np.flatnonzero(off):
            decimals = math.floor(-math.log10(2.0 * off[column]) + _ROUNDED)
            values[:, :, column] = np.round(values[:, :, column], decimals)
        before = run.values[:after, :, : values.shape[2]]
        return dataclasses.replace(run, values=np.concatenate([before, values[after:]]))


class Samples(NamedTuple):
    """Rows of files beside the right ones.

    Fields:
        run: one of the runs, for their layout.
        dts: step sizes, from coarse to fine.
        files: the numbers of each run, ``(rows, nodes, columns)``.
        truth: the right ones.
        begins: whether the first row is that of the initial state.
    """

    run: Run
    dts: Sequence[float]
    files: Sequence[np.ndarray]
    truth: np.ndarray
    begins: bool

    @property
    def precision(self) -> float:
        """How precisely a number is read off a row, as a part of the largest ones."""
        run = self.run
        sizes = np.array([np.max(np.abs(part)) for part in run.parts_of(run.values)])
        rounding = run.rounding[:: run.layout.dim]
        digits = np.divide(rounding, sizes, where=sizes > 0.0, out=0.0 * sizes)
        return _ROUNDINGS * run.epsilon + 2.0 * float(np.max(digits))

    def truth_of(self, quantity: int) -> np.ndarray:
        """The right numbers of one quantity."""
        return self.run.parts_of(self.truth)[quantity]


def simplest(
    states: np.ndarray,
    runs: Sequence[Run],
    evidence: Callable[[tuple[Run, ...]], str | None],
    after: int = 0,
    *,
    shifts: bool = False,
) -> Explanation | None:
    """The fewest mistakes for which there is evidence if they are undone.

    Arguments:
        states: the right ones of the first rows.
        runs: from coarse to fine.
        evidence: what runs show, as part of a sentence; None if they show nothing.
        after: the number of rows before, which are right.
        shifts: whether the origin of positions may be another one.
    """
    rows = np.unique(np.linspace(after, len(states) - 1, _ROWS).astype(int))
    truth = samples_of(runs[0].problem, states[rows])
    files = [run.values[rows] for run in runs]
    samples = Samples(runs[-1], [run.dt for run in runs], files, truth, not after)

    def undone(reading: Reading) -> tuple[Run, ...]:
        return tuple(reading.undone(run, after) for run in runs)

    with np.errstate(all="ignore"):  # Runs that blew up have huge numbers.
        near = [
            each
            for each in _readings(samples, shifts=shifts)
            if _is_near(samples, each.read(files[-1], runs[-1].dt))
        ]
        for _, equal in itertools.groupby(near, key=lambda reading: len(reading.mistakes)):
            found = [
                (each, shown) for each in equal if (shown := evidence(undone(each))) is not None
            ]
            if found:
                every = (" and ".join(one.words for one in each.mistakes) for each, _ in found)
                words = "; or, which is the same here, ".join(dict.fromkeys(every))
                reading, shown = found[0]
                fix = "; ".join(one.fix for one in reading.mistakes)
                text = f"after the first row, {words}" if after else words
                return Explanation("columns", text, fix, shown, undone(reading))
    return None


def _is_near(samples: Samples, values: np.ndarray) -> bool:
    """Whether little of the variation of the numbers is left over, and nothing in a first row."""
    truth = samples.truth[:, :, : values.shape[2]]
    way, off = values - np.mean(values, axis=(0, 1)), np.abs(values - truth)
    if samples.begins and np.max(off[0]) > _FIRST * np.max(np.abs(truth)):
        return False
    return bool(np.sum(off**2) <= _LEFT_OVER**2 * np.sum(way**2))


def _readings(samples: Samples, *, shifts: bool) -> list[Reading]:
    """All readings of files but the usual one, those with the fewest mistakes first.

    Arguments:
        samples: of the files.
        shifts: whether the origin of positions may be another one.
    """
    fine, dt = samples.files[-1], samples.dts[-1]
    found: dict[bytes, Reading | None] = {fine.tobytes(): None}
    lost = _lost(samples)
    every = [
        Reading((*lost, *_mistakes(samples, maps)), maps)
        for arranged in _arranged(samples, 1 if lost else fine.shape[2] // samples.run.layout.dim)
        if len(lost) + len([*_mistakes(samples, arranged)]) <= _MOST_MISTAKES
        for scaled in _scaled(samples, arranged)
        for maps in (_shifted(samples, scaled) if shifts else [scaled])
    ]
    for each in sorted(every, key=lambda reading: len(reading.mistakes)):
        if len(each.mistakes) <= _MOST_MISTAKES:
            found.setdefault(each.read(fine, dt).tobytes(), each)
    return [each for each in found.values() if each is not None]


def _lost(samples: Samples) -> list[Mistake]:
    """Why the velocities cannot be read at all, if that is so."""
    dim, fine = samples.run.layout.dim, samples.files[-1]
    if fine.shape[2] > dim:
        zero = all(not np.any(each[:, :, dim:]) for each in samples.files)
        if zero and np.any(samples.truth[:, :, dim:]):
            return [Mistake("the velocities are zero", _LEAVE_OUT)]
        if not zero and np.array_equal(fine[:, :, dim:], fine[:, :, :dim]):
            return [Mistake("the columns of the velocities hold positions", _LEAVE_OUT)]
    return []


def _arranged(samples: Samples, quantities: int) -> Iterator[tuple[Map, ...]]:
    """Columns and nodes in any order, momenta for velocities, and axes that point the other way."""
    dim, nodes = samples.run.layout.dim, samples.run.layout.nodes
    usual = [tuple(range(k * dim, (k + 1) * dim)) for k in range(quantities)]
    mass = np.ravel(getattr(samples.run.problem.args, "mass", ()))
    momenta = quantities > 1 and len(mass) == nodes and np.ptp(mass) > 0.0
    orders = itertools.permutations if dim <= _MOST_AXES else lambda columns: [columns]
    for blocks in (usual, usual[::-1])[:quantities]:
        for columns, backs, masses in itertools.product(
            itertools.product(*map(orders, blocks)),
            itertools.product((False, True)[:nodes], repeat=quantities),
            (1.0, mass[:, None]) if momenta else (1.0,),
        ):
            by_mass = [1.0, masses][-quantities:]
            maps = [Map(*each) for each in zip(columns, backs, by_mass, strict=True)]
            yield tuple(
                each._replace(signs=_signs(samples, k, each)) for k, each in enumerate(maps)
            )


def _signs(samples: Samples, quantity: int, read: Map) -> tuple[float, ...]:
    """Of each axis; where positions have no motion that shows it, that which their places show."""
    a, b = read.read(samples.files[-1], samples.dts[-1]), samples.truth_of(quantity)
    moves, places = (
        np.sum(x * y, (0, 1)) for x, y in ((_about(a, quantity), _about(b, quantity)), (a, b))
    )
    return tuple(np.where(moves + _FLAT * places < 0.0, -1.0, 1.0).tolist())


def _about(values: np.ndarray, quantity: int) -> np.ndarray:
    """Positions about their mean, whose origin is not known yet; velocities as they are."""
    return values - np.mean(values, axis=(0, 1)) if quantity == 0 else values


def _scaled(samples: Samples, maps: tuple[Map, ...]) -> Iterator[tuple[Map, ...]]:
    """In another unit, or with a factor of dt: of all quantities, of some, or of each its own."""
    usual = (0, 1.0)
    fits = [_unit(samples, k, each) for k, each in enumerate(maps)]
    units = [[one] for one in dict.fromkeys((usual, fits[0]))]
    for fit in fits[1:]:
        units = [[*one, other] for one in units for other in dict.fromkeys((usual, fit, *one))]
    for each in units:
        pairs = zip(maps, each, strict=True)
        yield tuple(one._replace(power=power, number=number) for one, (power, number) in pairs)


def _unit(samples: Samples, quantity: int, read: Map) -> tuple[int, float]:
    """The power of dt and the number whose product is the factor of the numbers in each file."""
    truth, dts = samples.truth_of(quantity), np.array(samples.dts[-2:])
    first, every = (_about(each, quantity) for each in (truth[:1], truth))
    # The first row has no errors yet.
    right = first if samples.begins and np.sum(first**2) > _FLAT * np.sum(every**2) else every
    pairs = [*zip(samples.files, samples.dts, strict=True)][-2:]
    parts = [_about(read.read(each[: len(right)], dt), quantity) for each, dt in pairs]
    factors = np.array([np.sum(part * right) for part in parts]) / np.sum(right**2)
    if not np.all((factors > 1.0 / _LARGEST_FACTOR) & (factors < _LARGEST_FACTOR)):
        return 0, 1.0
    numbers = {power: factors / dts**power for power in _POWERS}
    power = min(_POWERS, key=lambda each: np.ptp(numbers[each]) / numbers[each][-1])
    number = float(numbers[power][-1])
    # Positions are rounded like the largest of them, wherever the origin is.
    size = float(np.max(np.abs(read.read(samples.files[-1], 1.0))))
    rounding = samples.precision * max(
        1.0, samples.run.problem.scale / size if quantity == 0 else 0.0
    )
    spread = rounding * number + _SAFETY * float(np.ptp(numbers[power]))
    return power, shortest_factor(number, spread) or 1.0


def _shifted(samples: Samples, maps: tuple[Map, ...]) -> Iterator[tuple[Map, ...]]:
    """From the usual origin of positions, and from another one, which the first row shows."""
    yield maps
    first, *rest = maps
    values = first.read(samples.files[-1], samples.dts[-1])
    size = max(float(np.max(np.abs(values))), samples.run.problem.scale)
    off = np.mean(values[0] - samples.truth_of(0)[0], axis=0)
    offset = tuple(shortest(float(each), samples.precision * size) for each in off)
    if any(offset):
        yield (first._replace(offset=offset), *rest)


class _Part(NamedTuple):
    """What a mistake is said of: all numbers, or one quantity of two."""

    name: str
    columns: tuple[str, ...]
    of: str = ""
    alone: str = ""


def _mistakes(samples: Samples, maps: Sequence[Map]) -> Iterator[Mistake]:
    """What maps have that the usual ones have not."""
    layout, dim = samples.run.layout, samples.run.layout.dim
    speeds = tuple(f"v{axis}" for axis in layout.axes)
    two, name = len(maps) > 1, "positions" if layout.mechanical else "numbers"
    both = _Part("all numbers" if two else name, layout.axes)
    parts = (
        _Part("positions", layout.axes, " of the positions", "in the positions, "),
        _Part("velocities", speeds, " of the velocities"),
    )

    def said(what: Callable[[Map], Any], usual: Any) -> Iterator[tuple[_Part, Any]]:
        """Of which part something is unusual."""
        found = [what(each) for each in maps]
        if all(each == found[0] != usual for each in found):
            yield both, found[0]
        else:
            yield from ((p, each) for p, each in zip(parts, found, strict=False) if each != usual)

    if maps[0].columns[0] >= dim:
        yield Mistake(
            "the columns hold the velocities before the positions",
            "write the positions before the velocities",
        )
    nodes, fix = (
        ("nodes", "number nodes from the other end")
        if layout.mechanical
        else ("components", "write the first one first")
    )
    for part, _ in said(lambda each: each.back, False):
        yield Mistake(f"the {nodes}{part.of} are in reverse order", fix)
    for part, order in said(lambda each: [k % dim for k in each.columns], [*range(dim)]):
        holds = sorted((k, axis) for axis, k in enumerate(order) if k != axis)
        words = listed(f"column {part.columns[k]} holds {part.columns[axis]}" for k, axis in holds)
        yield Mistake(words, f"write {' before '.join(part.columns)}")
    signs = [each.signs for each in maps]
    if signs == [(1.0,) * dim, (-1.0,) * dim]:
        yield Mistake("the velocities have the wrong sign", "write them with the other sign")
    else:
        for axis in range(dim):
            for part, _ in said(lambda each, axis=axis: each.signs[axis], 1.0):
                column = part.columns[axis]
                fix = f"let {column} point in the direction of the spec"
                yield Mistake(f"{part.alone}{column} points the other way", fix)
    for part, (power, number) in said(lambda each: (each.power, each.number), (0, 1.0)):
        words, fix = _POWERS[power]
        times = words.format("" if number == 1.0 else f"{number:.6g} ")
        yield Mistake(f"{part.name} are {times}", fix)
    if np.ndim(maps[-1].masses):
        yield Mistake("velocities are multiplied by the masses", "divide them by the masses")
    if offset := maps[0].offset:
        in_file = np.zeros(dim)
        unit = maps[0].unit(samples.dts[-1])
        in_file[[k % dim for k in maps[0].columns]] = np.multiply(maps[0].signs, offset) * unit
        numbers = ", ".join(f"{each + 0.0:.6g}" for each in in_file)
        yield Mistake(f"positions are shifted by ({numbers})", "use the origin of the spec")
