"""Content hashes: a key changes with everything that determines a result."""

from __future__ import annotations

import functools
import hashlib
import json
import platform
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import jax

from ropeode.cache import source_digest
from ropeode.files import read_bytes
from ropeode.problems import file_and_imports

# The packages that compute a row; diffrax's solvers come from the last three.
PACKAGES = (
    *("ropeode", "diffrax", "jax", "jaxlib", "numpy", "scipy"),
    *("equinox", "lineax", "optimistix"),
)
# The rooms of this package that compute a row, and those that they import. The files beside the
# rooms count too.
_ROOMS = (
    *("analysis", "problems", "references", "simulation", "steppers", "study", "sweep"),
    *("tableaus", "theory"),
)


def digest(value: Any) -> str:
    """The sha256 of a plain value; the order of the keys in a mapping does not count.

    Raises:
        ValueError: a number is not finite.
    """
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def file_digest(what: str, path: Path) -> str:
    """The sha256 of a user's file, and of those that it imports from its folder.

    Arguments:
        what: it defines, for the message.
        path: of the file.

    Raises:
        InputError: it cannot be read.
    """
    contents = hashlib.sha256(read_bytes(what, path))
    for each in sorted({*file_and_imports(path)} - {path}):
        contents.update(hashlib.sha256(read_bytes(what, each)).digest())
    return contents.hexdigest()


@functools.cache
def software() -> Mapping[str, str]:
    """The versions of all software that computes a row, and the kind of machine."""
    versions = {name: metadata.version(name) for name in PACKAGES}
    try:
        versions["heyoka"] = metadata.version("heyoka")
    except metadata.PackageNotFoundError:
        versions["heyoka"] = "not installed"
    package = Path(__file__).parents[2]
    files = sorted(each.name for each in package.glob("*.py"))
    return {
        **versions,
        "python": platform.python_version(),
        "machine": platform.machine(),
        "backend": jax.default_backend(),
        "source": source_digest(package, [*files, *_ROOMS]),
    }
