"""Results as tables of numbers for pandas and xarray, and trajectories as files of them."""

from __future__ import annotations

import functools
import io
import itertools
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.analysis.errors import ErrorSeries
from ropeode.checking.report import CheckReport
from ropeode.files import check_suffix, write_whole
from ropeode.problems.problem import Problem
from ropeode.references.certificate import Certificate
from ropeode.references.reference import Reference
from ropeode.render import check as of_check
from ropeode.render import data as of_table
from ropeode.simulation import Trajectory
from ropeode.study.accuracy_table import AccuracyTable
from ropeode.study.curves import ErrorCurves
from ropeode.study.energy import EnergyCurves
from ropeode.validation import require

_AXES = "xyz"
_LETTERS = {"position": "", "velocity": "v"}


def dataframe(result: Any) -> Any:
    """A pandas DataFrame.

    Arguments:
        result: of a type that `rows_of` knows.
    """
    pandas = require("pandas", "data", "data frames")
    return pandas.DataFrame(rows_of(result))


@functools.singledispatch
def rows_of(result: Any) -> Any:
    """What pandas makes a frame of: columns by name, or a list of rows."""
    raise TypeError(f"nobody has written how a {type(result).__name__} is a data frame")


@rows_of.register
def _(reference: Reference) -> dict[str, np.ndarray]:
    columns = _states(reference.problem, reference.times, reference.states)
    return {**columns, **_bounds(reference.certificate, len(reference.times))}


@rows_of.register
def _(run: Trajectory) -> dict[str, np.ndarray]:
    return _states(run.problem, run.times, run.states)


@rows_of.register
def _(errors: ErrorSeries) -> dict[str, np.ndarray]:
    return {"time": errors.times, "error": errors.values, "resolution": errors.resolution}


@rows_of.register
def _(table: AccuracyTable) -> list[dict[str, Any]]:
    return of_table.as_lines(table)


@rows_of.register
def _(report: CheckReport) -> list[dict[str, Any]]:
    return of_check.as_lines(report)


@rows_of.register(ErrorCurves)
@rows_of.register(EnergyCurves)
def _(curves: ErrorCurves | EnergyCurves) -> list[dict[str, Any]]:
    name = "error" if isinstance(curves, ErrorCurves) else "energy"
    return [
        {"stepper": each.stepper, "run": each.label, "dt": each.dt, "time": time, name: value}
        for each in curves.curves
        for time, value in zip(each.times.tolist(), each.values.tolist(), strict=False)
    ]


def _states(problem: Problem, times: np.ndarray, states: np.ndarray) -> dict[str, np.ndarray]:
    """The time, and each number of the state under a name such as ``x0``, ``vy3`` or ``y2``."""
    columns = {"time": times}
    for quantity in problem.quantities:
        values = problem.quantity(quantity, states)
        for node, axis in itertools.product(*map(range, values.shape[1:])):
            if problem.mechanics is None:
                name = f"y{node}"
            else:
                name = f"{_LETTERS[quantity]}{_AXES[axis : axis + 1] or f'x{axis}_'}{node}"
            columns[name] = values[:, node, axis]
    return columns


def _bounds(certificate: Certificate, samples: int) -> dict[str, np.ndarray]:
    """The bound of each quantity; not a number outside the trust horizon."""
    columns = {}
    for quantity, series in certificate.bounds.items():
        bound = np.full(samples, np.nan)
        bound[: certificate.trusted] = series[: certificate.trusted]
        columns[f"{quantity}_bound"] = bound
    return columns


def dataset(result: Reference | Trajectory) -> Any:
    """An xarray Dataset with the axes time, node and component.

    Arguments:
        result: a reference or a run.
    """
    xarray = require("xarray", "data", "data sets")
    problem, axes = result.problem, ("time", "node", "component")
    variables: dict[str, Any] = {
        quantity: (axes, problem.quantity(quantity, result.states))
        for quantity in problem.quantities
    }
    attributes: dict[str, Any] = {"problem": problem.name}
    if isinstance(result, Reference):
        certificate = result.certificate
        bounds = _bounds(certificate, len(result.times))
        variables |= {name: ("time", values) for name, values in bounds.items()}
        attributes |= {"solver": str(certificate.solver), "level": certificate.level}
    else:
        attributes |= {"stepper": result.stepper.label, "dt": result.dt}
    return xarray.Dataset(variables, coords={"time": result.times}, attrs=attributes)


def _csv(columns: dict[str, np.ndarray]) -> bytes:
    return _text(columns, ",", ",".join(columns))


def _txt(columns: dict[str, np.ndarray]) -> bytes:
    return _text(columns, " ", "# " + " ".join(columns))


def _text(columns: dict[str, np.ndarray], between: str, head: str) -> bytes:
    """A line for each time; numbers in the 17 digits that make them again."""
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    lines = (between.join(f"{value:.17g}" for value in row) for row in rows)
    return "\n".join([head, *lines, ""]).encode()


def _npz(columns: dict[str, np.ndarray]) -> bytes:
    contents = io.BytesIO()
    np.savez(contents, allow_pickle=False, **columns)
    return contents.getvalue()


def _parquet(columns: dict[str, np.ndarray]) -> bytes:
    arrow = require("pyarrow", "data", "Parquet files")
    from pyarrow import parquet

    contents = io.BytesIO()
    parquet.write_table(arrow.table(columns), contents)
    return contents.getvalue()


EXPORTS = {".csv": _csv, ".txt": _txt, ".npz": _npz, ".parquet": _parquet}


def check_export(path: str | Path) -> Path:
    """A path that a trajectory can be exported to, checked before anything is computed.

    Raises:
        InputError: its suffix is none of `EXPORTS`, or it cannot be written to.
    """
    return check_suffix("out", path, EXPORTS)


def write_export(reference: Reference, path: str | Path) -> Path:
    """Write a reference's states and bounds to a file that other programs read.

    Arguments:
        reference: whose times, states and bounds are written, a column each.
        path: of the file; its suffix is one of `EXPORTS`. One that exists is replaced.

    Returns:
        The path.

    Raises:
        InputError: the suffix is another, or the file cannot be written.
    """
    path = check_export(path)
    write_whole(path, EXPORTS[path.suffix.lower()](rows_of(reference)))
    return path
