"""Results as tables of numbers for pandas and xarray, and trajectories as files of them."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.files import check_suffix, write_whole
from ropeode.references import Reference
from ropeode.render.results import rows
from ropeode.render.small_results import bound_columns
from ropeode.simulation import Trajectories, Trajectory
from ropeode.validation import require


def dataframe(result: Any) -> Any:
    """A pandas DataFrame.

    Arguments:
        result: of a type that `rows` knows.
    """
    pandas = require("pandas", "data", "data frames")
    return pandas.DataFrame(rows(result))


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
        bounds = bound_columns(certificate, len(result.times))
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
    write_whole(path, EXPORTS[path.suffix.lower()](rows(reference)))
    return path
