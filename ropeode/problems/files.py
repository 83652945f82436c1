"""Problems by name: from the library, or from a user's own Python file."""

from __future__ import annotations

import ast
import builtins
import hashlib
import importlib.util
import inspect
import os
import sys
import types
from collections.abc import Iterator
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.errors import InputError, call_user_code, streams_kept
from ropeode.files import read_text, refuse_code
from ropeode.problems.problem import Problem
from ropeode.problems.rope_input import RopeInput
from ropeode.problems.scipy_form import sample_times_of
from ropeode.problems.signatures import TIMES, refuse_others, required
from ropeode.validation import bad_value, unknown

# What may stand beside a right-hand side in a file.
_GIVEN = ("y0", "t_span", "ts", "args")
# The packages of what user's files import from their folders begin so.
_BESIDE = "ropeode_beside_"


def load_problem(where: str, *, folder: Path | None = None, frames: int | None = None) -> Problem:
    """A problem of the library by its name, or of a file as ``FILE.py:NAME``.

    In a file, NAME is a `Problem`, a rope, a function that returns one of them (if it has a
    parameter `frames`, it is given that), or a right-hand side; see `problem_in_file`.

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
        # Not above: commands about a rope need no other problem.
        from ropeode.problems.library import PROBLEMS

        if where not in PROBLEMS:
            raise InputError(unknown("problem", where, [*PROBLEMS, "FILE.py:NAME"]))
        return PROBLEMS[where](**({} if frames is None else {"frames": frames}))

    return as_problem(problem_in_file(where, folder), where, frames)


def problem_in_file(where: str, folder: Path | None = None) -> Any:
    """What `as_problem` makes a problem of; arguments and exceptions are those of `named_in_file`.

    A right-hand side, ``fun(t, y, *args)`` in NumPy as SciPy's solvers take it or ``rhs(t, y,
    args)`` in JAX, becomes a function that returns its problem. What else that needs are names of
    the file: `y0`, `t_span` (or sample times `ts`), and `args` where it takes more.
    """
    found = named_in_file(where, folder)
    parameters = (required(found) if is_function(found) else None) or []
    beside = vars(sys.modules["ropeode_user_problem"])
    times = next((name for name in ("ts", "t_span") if name in beside), "t_span")
    named = {*TIMES} & {*parameters[:2]} or {"y0", times} <= {*beside}
    if len(parameters) < 2 or not named:
        return found
    refuse_others({name: beside[name] for name in ("event", "events") if name in beside}, _GIVEN)
    if missing := [name for name in ("y0", times) if name not in beside]:
        lines = {"y0": "y0 = [1.0, 0.0]", "t_span": "t_span = (0.0, 10.0)"}
        raise bad_value(
            "problem",
            where,
            f"a right-hand side of ({', '.join(parameters)}) in a file that has y0 and t_span too; "
            f"this one has no {' and no '.join(missing)}",
            " and ".join(f"add the line `{lines[name]}`" for name in missing),
        )
    in_jax = parameters[2:] == ["args"]

    def problem(frames: int | None = None) -> Problem:
        given = found, beside[times], beside["y0"], beside.get("args")
        if not in_jax:
            return Problem.from_scipy(*given, frames=frames)
        rhs, span, y0, args = given
        return Problem(rhs, y0, sample_times_of(span, frames), args, name=found.__name__)

    # Sample times do not depend on a number of frames.
    return problem if np.size(beside[times]) == 2 else lambda: problem()


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
        if not public:
            allowed = "the name of something in the file, which defines nothing"
            raise bad_value(what, where, allowed, f"define {name} in it")
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
        InputError: there is no such file, or it is no Python file, or no code may be run.
        UserCodeError: the file raised.
    """
    refuse_code(what, path)
    return names_in_text(read_text(what, path), path, what)


def names_in_text(text: str, path: Path, what: str) -> dict[str, Any]:
    """All names of a Python file with this text, which is run.

    Arguments:
        text: of the file, which may have another one by now.
        path: of the file.
        what: it holds, for messages.

    Raises:
        InputError: it is no Python file, or no code may be run.
        UserCodeError: the text raised.
    """
    refuse_code(what, path)
    spec = importlib.util.spec_from_file_location(f"ropeode_user_{what}", path)
    if spec is None or spec.loader is None:
        raise bad_value(what, str(path), "a Python file, *.py", "rename it")
    module = importlib.util.module_from_spec(spec)
    vars(module)["__builtins__"] = _Beside(path.resolve().parent).fresh()
    # Dataclasses and pickles look their module up by its name.
    sys.modules[spec.name] = module
    # Not by Python's loader, which takes a compiled file of the same second and size for this one.
    call_user_code(f"{what}: the file {path}", _run, text, path, vars(module))
    return vars(module)


def _run(text: str | bytes, path: Path, names: dict[str, Any]) -> None:
    with streams_kept():
        exec(compile(text, str(path), "exec", dont_inherit=True), names)


class _Beside:
    """What a user's file imports from its own folder, and no other file does.

    The folder is not on `sys.path`: another user's file would find its modules there, and so
    would ropeode. They are submodules of a package of this folder, and the `import` of the files
    in it, at any time, is one that looks for them there first.

    Arguments:
        folder: of the files.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = str(folder)
        self._package = f"{_BESIDE}{hashlib.sha256(os.fsencode(folder)).hexdigest()[:16]}"
        self._known: dict[str, bool] = {}

    def fresh(self) -> dict[str, Any]:
        """The built-in names of a file whose modules are read again, and of these."""
        for name in [*sys.modules]:
            if name.partition(".")[0] == self._package:
                del sys.modules[name]
        importlib.invalidate_caches()
        package = sys.modules[self._package] = types.ModuleType(self._package)
        package.__path__ = [self._folder]
        names = vars(package)["__builtins__"] = {**vars(builtins), "__import__": self._import}
        return names

    def _import(
        self, name: str, names: Any = None, local: Any = None, wanted: Any = (), level: int = 0
    ) -> Any:
        """As the built-in function `__import__` does it."""
        first = name.partition(".")[0]
        if level or not self._is_there(first):
            return builtins.__import__(name, names, local, wanted, level)
        found = builtins.__import__(f"{self._package}.{name}", None, None, wanted or ("",))
        return found if wanted else sys.modules[f"{self._package}.{first}"]

    def _is_there(self, first: str) -> bool:
        if first not in self._known:
            of_others = first == "ropeode" or first in sys.stdlib_module_names
            spec = None if of_others else PathFinder.find_spec(first, [self._folder])
            # A folder without `__init__.py` is as likely one of data.
            self._known[first] = spec is not None and spec.origin is not None
        return self._known[first] and Path(self._folder) not in _apart


class _Loader(SourceFileLoader):
    """Runs a module beside a user's file."""

    def exec_module(self, module: types.ModuleType) -> None:
        """It imports what lies there as well."""
        package = sys.modules[module.__name__.partition(".")[0]]
        vars(module)["__builtins__"] = vars(package)["__builtins__"]
        _run(self.get_data(self.path), Path(self.path), vars(module))


class _Finder:
    """Finds the modules of the packages of `_Beside`."""

    @staticmethod
    def find_spec(fullname: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        """As Python asks each finder in `sys.meta_path`."""
        spec = PathFinder.find_spec(fullname, path) if fullname.startswith(_BESIDE) else None
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _Loader(fullname, spec.loader.path)
        return spec


sys.meta_path.insert(0, _Finder)
_apart: set[Path] = set()


def keep_apart(folder: Path) -> None:
    """Let no file in a folder import another one there: they are of different people."""
    _apart.add(folder.resolve())


def file_and_imports(path: Path) -> Iterator[Path]:
    """A Python file and all that it names in imports from its own folder, and these name."""
    waiting, seen = [path], set()
    while waiting:
        seen.add(path := waiting.pop())
        yield path
        try:
            tree = ast.parse(path.read_bytes()) if path.suffix == ".py" else ast.Module([], [])
        except (OSError, SyntaxError, ValueError, RecursionError, MemoryError):
            # It is told when it is run.
            continue
        for node in ast.walk(tree):
            names = [each.name for each in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            for name in names:
                whole = path.parent.joinpath(*name.split("."))
                beside = [whole.with_suffix(".py"), whole / "__init__.py"]
                waiting += [each for each in beside if each.is_file() and each not in seen]


def is_function(found: Any) -> bool:
    """Whether a name in a file stands for a function, and for no problem."""
    return callable(found) and not isinstance(found, (Problem, RopeInput))


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
    if is_function(found):
        if needed := [name for name in required(found) or () if name not in parameters]:
            raise bad_value(
                "problem",
                f"{where}, a function of ({', '.join(needed)})",
                "one that returns a problem and needs no arguments, or a right-hand side of (t, y)",
                "give its parameters defaults, or name them t and y, with y0 and t_span beside it",
            )
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
