"""Problem factories: they build the problems of a sweep from parameters."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import json
from collections.abc import Container, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.errors import InputError
from ropeode.problems import (
    PROBLEMS,
    ROPES,
    Problem,
    as_problem,
    file_and_name,
    is_function,
    problem_in_file,
)
from ropeode.problems.rope import Rope
from ropeode.study import rope_of
from ropeode.sweep.design.columns import COLUMNS, Column
from ropeode.sweep.design.content_hash import file_digest
from ropeode.validation import bad_value, check_whole, complaint, unknown

# The product of four numbers of this size still fits into a float64.
_MODERATE = 1e60
# Stands for the default of a parameter that has none.
_REQUIRED = inspect.Parameter.empty
_TYPES: Mapping[type, Any] = {bool: "bool", int: "int64", float: "double", str: "string"}


@dataclasses.dataclass(frozen=True)
class ProblemFactory:
    """Builds the problems of the library that differ in their parameters, `frames` among them.

    Ropes and problems in users' files have factories of their own, derived from this one.

    Arguments:
        name: of the problem, as in the spec.
    """

    name: str

    @functools.cached_property
    def defaults(self) -> Mapping[str, Any]:
        """The parameters and their defaults."""
        return _parameters(PROBLEMS[self.name])

    def build(self, parameters: Mapping[str, Any]) -> Problem:
        """The problem with these parameters.

        Raises:
            InputError: one line for each parameter that cannot be used.
            UserCodeError: the user's code raised.
        """
        return PROBLEMS[self.name](**parameters)

    @property
    def identity(self) -> Mapping[str, str]:
        """What distinguishes the problem from others, whatever its parameters are."""
        return {"problem": self.name}

    def complete(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """All parameters as plain JSON values: the same however the given ones are written.

        They are not checked; where one cannot be used, the problem cannot be built.
        """
        defaults = {name: value for name, value in self.defaults.items() if value is not _REQUIRED}
        return {
            name: _typed_like(value, self.defaults.get(name))
            for name, value in {**defaults, **given}.items()
        }

    def check(self, parameters: Mapping[str, Any]) -> None:
        """See that a problem can be built, as cheaply as possible; raises as `build` does."""
        self.build(parameters)

    def check_names(self, given: Mapping[str, Any], table: str) -> None:
        """See that parameters exist.

        Arguments:
            given: by name.
            table: of the spec, that contains them.

        Raises:
            InputError: one does not exist.
        """
        kind = f"{table} parameter of {self.name!r}"
        names = [name for name in given if name not in self.defaults]
        if names:
            raise InputError(unknown(kind, name, self.defaults) for name in names)

    def check_required(self, given: Container[str]) -> None:
        """See that every parameter without a default has a value.

        Arguments:
            given: names of parameters that have one.

        Raises:
            InputError: one has none.
        """
        required = [name for name, default in self.defaults.items() if default is _REQUIRED]
        allowed = f"a value: {self.name!r} has no default for it"
        if missing := [name for name in required if name not in given]:
            raise InputError(complaint(name, None, allowed, "add it") for name in missing)

    def columns(self, sample: Mapping[str, Any]) -> dict[str, Column]:
        """A column for each parameter; JSON unless the default is one number or word.

        Arguments:
            sample: parameters of a problem; they give the type where there is no default.
        """
        typical = {
            name: sample[name] if default in (_REQUIRED, None) else default
            for name, default in self.defaults.items()
        }
        return {
            name: Column(_TYPES.get(type(value), "string"), f"parameter of {self.name}")
            for name, value in typical.items()
        }


class RopeFactory(ProblemFactory):
    """Builds the ropes of one kind."""

    @functools.cached_property
    def defaults(self) -> Mapping[str, Any]:
        """See `ProblemFactory`."""
        return {"frames": 20, **ROPES[self.name]().model_dump(mode="json")}

    def complete(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """See `ProblemFactory`."""
        try:
            frames, rope = self._checked(given)
        except InputError:
            return super().complete(given)
        return {"frames": frames, **rope.model_dump(mode="json")}

    def check(self, parameters: Mapping[str, Any]) -> None:
        """See `ProblemFactory`."""
        self._checked(parameters)

    def _checked(self, given: Mapping[str, Any]) -> tuple[int, Any]:
        rest = {**given}
        frames = check_whole("frames", rest.pop("frames", 20), at_least=1, example="20")
        return frames, rope_of(self.name, rest)

    def build(self, parameters: Mapping[str, Any]) -> Problem:
        """See `ProblemFactory`."""
        frames, rope = self._checked(parameters)
        y0, args = rope.y0(), rope.args()
        if rope.num_nodes < 2 or not _moderate(y0, *args):
            return rope.problem(frames)
        # All ropes of a shape share their equations, and trying these takes milliseconds.
        return _rope_of_shape(self.name, *y0.shape[1:], frames).with_numbers(
            y0,
            type(args)(*(np.array(each, dtype=np.float64) for each in args)),
            {"kind": self.name, "frames": frames, **rope.model_dump(mode="json")},
        )


@functools.lru_cache(maxsize=64)
def _rope_of_shape(kind: str, dim: int, num_nodes: int, frames: int) -> Problem:
    """A rope of a shape, with numbers that do not matter."""
    rope = ROPES[kind](start=(0.0,) * dim, end=(1.0,) * dim, num_nodes=num_nodes)
    return rope.problem(frames)


def _moderate(*numbers: np.ndarray) -> bool:
    """Whether no product of a few of the numbers or their inverses overflows."""
    sizes = np.abs(np.concatenate([np.ravel(each) for each in numbers]))
    return bool(np.all((sizes == 0) | ((sizes > 1 / _MODERATE) & (sizes < _MODERATE))))


@dataclasses.dataclass(frozen=True)
class FileFactory(ProblemFactory):
    """Builds the problem that a name in a user's Python file stands for.

    Arguments:
        folder: from which the file name starts.
        digest: sha256 of the file.
    """

    folder: Path
    digest: str

    @property
    def identity(self) -> Mapping[str, str]:
        """See `ProblemFactory`; the contents of the file count, and not its place."""
        return {"name": self.name.rpartition(":")[2], "file": self.digest}

    @functools.cached_property
    def _definition(self) -> Any:
        definition = problem_in_file(self.name, self.folder)
        if _digest(self.name, self.folder) != self.digest:
            allowed = "the file as it was when the sweep was read"
            fix = "do not change it while the sweep runs"
            raise bad_value("problem", self.name, allowed, fix)
        return definition

    @functools.cached_property
    def defaults(self) -> Mapping[str, Any]:
        """See `ProblemFactory`."""
        if isinstance(self._definition, Rope):
            return {"frames": 20}
        return _parameters(self._definition) if is_function(self._definition) else {}

    def build(self, parameters: Mapping[str, Any]) -> Problem:
        """See `ProblemFactory`."""
        rest = {**parameters}
        return as_problem(self._definition, self.name, rest.pop("frames", None), **rest)


# Cached, so that a file's functions, and thus their compiled programs, stay the same.
_file_factory = functools.lru_cache(maxsize=4)(FileFactory)


def problem_factory(name: str, folder: Path) -> ProblemFactory:
    """The factory of a problem by its name.

    Arguments:
        name: of the library, or FILE.py:NAME.
        folder: from which relative file names start.

    Raises:
        InputError: there is none, or one of its parameters is named like a column.
        UserCodeError: the user's file raised.
    """
    if ":" in name or name.endswith(".py"):
        factory: ProblemFactory = _file_factory(name, folder, _digest(name, folder))
    elif name in PROBLEMS:
        factory = RopeFactory(name) if name in ROPES else ProblemFactory(name)
    else:
        raise InputError(unknown("problem", name, [*PROBLEMS, "FILE.py:NAME"]))
    if clashes := [each for each in factory.defaults if each in COLUMNS]:
        allowed = "parameters that are not named like a column of the sweep's table"
        raise bad_value("problem", clashes[0], allowed, f"rename it in {name}")
    return factory


def _digest(name: str, folder: Path) -> str:
    path, _ = file_and_name(name, folder)
    return file_digest("problem", path)


def column_values(columns: Mapping[str, Column], parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters by column; None where a list replaces a single number.

    Arguments:
        columns: as `ProblemFactory.columns` returns them.
        parameters: of a problem.
    """
    values: dict[str, Any] = {}
    for name, column in columns.items():
        value = parameters.get(name)
        if column.type == "string":
            values[name] = value if isinstance(value, str) else json.dumps(value)
        else:
            values[name] = value if _TYPES.get(type(value)) == column.type else None
    return values


def _parameters(function: Any) -> dict[str, Any]:
    """The named parameters of a function and their defaults, lists as lists."""
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return {
        each.name: list(each.default) if isinstance(each.default, tuple) else each.default
        for each in inspect.signature(function).parameters.values()
        if each.kind in kinds
    }


def _typed_like(value: Any, default: Any) -> Any:
    """A value with its numbers of the same type as the default's."""
    if isinstance(value, (list, tuple)):
        each = default[0] if isinstance(default, list) and default else default
        return [_typed_like(entry, each) for entry in value]
    if isinstance(default, float) and type(value) is int:
        return float(value)
    if type(default) is int and isinstance(value, float) and value.is_integer():
        return int(value)
    return value
