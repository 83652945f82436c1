"""Named arrays and texts as a NetCDF4 file, and back, with every size and type checked."""

from __future__ import annotations

import hashlib
import io
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import numpy as np

from ropeode.references.files.checksum import unusable
from ropeode.references.files.encoding import Array
from ropeode.validation import listed, shortly

# The only types that are written, and so the only ones that are read.
_TYPES = ("<f8", "|i1")
_HASH, _PROPERTIES = "sha256", "_NCProperties"
# The name of what has a length and no numbers.
_NO_VARIABLE = b"This is a netCDF dimension but not a netCDF variable"


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
    file itself, and types that `encoded` does not write, are refused.

    Raises:
        InputError: it is no such file.
    """
    room, arrays = path.stat().st_size, {}
    try:
        # Not h5netcdf, which complains once more when a file is closed that it could not open.
        with h5py.File(path, "r") as file:
            for name in map(str, file):
                if not isinstance(file.get(name, getlink=True), h5py.HardLink):
                    raise ValueError(f"{name} is a link")
                data: Any = file[name]
                if data.attrs.get("NAME", b"").startswith(_NO_VARIABLE):
                    continue
                room -= _checked_size(name, data, room)
                dims = (name,) if data.is_scale else (dim[0].name[1:] for dim in data.dims)
                words = (str(data.attrs.get(each, "")) for each in ("long_name", "units"))
                arrays[name] = Array(tuple(dims), data[...], *words)
            found: dict[str, Any] = {each: file.attrs[each] for each in file.attrs}
        texts = {name: text for name, text in found.items() if name != _PROPERTIES}
        if not all(isinstance(text, str) for text in texts.values()):
            raise ValueError("some attribute is no text")
        if texts.pop(_HASH, "") != content_hash(arrays, texts):
            raise ValueError("its numbers and texts do not have the sha256 stored beside them")
    except Exception as error:
        # HDF5 raises errors of many kinds on files that are not its own.
        raise unusable(path, f"a NetCDF4 file as ropeode writes it ({shortly(error)})") from error
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


def _checked_size(name: str, data: h5py.Dataset, room: int) -> int:
    """The bytes of an array that is stored in one piece in the file, of a type that is written.

    Raises:
        ValueError: it is another one, or has more bytes than there is room.
    """
    if data.dtype.str not in _TYPES:
        raise ValueError(f"{name} has the type {data.dtype}, not {listed(_TYPES)}")
    if data.is_virtual or data.external or data.chunks is not None:
        raise ValueError(f"{name} is not stored in one piece in the file itself")
    declared = math.prod(data.shape) * data.dtype.itemsize
    if declared > room:
        raise ValueError(f"{name} has {declared} bytes, more than there are")
    return declared
