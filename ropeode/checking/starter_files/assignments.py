"""Files to start from for assignments that many courses set."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ropeode.checking.starter_files import initial_state, spec_text, template, write_folder
from ropeode.errors import InputError
from ropeode.study import TableJob
from ropeode.validation import unknown

# By assignment the problems of its specs, by name of the file. The first has the initial state.
ASSIGNMENTS: dict[str, dict[str, dict[str, Any]]] = {
    "games101": {
        f"{name}.toml": {"kind": kind, "frames": 20, "rope": {"damping": 0.0}}
        for name, kind in (("springs", "rope"), ("rigid", "inextensible-rope"))
    },
}


def write_assignment(folder: str | Path, name: str) -> list[str]:
    """Write the folder of files for an assignment, whole or not at all.

    A spec for each kind of rope, the initial state, a program in C++ with all methods, and a page
    that shows how to print a CSV file from the assignment's own classes.

    Arguments:
        folder: it must not exist yet.
        name: one of `ASSIGNMENTS`.

    Returns:
        The paths of the files.

    Raises:
        InputError: there is no such assignment; the folder exists, or cannot be created.
    """
    if name not in ASSIGNMENTS:
        raise InputError(unknown("assignment", name, ASSIGNMENTS))
    jobs = {spec: TableJob(values) for spec, values in ASSIGNMENTS[name].items()}
    texts = {spec: spec_text(job) for spec, job in jobs.items()}
    texts["initial.csv"] = initial_state(next(iter(jobs.values())).problem)
    texts["README.md"] = template(f"{name}/page.md")
    texts["rope.cpp"] = template(f"{name}/rope.cpp")
    return write_folder(folder, texts)
