"""Keys: a hash of everything that determines a result."""

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

# What takes part in computing a row; diffrax's solvers come from the last three.
PACKAGES = (
    "ropeode",
    "diffrax",
    "jax",
    "jaxlib",
    "numpy",
    "scipy",
    "equinox",
    "lineax",
    "optimistix",
)
# The parts of the package that do, with all that they import from it.
SOURCES = (
    "analysis",
    "errors.py",
    "files.py",
    "norms.py",
    "precision.py",
    "problems",
    "progress.py",
    "references",
    "simulation",
    "steppers",
    "study/accuracy_table.py",
    "study/spec.py",
    "sweep/execution/tasks.py",
    "sweep/design/cases.py",
    "sweep/design/columns.py",
    "sweep/design/distributions.py",
    "sweep/execution/evaluate.py",
    "sweep/design/content_hash.py",
    "sweep/design/problem_factory.py",
    "sweep/execution/references.py",
    "sweep/execution/runs.py",
    "threads.py",
    "validation.py",
)


def digest(value: Any) -> str:
    """The sha256 of a plain value; that of a table does not depend on the order of its names.

    Raises:
        ValueError: a number is not finite.
    """
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def surroundings(level: str = "consensus") -> Mapping[str, str]:
    """What a result depends on beside what is asked for: software, and the kind of machine.

    Arguments:
        level: of the references; heyoka takes part in extended ones.
    """
    if level != "extended":
        return _surroundings()
    try:
        heyoka = metadata.version("heyoka")
    except metadata.PackageNotFoundError:
        heyoka = "not installed"
    return {**_surroundings(), "heyoka": heyoka}


@functools.lru_cache(maxsize=1)
def _surroundings() -> Mapping[str, str]:
    return {
        **{name: metadata.version(name) for name in PACKAGES},
        "python": platform.python_version(),
        "machine": platform.machine(),
        "backend": jax.default_backend(),
        "source": source_digest(Path(__file__).parents[2]),
    }


def source_digest(package: Path) -> str:
    """The sha256 of the files that take part, for whoever changes them between releases.

    Arguments:
        package: the folder that they are in.
    """
    found = hashlib.sha256()
    for part in SOURCES:
        path = package / part
        for file in [path] if path.is_file() else sorted(path.rglob("*.py")):
            found.update(f"{file.relative_to(package).as_posix()}\0".encode())
            found.update(hashlib.sha256(file.read_bytes()).digest())
    return found.hexdigest()
