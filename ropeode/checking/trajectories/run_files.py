"""Runs of one program with several step sizes, one file each."""

from __future__ import annotations

import dataclasses
import functools
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ropeode.checking.trajectories.array_files import read_arrays
from ropeode.checking.trajectories.csv_files import read_csv
from ropeode.checking.trajectories.layout import Layout, Written, samples_of, states_of
from ropeode.checking.written_precision import epsilon, last_digit
from ropeode.errors import InputError
from ropeode.problems import Problem
from ropeode.progress import Progress, silent
from ropeode.simulation import step_size
from ropeode.validation import MOST_COUNTED, bad_value, complaint, listed, positive_number

T = TypeVar("T")
FORMATS = {".csv": read_csv, ".npz": read_arrays, ".nc": read_arrays}
FEWEST = 3
_NAMES_SHOWN = 3
# Units of rounding by which a first sample may be off: programs often compute positions.
_ROUNDINGS = 4.0
# Two step sizes, numbers of steps or intervals are equal if they differ by less, as a part.
_SAME = 1e-3
# Relative rounding error of times in float64, added up step by step.
_ADDED_UP = 1e-9
# As a part of an interval: rounding moves no time so far; nor does it hide a missing sample.
_CLOSE, _HALF = 0.25, 0.5
# In names of files. Those with a point or an exponent are step sizes rather than numbers of steps.
_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
# In complaints, which are the same fault if they differ by these alone.
_ANY_NUMBER = re.compile(r"[-+]?\d[\d.]*(e[-+]?\d+)?", re.IGNORECASE)


class Diverged(NamedTuple):
    """The first number of a file that is not finite.

    Fields:
        time: of its sample.
        where: the file and the place in it.
        given: the number.
    """

    time: float
    where: str
    given: float


@dataclasses.dataclass(frozen=True)
class Run:
    """The samples of one file at the sample times of the problem.

    Arguments:
        problem: that the program should solve.
        path: of the file.
        dt: step size.
        values: ``(times, nodes, columns)``: positions and, if the file has them, velocities.
        interval: between the samples in the file.
        named: whether the step size is that of the file's name.
        diverged: the first number that is not finite, from which on all values are not-a-number.
    """

    problem: Problem
    path: Path
    dt: float
    values: np.ndarray
    interval: float
    named: bool = False
    diverged: Diverged | None = None

    @functools.cached_property
    def layout(self) -> Layout:
        """The layout of the problem's samples."""
        return Layout.of(self.problem)

    @functools.cached_property
    def states(self) -> np.ndarray:
        """The states, ``(times, *state)``; velocities that the file lacks are zero."""
        return states_of(self.problem, self.values)

    @property
    def quantities(self) -> tuple[str, ...]:
        """The quantities of the problem that the file has: velocities may be missing."""
        return self.problem.quantities[: self.values.shape[2] // self.layout.dim]

    def parts_of(self, values: np.ndarray) -> list[np.ndarray]:
        """Those of each quantity, of values like these."""
        dim = self.layout.dim
        return np.split(values, range(dim, values.shape[2], dim), axis=2)

    @functools.cached_property
    def rounding(self) -> np.ndarray:
        """The largest rounding error of the written numbers of each column, ``(columns,)``."""
        return np.repeat([last_digit(part) for part in self.parts_of(self.values)], self.layout.dim)

    @functools.cached_property
    def epsilon(self) -> float:
        """The relative rounding of the precision in which the numbers were computed.

        One quantity tells: to positions in float32, an origin in float64 may be added.
        """
        return max(map(epsilon, self.parts_of(self.values)))

    @functools.cached_property
    def initial(self) -> np.ndarray:
        """The initial state as the first sample of a file, ``(nodes, columns)``."""
        return samples_of(self.problem, self.problem.y0[None])[0][:, : self.values.shape[2]]

    @functools.cached_property
    def first_errors(self) -> np.ndarray:
        """The error of each number of the first sample, ``(nodes, columns)``."""
        return np.abs(self.values[0] - self.initial)

    @functools.cached_property
    def allowed_first_errors(self) -> np.ndarray:
        """How far the numbers of each column of the first sample may be off, ``(columns,)``."""
        size = np.max(np.abs(self.values[0]), initial=self.problem.scale)
        rounding = _ROUNDINGS * self.epsilon * size
        # Velocities may be differences of positions.
        columns = np.full(self.values.shape[2], rounding)
        columns[self.layout.dim :] = rounding / self.dt
        return columns + 2.0 * self.rounding

    def begins(self, columns: slice = slice(None)) -> bool:
        """Whether these columns begin with the initial state."""
        return bool(np.all(self.first_errors[:, columns] <= self.allowed_first_errors[columns]))

    @property
    def single(self) -> bool:
        """Whether the numbers were computed in single precision."""
        return self.epsilon > float(np.finfo(np.float64).eps)

    @property
    def reached(self) -> int:
        """The number of samples before the run diverged."""
        return int(np.sum(np.all(np.isfinite(self.values), axis=(1, 2))))

    @property
    def label(self) -> str:
        """The file's name and the step size."""
        return f"{self.path.name}, dt = {self.dt:g}"


class Files(NamedTuple):
    """Files of one program, as `read_runs` has them.

    Fields:
        paths: one for each step size.
        problem: the problem that they should solve.
        dts: step size of each; None if the files contain them, or their names the steps per frame.
        fewest: the smallest number of files.
    """

    paths: Sequence[str | Path]
    problem: Problem
    dts: Any = None
    fewest: int = FEWEST


def finite(runs: Sequence[Run]) -> tuple[Run, ...]:
    """The runs that did not diverge."""
    return tuple(run for run in runs if run.diverged is None)


def names_of(runs: Sequence[Run]) -> str:
    """The names of their files, in a few words."""
    names = [run.path.name for run in runs]
    return ", ".join(names) if len(names) <= _NAMES_SHOWN else f"{names[0]} ... {names[-1]}"


def read_runs(
    files: Sequence[str | Path],
    problem: Problem,
    dts: Sequence[Any] | None = None,
    progress: Progress = silent,
    *,
    fewest: int = FEWEST,
) -> tuple[Run, ...]:
    """Read files, keeping the samples at the problem's sample times.

    Arguments:
        files: one for each step size.
        problem: the problem that they should solve.
        dts: step size of each; None if the files contain them, or their names the steps per frame.
        progress: called with the current task and the fraction that is done.
        fewest: the smallest number of files; fewer than three show no order.

    Returns:
        The runs, from coarse to fine.

    Raises:
        InputError: the first fault of each file that cannot be used; one that several files
            have is one line.
    """
    every, steps, named = read_files(Files(files, problem, dts, fewest), progress)

    def run(index: int) -> Run:
        return dataclasses.replace(run_of(every[index], steps[index], problem), named=named)

    runs = for_each_file([each.path for each in every], run)
    least = min(len(run.quantities) for run in runs)
    without = [str(run.path) for run in runs if len(run.quantities) == least]
    if len(without) < len(runs):
        allowed = "velocities in all files, or in none"
        fix = "write them to all files"
        raise bad_value("velocities", f"none in {without}", allowed, fix)
    return tuple(sorted(runs, key=lambda run: -run.dt))


def read_files(
    files: Files, progress: Progress = silent
) -> tuple[list[Written], list[float], bool]:
    """Read files one after the other, and tell the step size of each.

    Returns:
        What is in them, their step sizes, and whether these are those of the names.

    Raises:
        InputError: one line for each fault, or there are too few files.
    """
    given, problem, dts, fewest = files
    if isinstance(given, (str, Path)):
        raise bad_value("files", str(given), "a list of files", "put it into a list")
    paths, layout = [Path(file) for file in given], Layout.of(problem)
    # One that does not exist may be a folder of many, with a mistake in its name.
    if len(paths) < fewest and all(path.exists() for path in paths):
        allowed = f"at least {fewest}, with different step sizes" + (
            ", because fewer show no order" if fewest > 1 else ""
        )
        raise bad_value("files", len(paths), allowed, "run with more step sizes")
    if dts is not None and len(dts) != len(paths):
        allowed = f"one for each of the {len(paths)} files, in the same order"
        raise bad_value("dt", len(dts), allowed, "give one for each file")

    def read(index: int) -> Written:
        path, suffix = paths[index], paths[index].suffix.lower()
        if suffix not in FORMATS and path.exists():
            allowed = f"a file whose name ends in {', '.join(FORMATS)}"
            raise bad_value("file", str(path), allowed, "rename it according to its format")
        progress(f"reading {path.name}", index / len(paths))
        # What does not exist is of no format, and each of them says why it cannot be read.
        return FORMATS.get(suffix, read_csv)(path, layout)

    every, named = for_each_file(paths, read), None
    if problem.equal_frames and all(each.dt is None for each in every):
        named = _step_sizes_in_names(paths, dts, step_size(problem, 1))
    return every, _step_sizes(every, problem, named or dts), named is not None


def _step_sizes_in_names(
    paths: Sequence[Path], dts: Sequence[Any] | None, frame: float
) -> list[float] | None:
    """The step size of each file, if its name decides that.

    Arguments:
        paths: of the files.
        dts: from the caller, maybe in the order in which a shell lists the files.
        frame: its length.
    """
    steps = _steps_in(paths)
    if steps is None or dts is None:
        return None if steps is None else [frame / n for n in steps]
    try:
        given = [positive_number(dt) for dt in dts]
    except ValueError:
        return None
    # In the order that the names ask for; but the names may be the step sizes in another unit.
    named = np.sort(given)[np.argsort(np.argsort(-np.array(steps)))]
    is_so = _are_equal(named * steps) and not _are_equal(np.divide(given, steps))
    return named.tolist() if is_so and named.tolist() != given else None


def _step_sizes(
    files: Sequence[Written], problem: Problem, dts: Sequence[Any] | None
) -> list[float]:
    """The step size of each file, from the file, or from the caller or the names.

    Raises:
        InputError: one is missing, not a positive number, repeated, or contradictory.
    """

    def one(index: int) -> float:
        file = files[index]
        given = (file.dt, None if dts is None else dts[index])
        values = [_step_size(file, each, problem) for each in given if each is not None]
        if not values:
            allowed = (
                "the step size, in the file or as --dt with one for each file; or, with frames of "
                "equal length, names that differ in a single number, the steps per frame (not 1, "
                "2, 3, which may number the files)"
            )
            in_csv = file.path.suffix.lower() == ".csv"
            fix = "write '# dt = 0.01' above the header" if in_csv else "store a number dt as well"
            raise bad_value(f"{file.path}, dt", "none", allowed, fix)
        if abs(values[-1] - values[0]) > _SAME * values[0]:
            allowed, fix = f"{values[0]:g}, the dt in the file", "leave out one of them"
            raise bad_value(f"{file.path}, dt", values[-1], allowed, fix)
        return values[0]

    paths = [file.path for file in files]
    steps = for_each_file(paths, one)

    def differs(index: int) -> None:
        dt = steps[index]
        for path, other in zip(paths[:index], steps, strict=False):
            if abs(dt - other) <= _SAME * dt:
                allowed = f"a different step size for each file; {path} has this one too"
                raise bad_value(f"{paths[index]}, dt", dt, allowed, "leave out one of the files")

    for_each_file(paths, differs)
    return steps


def _step_size(file: Written, given: Any, problem: Problem) -> float:
    try:
        dt = positive_number(given)
        steps = float(problem.ts[-1] - problem.ts[0]) / dt
        # Times may have another unit.
        if not 1 / MOST_COUNTED <= steps <= MOST_COUNTED:
            raise ValueError(f"the problem would take {steps:.3g} such steps")
        return dt
    except ValueError as error:
        allowed = f"a finite number > 0 ({error})"
        raise bad_value(f"{file.path}, dt", given, allowed, "for example dt = 0.01") from None


def run_of(written: Written, dt: float, problem: Problem) -> Run:
    """The run whose samples are those of a file at the sample times of a problem.

    Samples must be equally spaced, except where the problem's times are not; an interval that
    ends at a sample time may be shorter. At the first number that is not finite the run
    diverged, and nothing that follows counts.

    Raises:
        InputError: a time is wrong or missing, the first sample is not finite, or they are farther
            apart than dt allows.
    """
    wanted = problem.ts
    written, diverged = _finite_part(written)
    times, where = written.times, written.where
    if not len(times):
        allowed = "a sample at each sample time"
        raise bad_value(where(0), "no samples", allowed, "write them")
    _check_order(written)
    room = _room(times, wanted)
    if abs(times[0] - wanted[0]) > room[0]:
        raise bad_value(
            where(0),
            float(times[0]),
            f"the start of the problem, t = {wanted[0]:g}, as the first time",
            "write the initial state before the first step",
        )
    found = np.searchsorted(times, wanted - room)
    found = found[found < len(times)]
    wrong = np.abs(times[found] - wanted[: len(found)]) > room[: len(found)]
    kept = found[: int(np.argmax([*wrong, True]))]
    missing = int(found[len(kept)]) if wrong.any() else None
    _check_spacing(written, kept, missing, wanted)
    if missing is not None:
        raise bad_value(
            where(missing),
            f"t = {times[missing]:.9g} after t = {times[missing - 1]:.9g}",
            f"a sample at t = {wanted[len(kept)]:g}, which is missing",
            "check the number of steps before each sample; if dt does not divide the time, the "
            "last one is shorter",
        )
    if diverged is None and len(kept) < len(wanted):
        raise bad_value(
            where(len(times) - 1),
            f"t = {times[-1]:.9g} as the last time",
            f"samples up to t = {wanted[-1]:g}; the one at t = {wanted[len(kept)]:g} is missing",
            "make the remaining steps; if dt does not divide the time, the last one is shorter",
        )
    values = np.full((len(wanted), *written.values.shape[1:]), np.nan)
    values[: len(kept)] = written.values[kept]
    interval = float(times[1] - times[0] if len(times) > 1 else wanted[-1] - wanted[0])
    if dt > interval * (1.0 + _SAME):
        allowed = f"at most {interval:g}, the time between two samples of the file"
        fix = "check whether this dt belongs to another file"
        raise bad_value(f"{written.path}, dt", dt, allowed, fix)
    return Run(problem, written.path, dt, values, interval, diverged=diverged)


def _finite_part(written: Written) -> tuple[Written, Diverged | None]:
    """The samples up to the first that is not finite, and that one."""
    _, _, times, values, where = written
    finite = np.isfinite(values)
    whole = finite.all(axis=(1, 2)) & np.isfinite(times)
    if whole.all():
        return written, None
    sample = int(np.argmin(whole))
    if not np.isfinite(times[sample]):
        given, node, column = times[sample], None, None
    else:
        node, column = (int(i[0]) for i in np.nonzero(~finite[sample]))
        given = values[sample, node, column]
    place = where(sample, node, column)
    if sample == 0 or not np.isfinite(times[sample]):
        fix = "start from the initial state, and write finite times in runs that diverged too"
        raise bad_value(place, float(given), "a finite number", fix)
    diverged = Diverged(float(times[sample]), place, float(given))
    return written._replace(times=times[:sample], values=values[:sample]), diverged


def _check_order(written: Written) -> None:
    back = np.diff(written.times) <= 0.0
    if back.any():
        sample = int(np.argmax(back)) + 1
        raise bad_value(
            written.where(sample),
            f"t = {written.times[sample]:.9g} after t = {written.times[sample - 1]:.9g}",
            "times in increasing order, each once",
            "sort the samples, write each once, and write t with all digits",
        )


def _room(times: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """How far each wanted time may be from that in a file: by adding up steps, and by its digits.

    Another sample, or another wanted time, is farther away.
    """
    scale = np.maximum(np.abs(wanted), np.min(np.diff(wanted)))
    rounding = (_ADDED_UP + epsilon(times)) * scale + last_digit(times)
    return np.minimum(
        rounding,
        _CLOSE * min(np.min(np.diff(each), initial=np.inf) for each in (times[:2], wanted)),
    )


def _check_spacing(
    written: Written, kept: np.ndarray, missing: int | None, wanted: np.ndarray
) -> None:
    """Check that the samples before one that is missing are equally spaced."""
    ends, gaps = written.times[1:missing], np.diff(written.times[:missing])
    if not len(gaps):
        return
    hit = np.isin(np.arange(1, len(gaps) + 1), kept)
    # The usual interval is the first one; where frames differ in length, the first of each frame.
    usual = np.full(len(gaps), gaps[0])
    if np.ptp(np.diff(wanted)) > _SAME * (wanted[1] - wanted[0]):
        begins = np.append(True, hit[:-1])
        usual = gaps[begins][np.cumsum(begins) - 1]
    room = _SAME * usual + _ADDED_UP * np.abs(ends)
    # A missing sample is detected however the times are rounded.
    rounding = epsilon(ends) * np.abs(ends) + 2.0 * last_digit(ends)
    room += np.minimum(rounding, _HALF * usual)
    wrong = (gaps > usual + room) | ((gaps < usual - room) & ~hit)
    if wrong.any():
        i = int(np.argmax(wrong))
        raise bad_value(
            written.where(i + 1),
            f"a time {gaps[i]:.6g} after the previous one",
            f"equal intervals, here {usual[i]:.6g}; only one that ends at a sample time may "
            "be shorter",
            "use one step size, and write every step or every k-th",
        )


def _steps_in(paths: Sequence[Path]) -> list[int] | None:
    """The steps per frame in the names of files that differ in nothing else.

    Returns:
        None if the names may mean something else: numbers in a row may number the files.
    """
    names = [path.stem for path in paths]
    if len({_NUMBER.sub("#", name) for name in names}) > 1:
        return None
    columns = zip(*(_NUMBER.findall(name) for name in names), strict=True)
    differing = [column for column in columns if len({*column}) > 1]
    if len(differing) != 1 or not all(text.isdecimal() and int(text) for text in differing[0]):
        return None
    steps = [int(text) for text in differing[0]]
    return None if max(steps) - min(steps) == len(steps) - 1 else steps


def _are_equal(values: np.ndarray) -> bool:
    return bool(np.all(np.abs(values - values[0]) <= _SAME * abs(values[0])))


def for_each_file(paths: Sequence[Path], work: Callable[[int], T]) -> list[T]:
    """What some work makes of each file.

    Arguments:
        paths: of the files.
        work: what is done, by the index of the file.

    Raises:
        InputError: the first fault of each file; one that several files have is one line.
    """
    faults, made = [], []
    for index, path in enumerate(paths):
        try:
            made.append(work(index))
        except InputError as error:
            faults += [(path, line) for line in error.problems]
        except OSError as error:
            allowed = f"a file that can be read ({error.strerror or error})"
            faults.append((path, complaint("file", str(path), allowed, "check the disk")))
    if faults:
        raise InputError([*_each_once(faults)])
    return made


def _each_once(faults: Sequence[tuple[Path, str]]) -> Iterator[str]:
    """Complaints about files; those that differ by numbers alone are one, which names all files.

    Arguments:
        faults: the path of a file and the complaint, in the order of the files.
    """
    alike: dict[str, tuple[str, list[Path]]] = {}
    for path, line in faults:
        same = _ANY_NUMBER.sub("#", line.replace(str(path), ""))
        alike.setdefault(same, (line, []))[1].append(path)
    for line, paths in alike.values():
        others = [*dict.fromkeys(path.name for path in paths if path != paths[0])]
        yield f"{line} So in {listed(others)}." if others else line
