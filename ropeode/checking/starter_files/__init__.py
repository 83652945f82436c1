"""Files to start from: a spec, the initial state, and a program that writes trajectories."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.checking.trajectories.layout import Layout, samples_of
from ropeode.files import check_writable
from ropeode.problems import ROPES, Problem, file_and_name
from ropeode.study import TableJob
from ropeode.validation import bad_value

# The coarsest step times omega of the stiffest spring between the lightest nodes, and the number of
# step sizes.
_COARSEST, _LEVELS = 0.8, 4


def write_start(folder: str | Path, job: TableJob | None = None) -> list[str]:
    """Write a folder of files to start from, whole or not at all.

    Arguments:
        folder: it must not exist yet.
        job: its problem is the one to solve; by default the default rope.

    Returns:
        The paths of the files.

    Raises:
        InputError: the folder exists, or cannot be created.
    """
    return _write_folder(folder, _texts(job or TableJob({})))


def write_assignment(folder: str | Path, name: str) -> list[str]:
    """Write the folder of files for an assignment, whole or not at all.

    A spec for each kind of rope, the initial state, a program in C++ with all methods, and a page
    that shows how to print a CSV file from the assignment's own classes.

    Arguments:
        folder: it must not exist yet.
        name: of a folder beside this file.

    Returns:
        The paths of the files.

    Raises:
        InputError: the folder exists, or cannot be created.
    """
    files = sorted(resources.files(__name__).joinpath(name).iterdir(), key=lambda file: file.name)
    return _write_folder(folder, {file.name: file.read_text(encoding="utf-8") for file in files})


def _write_folder(folder: str | Path, texts: Mapping[str, str]) -> list[str]:
    """Write a folder of texts, by name of the file, whole or not at all."""
    path = Path(folder)
    if path.exists():
        raise bad_value("init", str(path), "a new folder", "choose another name")
    check_writable("init", path)
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as part:
            new = Path(part) / path.name
            new.mkdir()
            for name, text in texts.items():
                (new / name).write_text(text, encoding="utf-8")
            new.rename(path)
    except OSError as error:
        allowed = f"a folder that can be created ({error.strerror or error})"
        raise bad_value("init", str(path), allowed, "choose another") from error
    return [str(path / name) for name in texts]


def _texts(job: TableJob) -> dict[str, str]:
    problem = job.problem
    texts = {
        "spec.toml": _spec_text(job),
        "initial.csv": _initial_state(problem),
        "README.md": _page(problem),
    }
    if problem.parameters.get("kind") == "rope":
        numbers = "\n".join(_numbers(problem))
        texts["rope.cpp"] = _template("rope.cpp").replace("@NUMBERS@", numbers)
    return texts


def _template(name: str) -> str:
    """The text of a file of this folder, which may have places to fill in."""
    return resources.files(__name__).joinpath(name).read_text(encoding="utf-8")


def _spec_text(job: TableJob) -> str:
    """A spec that does not depend on its folder."""
    spec, parameters = job.spec, job.problem.parameters
    rope = ROPES.get(parameters.get("kind", "")) if spec.reference is None else None
    settings: dict[str, Any]
    if spec.reference is not None:
        # It includes the problem.
        settings = {"reference": _stored(job, spec.reference)}
    else:
        own = {"kind": parameters["kind"]} if rope else {"problem": _named(job)}
        settings = own | {"frames": parameters.get("frames", spec.frames)}
    settings |= {name: value for name, value in spec.asked.items() if value != "consensus"}
    # These values are written in JSON as they are in TOML.
    lines = [f"{key} = {json.dumps(value)}" for key, value in settings.items() if value is not None]
    if rope is not None:
        lines += ["", "[rope]"]
        for name, field in rope.model_fields.items():
            extra: Any = field.json_schema_extra
            lines += [f"# {extra['allowed']}", f"{name} = {json.dumps(parameters[name])}"]
    head = "# The problem that the program should solve. `ropeode spec` explains all settings."
    return "\n".join([head, "", *lines, ""])


def _stored(job: TableJob, name: str) -> str:
    """A reference's name; for a file its whole path."""
    beside = (job.folder or Path()) / name
    return str(beside.resolve()) if beside.exists() else name


def _named(job: TableJob) -> str:
    """The problem's name; if it is in a file, with the whole path."""
    if ":" not in job.spec.problem:
        return job.spec.problem
    path, name = file_and_name(job.spec.problem, job.folder)
    return f"{path.resolve()}:{name}"


def _initial_state(problem: Problem) -> str:
    """The initial state as a CSV file."""
    rows = [
        ",".join([f"{problem.ts[0]:g}", str(node), *(repr(x).removesuffix(".0") for x in row)])
        for node, row in enumerate(samples_of(problem, problem.y0[None])[0].tolist())
    ]
    return "\n".join([Layout.of(problem).headers[-1], *rows, ""])


def _page(problem: Problem) -> str:
    layout, ts = Layout.of(problem), problem.ts
    own_program = problem.parameters.get("kind") == "rope"
    name, steps = ("rope", _steps(problem)) if own_program else ("run", ["1", "2", "3"])
    files = " ".join(f"{name}-{n}.csv" for n in steps)
    times = ", ".join(f"{t:g}" for t in ts)
    if len(ts) > 4 and problem.equal_frames:
        times = f"{ts[0]:g}, {ts[1]:g}, {ts[2]:g}, ..., {ts[-1]:g}"
    # The program's page comes first: it has places to fill in itself.
    values = {
        "PROGRAM": _template("program.md") if own_program else "",
        "GRADE": f"ropeode grade {files} --problem spec.toml --order 2",
        "RUNS": "\n".join(f"./rope {n} > rope-{n}.csv" for n in steps),
        "PROBLEM": f"The {problem.name} of `spec.toml`: {layout.nodes} nodes with {layout.dim} "
        f"coordinates, from t = {ts[0]:g} to t = {ts[-1]:g}.",
        "INITIAL": "\n".join(_initial_state(problem).splitlines()[:4]),
        "TIMES": times,
    }
    text = _template("page.md")
    for key, value in values.items():
        text = text.replace(f"@{key}@", value)
    return text.rstrip("\n") + "\n"


def _steps(problem: Problem) -> list[str]:
    """Steps per frame, from the coarsest at which Verlet's method is stable and accurate."""
    args = problem.args
    stiffest = float(np.max(args.stiffness, initial=0.0))
    omega = 2.0 * math.sqrt(stiffest / float(np.min(args.mass)))
    coarsest = max(3, math.ceil(math.log2(max(omega / _COARSEST, 1.0))))
    return [str(2 ** (coarsest + level)) for level in range(_LEVELS)]


def _numbers(problem: Problem) -> list[str]:
    """The rope's parameters as C++ declarations."""
    args, layout = problem.args, Layout.of(problem)

    def vector(name: str, values: Any, kind: str = "double") -> str:
        numbers = [repr(value) for value in np.asarray(values).tolist()]
        text = ", ".join(numbers).lower()
        return f"const std::vector<{kind}> {name} = {{{text}}};"

    return [
        f"constexpr int nodes = {layout.nodes}, dim = {layout.dim}, frames = {problem.frames};",
        f'constexpr const char* header = "{layout.headers[-1]}";',
        vector("mass", args.mass),
        vector("stiffness", args.stiffness),
        vector("rest_length", args.rest_length),
        vector("damping", args.damping),
        vector("gravity", np.ravel(args.gravity)),
        vector("pinned", np.asarray(args.free) == 0.0, "bool"),
    ]
