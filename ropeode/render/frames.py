"""Results as tables of numbers for pandas and xarray, and trajectories as files of them."""

from __future__ import annotations

import dataclasses
import functools
import io
import itertools
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.analysis.errors import ErrorSeries
from ropeode.analysis.lyapunov import LyapunovExponent
from ropeode.analysis.motion import Motion
from ropeode.checking.trajectories.studies import TrajectoryErrors
from ropeode.files import check_suffix, write_whole
from ropeode.problems.problem import Problem
from ropeode.references.certificate import Certificate
from ropeode.references.files.verify import Verification
from ropeode.references.reference import Reference
from ropeode.render import data as of_table
from ropeode.simulation import Trajectories, Trajectory
from ropeode.study.accuracy_table import AccuracyTable
from ropeode.study.curves import Curve, ErrorCurves
from ropeode.study.energy import EnergyCurves
from ropeode.study.node_paths import NodePaths
from ropeode.sweep.storage.summary import SweepSummary
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
    """What pandas makes a frame of: columns by name, or a list of rows.

    Of a report, those of its CSV form.
    """
    return result._writer().as_lines(result)


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
def _(errors: TrajectoryErrors) -> list[dict[str, Any]]:
    return [dataclasses.asdict(row) for row in errors.rows]


@rows_of.register
def _(curves: ErrorCurves) -> list[dict[str, Any]]:
    return [line for each in curves.curves for line in _curve(each, "error")]


@rows_of.register
def _(curves: EnergyCurves) -> list[dict[str, Any]]:
    rows = []
    for each in curves.curves:
        # Outside the trust horizon the true energy, and so the error, is not a number.
        errors = itertools.chain(curves.errors(each).tolist(), itertools.repeat(float("nan")))
        lines = _curve(each, "energy")
        rows += [{**line, "error": error} for line, error in zip(lines, errors, strict=False)]
    return rows


@rows_of.register
def _(curve: Curve) -> list[dict[str, Any]]:
    return _curve(curve, "value")


def _curve(curve: Curve, name: str) -> list[dict[str, Any]]:
    run = {"stepper": curve.stepper, "run": curve.label, "dt": curve.dt}
    pairs = zip(curve.times.tolist(), curve.values.tolist(), strict=False)
    return [{**run, "time": time, name: value} for time, value in pairs]


@rows_of.register
def _(runs: Trajectories) -> dict[str, np.ndarray]:
    columns = [
        {"member": np.full(len(each.times), runs.start + index), **rows_of(each)}
        for index, each in enumerate(runs)
    ]
    return {name: np.concatenate([each[name] for each in columns]) for name in columns[0]}


@rows_of.register
def _(paths: NodePaths) -> list[dict[str, Any]]:
    return [
        {"stepper": path.stepper, "time": time, "node": node, **dict(zip(_AXES, x, strict=False))}
        for path in paths.paths
        for time, positions in zip(paths.times.tolist(), path.positions.tolist(), strict=False)
        for node, x in enumerate(positions)
    ]


@rows_of.register
def _(exponent: LyapunovExponent) -> dict[str, np.ndarray]:
    growth = {f"log_growth{index}": row for index, row in enumerate(exponent.log_growth)}
    return {"time": exponent.times, **growth}


@rows_of.register
def _(certificate: Certificate) -> list[dict[str, Any]]:
    names = ("tolerance", "role", "steps", "seconds", "difference")
    return [
        {"solver": str(each.solver), **{name: getattr(each, name) for name in names}}
        for each in certificate.witnesses
    ]


@rows_of.register
def _(verification: Verification) -> list[dict[str, Any]]:
    outside = verification.outside
    return [
        {"quantity": name, "distance": distance, "outside_at": outside.get(name)}
        for name, distance in verification.distances.items()
    ]


@rows_of.register
def _(motion: Motion) -> list[dict[str, Any]]:
    plain = {field.name: getattr(motion, field.name) for field in dataclasses.fields(motion)}
    numbers = {n: each for n, each in plain.items() if isinstance(each, (int, float, str))}
    return [numbers]


@rows_of.register
def _(summary: SweepSummary) -> list[dict[str, Any]]:
    return [
        {
            "stepper": name,
            **each.counts["status"],
            **{
                f"{column}_{end}": value
                for column, ends in each.ranges.items()
                for end, value in zip(("least", "greatest"), ends, strict=True)
            },
        }
        for name, each in summary.steppers.items()
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


def dataset(result: Reference | Trajectory | Trajectories) -> Any:
    """An xarray Dataset with the axes time, node and component; of many runs, also member.

    Arguments:
        result: a reference, a run, or runs.
    """
    xarray = require("xarray", "data", "data sets")
    if isinstance(result, Trajectories):
        # Those that ended early are filled up with what is not a number.
        every = xarray.concat([dataset(each) for each in result], dim="member", join="outer")
        return every.assign_coords(member=np.arange(result.start, result.start + len(result)))
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
