"""Problems by name: from the library, or from a user's own Python file."""

from __future__ import annotations

import importlib.util
import inspect
import sys
from pathlib import Path
from typing import Any

from ropeode.errors import InputError, call_user_code
from ropeode.files import read_text
from ropeode.problems.library import PROBLEMS
from ropeode.problems.problem import Problem
from ropeode.problems.rope_input import RopeInput
from ropeode.validation import bad_value, unknown


def load_problem(where: str, *, folder: Path | None = None, frames: int | None = None) -> Problem:
    """A problem of the library by its name, or of a file as ``FILE.py:NAME``.

    In a file, NAME is a `Problem`, a rope, or a function that returns one of them; a
    function that has a parameter `frames` is given it.

    Arguments:
        where: the name, or file and name.
        folder: that a relative file name starts from; the current one by default.
        frames: how many frames to solve; None leaves it to the problem.

    Raises:
        InputError: there is no such file, name or library problem; or NAME is something
            else; or `frames` is given to a problem whose sample times are fixed.
        UserCodeError: the file or the function raised.
    """
    if ":" not in where and not where.endswith(".py"):
        if where not in PROBLEMS:
            raise InputError(unknown("problem", where, [*PROBLEMS, "FILE.py:NAME"]))
        return PROBLEMS[where](**({} if frames is None else {"frames": frames}))

    return as_problem(named_in_file(where, folder), where, frames)


def named_in_file(where: str, folder: Path | None = None, what: str = "problem") -> Any:
    """What a name in a Python file stands for, as ``FILE.py:NAME``.

    Arguments:
        where: file and name.
        folder: that a relative file name starts from; the current one by default.
        what: it is, for messages.

    Raises:
        InputError: there is no such file or name.
        UserCodeError: the file raised.
    """
    path, name = file_and_name(where, folder, what)
    found = names_in_file(path, what)
    if name not in found:
        public = [
            key
            for key, value in found.items()
            if not key.startswith("_") and not inspect.ismodule(value)
        ]
        raise InputError(unknown(f"name in {path}", name, public))
    return found[name]


def file_and_name(
    where: str, folder: Path | None = None, what: str = "problem"
) -> tuple[Path, str]:
    """The two parts of ``FILE.py:NAME``; arguments are those of `named_in_file`.

    Raises:
        InputError: one is missing.
    """
    file, _, name = where.rpartition(":")
    if not file or not name.isidentifier():
        raise bad_value(what, where, "FILE.py:NAME", f"add the name, as in {what}s.py:{what}")
    return (folder or Path()) / file, name


def names_in_file(path: Path, what: str) -> dict[str, Any]:
    """All names of a Python file, which is run; messages say `what` it holds.

    Raises:
        InputError: there is no such file, or it is no Python file.
        UserCodeError: the file raised.
    """
    read_text(what, path)
    spec = importlib.util.spec_from_file_location(f"ropeode_user_{what}", path)
    if spec is None or spec.loader is None:
        raise bad_value(what, str(path), "a Python file, *.py", "rename it")
    module = importlib.util.module_from_spec(spec)
    # Dataclasses and pickles look their module up by its name.
    sys.modules[spec.name] = module
    call_user_code(f"{what}: the file {path}", spec.loader.exec_module, module)
    return vars(module)


def as_problem(found: Any, where: str, frames: int | None, **parameters: Any) -> Problem:
    """The problem that a name in a file stands for.

    Arguments:
        found: a `Problem`, a rope, or a function that returns one of them.
        where: what it is called.
        frames: how many frames to solve; None leaves it to the problem.
        parameters: others of the function.

    Raises:
        InputError: it is something else; or `frames` is given to a problem whose sample times
            are fixed.
        UserCodeError: the function raised.
    """
    if callable(found) and not isinstance(found, (Problem, RopeInput)):
        takes_frames = "frames" in inspect.signature(found).parameters
        given = {"frames": frames} if takes_frames and frames is not None else {}
        found = call_user_code(f"problem: {where}", found, **given, **parameters)
        frames = None if takes_frames else frames
    if isinstance(found, RopeInput):
        return found.problem(**({} if frames is None else {"frames": frames}))
    if not isinstance(found, Problem):
        raise bad_value(
            "problem",
            where,
            f"the name of a Problem, a rope, or a function that returns one, and this is a "
            f"{type(found).__name__}",
            "build a Problem, as in problem = Problem(rhs, y0, ts)",
        )
    if frames is not None:
        raise bad_value(
            "frames",
            frames,
            f"none with {where!r}, whose sample times are fixed",
            "leave it out, or make the problem in a function with a parameter `frames`",
        )
    return found
