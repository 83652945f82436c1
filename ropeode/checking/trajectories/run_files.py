"""Runs of one program with several step sizes, one file for each."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.checking.trajectories.csv_files import CsvFile
from ropeode.checking.trajectories.layout import Layout
from ropeode.checking.trajectories.netcdf_files import NetcdfFile
from ropeode.checking.trajectories.npz_files import NpzFile
from ropeode.checking.trajectories.sampling import Sampling
from ropeode.errors import InputError
from ropeode.problems.problem import Problem
from ropeode.validation import complaint, finite_number

File = CsvFile | NpzFile | NetcdfFile
FORMATS: dict[str, type[File]] = {".csv": CsvFile, ".npz": NpzFile, ".nc": NetcdfFile}
FEWEST = 3
_NAMES_SHOWN = 3
# Two statements of a step size, or of a number of steps, are the same if they are so close.
_SAME = 1e-3

Progress = Callable[[str, float], None]


@dataclasses.dataclass(frozen=True)
class Run:
    """What one file says at the sample times of the problem.

    Arguments:
        path: of the file.
        dt: step size.
        values: ``(times, nodes, columns)``: positions and, if there are any, velocities.
        interval: between the samples that the file has.
    """

    path: Path
    dt: float
    values: np.ndarray
    interval: float

    @property
    def label(self) -> str:
        """The file's name and the step size."""
        return f"{self.path.name}, dt = {self.dt:g}"

    @property
    def uneven(self) -> bool:
        """Whether steps of this size do not come out at the file's samples."""
        steps = self.interval / self.dt
        return abs(steps - np.rint(steps)) > _SAME * steps


def quantities_of(problem: Problem, runs: Sequence[Run]) -> tuple[str, ...]:
    """Which quantities of a problem its runs have: velocities may be missing."""
    return problem.quantities[: runs[0].values.shape[2] // Layout.of(problem).dim]


def names_of(runs: Sequence[Run]) -> str:
    """The names of their files, in a few words."""
    names = [run.path.name for run in runs]
    return ", ".join(names) if len(names) <= _NAMES_SHOWN else f"{names[0]} ... {names[-1]}"


def read_runs(
    files: Sequence[str | Path],
    problem: Problem,
    dts: Sequence[Any] | None = None,
    progress: Progress = lambda text, fraction: None,
    *,
    fewest: int = FEWEST,
) -> tuple[Run, ...]:
    """Read the files, each in blocks; only what is asked for is kept.

    Arguments:
        files: one for each step size.
        problem: that all of them are to solve.
        dts: step size of each; None where the files say them.
        progress: called with what is being done and the fraction that is done.
        fewest: how many files there have to be; fewer than three show no order.

    Returns:
        The runs, from coarse to fine.

    Raises:
        InputError: one line for each file that cannot be used: its first fault.
    """
    opened = open_files(files, Layout.of(problem), fewest)
    steps = _step_sizes(opened, dts)
    total, before, faults, found = sum(file.size for file in opened), 0, [], []
    for file, dt in zip(opened, steps, strict=True):

        def told(share: float, file: File = file, before: int = before) -> None:
            progress(f"reading {file.path.name}", (before + share * file.size) / max(total, 1))

        try:
            found.append(_read(file, dt, problem, told))
        except InputError as error:
            faults += error.problems
        except OSError as error:
            allowed = f"a file that can be read ({error.strerror or error})"
            faults.append(complaint("file", str(file.path), allowed, "check the disk"))
        before += file.size
    if faults:
        raise InputError(faults)
    if len({file.velocities for file in opened}) > 1:
        without = [str(file.path) for file in opened if not file.velocities]
        allowed = "velocities in all files, or in none"
        raise InputError(complaint("velocities", f"none in {without}", allowed, "write them all"))
    return tuple(sorted(found, key=lambda run: -run.dt))


def open_files(files: Sequence[str | Path], layout: Layout, fewest: int = FEWEST) -> list[File]:
    """The files, with their beginnings read.

    Raises:
        InputError: one line for each that cannot be used, or they are too few.
    """
    paths = [Path(file) for file in files]
    faults, opened = [], []
    if len(paths) < fewest:
        allowed = f"at least {fewest}, with different step sizes" + (
            ", since fewer show no order" if fewest > 1 else ""
        )
        raise InputError(complaint("files", len(paths), allowed, "run with more step sizes"))
    for path in paths:
        try:
            if path.suffix.lower() not in FORMATS:
                allowed = f"a file whose name ends in {', '.join(FORMATS)}"
                raise InputError(complaint("file", str(path), allowed, "name it by its format"))
            opened.append(FORMATS[path.suffix.lower()](path, layout))
        except InputError as error:
            faults += error.problems
    if faults:
        raise InputError(faults)
    return opened


def _step_sizes(files: Sequence[File], dts: Sequence[Any] | None) -> list[float]:
    """The step size of each file, as it says itself or as is given.

    Raises:
        InputError: one is missing, no positive number, repeated, or said in two ways.
    """
    if dts is not None and len(dts) != len(files):
        allowed = f"one for each of the {len(files)} files, in their order"
        raise InputError(complaint("dt", len(dts), allowed, "give as many"))
    faults, found = [], []
    for i, file in enumerate(files):
        said = [_positive(file, file.dt, faults)] if file.dt is not None else []
        if dts is not None:
            said.append(_positive(file, dts[i], faults))
        if not said:
            fix = "write '# dt = 0.01' above the header" if isinstance(file, CsvFile) else ""
            faults.append(
                complaint(
                    f"{file.path}, dt",
                    "none",
                    "the step size, in the file or as --dt with one for each file",
                    fix or "store a number dt as well",
                )
            )
        elif len(said) == 2 and abs(said[0] - said[1]) > _SAME * abs(said[0]):
            allowed = f"{said[0]:g}, which the file itself says"
            faults.append(complaint(f"{file.path}, dt", said[1], allowed, "leave out one of them"))
        found += said[:1]
    if faults:
        raise InputError(faults)
    for i, dt in enumerate(found):
        for j in range(i):
            if abs(dt - found[j]) <= _SAME * dt:
                allowed = f"different step sizes; {files[j].path} has this one too"
                faults.append(
                    complaint(f"{files[i].path}, dt", dt, allowed, "leave out one of the files")
                )
                break
    if faults:
        raise InputError(faults)
    return found


def _positive(file: File, given: Any, faults: list[str]) -> float:
    try:
        number = finite_number(given)
        if number <= 0:
            raise ValueError("it must be above zero")
        return number
    except ValueError as error:
        allowed = f"a finite number > 0 ({error})"
        faults.append(complaint(f"{file.path}, dt", given, allowed, "for example dt = 0.01"))
        return np.nan


def _read(file: File, dt: float, problem: Problem, told: Callable[[float], None]) -> Run:
    sampling = Sampling(file.path, problem.ts)
    span = float(problem.ts[-1] - problem.ts[0])
    for block in file.blocks():
        sampling.take(block)
        told(min(1.0, float(block.times[-1] - problem.ts[0]) / span))
    values = sampling.finish()
    interval = sampling.interval or span
    if dt > interval * (1.0 + _SAME):
        allowed = f"at most {interval:g}, the time between two samples of the file"
        fix = "see whether dt belongs to another file"
        raise InputError(complaint(f"{file.path}, dt", dt, allowed, fix))
    return Run(file.path, dt, values, interval)
