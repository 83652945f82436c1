"""Named arrays and texts as a NetCDF4 file, and back, with every size and type checked."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5netcdf
import numpy as np

from ropeode.errors import InputError
from ropeode.references.files.encoding import Array
from ropeode.validation import bad_value

# The only types that are written, and so the only ones that are read.
_TYPES = ("<f8", "|i1")
_HASH = "sha256"


def encoded(arrays: Mapping[str, Array], texts: Mapping[str, str]) -> bytes:
    """A file of variables and global attributes, without the checksum at its end.

    A sha256 of the variables and the attributes is one more attribute. HDF5 meets no disk: one
    that is full may end the process.
    """
    contents = io.BytesIO()
    with h5netcdf.File(contents, "w") as file:
        for array in arrays.values():
            for dim, size in zip(array.dims, array.values.shape, strict=True):
                if dim not in file.dimensions:
                    file.dimensions[dim] = size
        for name, array in arrays.items():
            variable = file.create_variable(name, array.dims, array.values.dtype, data=array.values)
            variable.attrs["long_name"] = array.long_name
            variable.attrs["units"] = array.units
        for name, text in texts.items():
            file.attrs[name] = text
        file.attrs[_HASH] = content_hash(arrays, texts)
    return contents.getvalue()


def read(path: Path) -> tuple[dict[str, Array], dict[str, str]]:
    """Read a file whose checksum has been verified.

    Sizes are compared with that of the file before any memory is allocated. Data outside the
    file itself, and types that `write` does not write, are refused.

    Raises:
        InputError: it is no such file.
    """
    try:
        with h5netcdf.File(path, "r") as file:
            room = path.stat().st_size
            arrays = {}
            for name, variable in file.variables.items():
                _check_variable(path, name, variable, room)
                arrays[name] = Array(
                    tuple(variable.dimensions),
                    np.asarray(variable[...]),
                    str(variable.attrs.get("long_name", "")),
                    str(variable.attrs.get("units", "")),
                )
            texts = {name: _text(path, name, value) for name, value in file.attrs.items()}
    except InputError:
        raise
    except Exception as error:
        # HDF5 and h5netcdf raise errors of many kinds on files that are not theirs.
        raise _refusal(path, f"a NetCDF4 file ({type(error).__name__}: {error})") from error
    stored_hash = texts.pop(_HASH, "")
    if stored_hash != content_hash(arrays, texts):
        raise _refusal(path, "numbers and texts that have the sha256 stored beside them")
    return arrays, texts


def content_hash(arrays: Mapping[str, Array], texts: Mapping[str, str]) -> str:
    """The sha256 of the contents, whatever file they are in.

    It covers names, dimensions, shapes, types, units and bytes of the variables, and the texts,
    in the order of their names; docs/howto/files.md says how.
    """
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = arrays[name]
        head = [name, array.dims, array.values.shape, array.values.dtype.str]
        digest.update(json.dumps([*head, array.long_name, array.units]).encode())
        digest.update(np.ascontiguousarray(array.values).data)
    digest.update(json.dumps({name: texts[name] for name in sorted(texts)}).encode())
    return digest.hexdigest()


def _check_variable(path: Path, name: str, variable: Any, room: int) -> None:
    stored = variable._h5ds
    if stored.dtype.str not in _TYPES:
        raise _refusal(path, f"numbers of the types {', '.join(_TYPES)} ({name}: {stored.dtype})")
    if stored.is_virtual or stored.external or stored.chunks is not None:
        raise _refusal(path, f"numbers stored in one piece in the file itself ({name})")
    declared = int(np.prod(stored.shape, dtype=object)) * stored.dtype.itemsize
    if declared > room:
        raise _refusal(path, f"no more numbers than it has room for ({name}: {declared} bytes)")


def _text(path: Path, name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise _refusal(path, f"attributes that are texts ({name})")
    return value


def _refusal(path: Path, allowed: str) -> InputError:
    fix = "do not use it; write it again, or download it again"
    return bad_value("reference", str(path), f"a file with {allowed}", fix)
