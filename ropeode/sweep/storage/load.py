"""The rows of a sweep as a pandas or an xarray object."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ropeode.errors import InputError
from ropeode.sweep.storage.folder import Index, read_index
from ropeode.validation import bad_value, require, unknown

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

Form = Literal["pandas", "xarray"]
# An xarray object may have this many cells for each row.
_MOST_CELLS = 4


def load_sweep(
    folder: str | Path, *, columns: Sequence[str] | None = None, form: Form = "pandas"
) -> pd.DataFrame | xr.Dataset:
    """The rows of a sweep, in the order of its spec; a running sweep can be read too.

    Arguments:
        folder: of the sweep.
        columns: to load; all by default. An xarray object always has all inputs.
        form: ``pandas``: a `DataFrame` whose index is the number of the case, with types that
            allow missing values. ``xarray``: a `Dataset` whose dimensions are the inputs that
            differ; missing values are NaN.

    Raises:
        InputError: there is no sweep in the folder, or no such column; or so many inputs
            differ that most cells of an xarray object would be empty.
        RopeodeError: a file is damaged.

    Examples:
        >>> from ropeode import load_sweep, run_sweep
        >>> grid = {"damping": [0.0, 0.1], "num_nodes": [4], "frames": [3]}
        >>> summary = run_sweep({"steppers": ["rk4"], "grid": grid}, "ropes")
        >>> load_sweep("ropes")[["damping", "steps_per_frame", "observed_order"]].head(2).round(1)
              damping  steps_per_frame  observed_order
        case
        0         0.0               16             3.9
        1         0.0               32             4.0
    """
    require("pandas", "data", "sweeps")
    require("pyarrow", "data", "sweeps")
    index = sweep_in(folder)
    for name in columns or ():
        if name not in index.columns:
            raise InputError(unknown("column", name, index.columns))
    if form == "pandas":
        return _frame(Path(folder), index, columns)
    if form != "xarray":
        raise InputError(unknown("form", str(form), ("pandas", "xarray")))
    require("xarray", "data", "sweeps")
    inputs = index.inputs
    wanted = None if columns is None else list(dict.fromkeys([*inputs, *columns]))
    return _dataset(_frame(Path(folder), index, wanted), inputs)


def sweep_in(folder: str | Path) -> Index:
    """The index of a folder.

    Raises:
        InputError: there is no sweep in it.
    """
    if (index := read_index(Path(folder))) is None:
        raise bad_value("folder", str(folder), "a folder of `ropeode sweep`", "check the path")
    return index


def _frame(folder: Path, index: Index, columns: Sequence[str] | None) -> pd.DataFrame:
    import pandas as pd
    import pyarrow as pa

    from ropeode.sweep.storage.row_files import NUMBER, Store, read_parts

    schema = Store(folder / index.rows, index.columns).schema
    if columns is not None:
        schema = pa.schema([schema.field(name) for name in dict.fromkeys([NUMBER, *columns])])
    tables = [table.select(schema.names) for table in read_parts(folder / index.rows, columns)]
    types: dict[Any, Any] = {
        pa.int64(): pd.Int64Dtype(),
        pa.bool_(): pd.BooleanDtype(),
        pa.string(): pd.StringDtype(),
    }
    # Cases of one task have one shape, and need not be neighbours.
    table = pa.concat_tables([schema.empty_table(), *tables]).sort_by(NUMBER)
    return table.to_pandas(types_mapper=types.get).set_index(NUMBER)


def _dataset(frame: Any, inputs: Sequence[str]) -> xr.Dataset:
    sizes = {name: frame[name].nunique(dropna=False) for name in inputs}
    dims = [name for name, size in sizes.items() if size > 1]
    if "draw" in dims:
        # Drawn parameters differ from draw to draw; they are not dimensions of their own.
        drawn = frame.groupby(["seed", "draw"], dropna=False)
        grid = [name for name in dims if drawn[name].nunique(dropna=False).max() > 1]
        dims = [name for name in dims if name in ("seed", "draw", *grid)]
    cells = math.prod(sizes[name] for name in dims)
    if cells > _MOST_CELLS * max(1, len(frame)):
        raise bad_value(
            "form",
            "xarray",
            f"pandas for this sweep ({len(frame)} rows would be {cells} cells of "
            f"{' x '.join(dims)})",
            "form='pandas'",
        )
    types: dict[str, Any] = {}
    for name, column in frame.items():
        if column.dtype.kind in "ib":
            types[name] = "float64" if column.isna().any() else column.dtype.numpy_dtype
        elif column.dtype.kind != "f":
            types[name] = object
    return frame.astype(types).set_index(dims or inputs[:1]).to_xarray()
