"""What a value is, and which software computes with it, in words that all processes share.

By these words a command finds in its cache folder what an earlier one made.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import os
import platform
import sys
import time
import types
from collections.abc import Iterable, Mapping
from fractions import Fraction
from importlib import metadata
from pathlib import Path
from typing import Any

import jax
import numpy as np

_OWN = Path(__file__).parent
_IMPORTED = time.time()
_PACKAGES = (
    *("diffrax", "equinox", "heyoka", "jax", "jaxlib", "lineax", "numpy", "optimistix", "scipy"),
)
# Of variables that JAX, XLA and Equinox read.
_VARIABLES = ("JAX_", "XLA_", "LIBTPU_", "EQX_")
# The lines of Linux's list of processors that say for which instructions to compile.
_PROCESSOR = ("model name", "flags", "Features", "CPU implementer", "CPU part")
_PLAIN = (type(None), bool, int, float, str, Fraction)


def described(value: Any) -> str:
    """What a value is; two of the same description compute the same, if the software is the same.

    Functions and classes are described by their names, and these are ropeode's own, whose text is
    part of the software.

    Arguments:
        value: numbers, texts, arrays and functions of ropeode, in tuples, mappings and dataclasses
            of ropeode. Of dataclasses those fields count by which they are compared.

    Raises:
        TypeError: there is something else in it, such as a function of the user's.
    """
    if type(value) in _PLAIN:
        return repr(value)
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return f"{value.dtype}{value.shape}{hashlib.sha256(value.tobytes()).hexdigest()}"
    if isinstance(value, jax.ShapeDtypeStruct):
        return f"{value.dtype}{value.shape}"
    if isinstance(value, type | types.FunctionType):
        return _name_of(value)
    if isinstance(value, Mapping):
        return f"{{{_listed((key, value[key]) for key in sorted(value))}}}"
    if type(value) in (tuple, list):
        return f"({_listed(value)})"
    if dataclasses.is_dataclass(value):
        fields = [each.name for each in dataclasses.fields(value) if each.compare]
        return f"{_name_of(type(value))}({_listed(getattr(value, name) for name in fields)})"
    if isinstance(value, tuple):
        return f"{_name_of(type(value))}({_listed(value)})"
    raise TypeError(f"nobody knows what a {type(value).__name__} computes")


def _listed(values: Iterable[Any]) -> str:
    return ", ".join(map(described, values))


def _name_of(own: Any) -> str:
    """The name under which the package has a function or a class.

    Raises:
        TypeError: it has none.
    """
    found: Any = sys.modules.get(own.__module__ or "")
    for name in own.__qualname__.split("."):
        found = getattr(found, name, None)
    if found is not own or not own.__module__.startswith("ropeode."):
        raise TypeError(f"{own.__qualname__} is none of ropeode's own")
    return f"{own.__module__}.{own.__qualname__}"


@functools.cache
def software() -> str | None:
    """All that decides what a program computes, beside the program: packages, sources, machine.

    None where the sources are not what was imported: nobody knows then what it was.
    """
    digest = source_digest(_OWN)
    if not is_as_imported():
        return None
    return json.dumps(
        [
            {name: _version(name) for name in _PACKAGES},
            digest,
            platform.python_version(),
            [f"{each} {each.device_kind} {each.client.platform_version}" for each in jax.devices()],
            platform.machine(),
            _processor(),
            sorted(each for each in os.environ.items() if each[0].startswith(_VARIABLES)),
        ]
    )


def is_as_imported() -> bool:
    """Whether no source file was written since the first ones were imported."""
    return all(path.stat().st_mtime < _IMPORTED for path in _OWN.rglob("*.py"))


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _processor() -> list[str]:
    try:
        with open("/proc/cpuinfo") as file:
            first = file.read(2**14).split("\n\n")[0]
    except OSError:
        return [platform.processor()]
    return [line for line in first.splitlines() if line.startswith(_PROCESSOR)]


def source_digest(package: Path, parts: Iterable[str] = ("",)) -> str:
    """The sha256 of source files, which may change between releases.

    Arguments:
        package: the folder that contains them.
        parts: the files and folders that count; by default all.
    """
    total = hashlib.sha256()
    for part in parts:
        path = package / part
        files = [path] if path.is_file() else sorted(path.rglob("*.py"))
        for file in files:
            contents = file.read_bytes()
            total.update(f"{file.relative_to(package).as_posix()}\0{len(contents)}\0".encode())
            total.update(contents)
    return total.hexdigest()
