"""What makes the problems of a sweep from their parameters."""

from __future__ import annotations

import abc
import dataclasses
import functools
import hashlib
import inspect
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.errors import InputError
from ropeode.files import read_bytes
from ropeode.problems.files import as_problem, file_and_name, named_in_file
from ropeode.problems.library import PROBLEMS, ROPES
from ropeode.problems.problem import Problem
from ropeode.problems.rope import Rope
from ropeode.study.spec import rope_of
from ropeode.sweep.design.columns import COLUMNS, Column
from ropeode.validation import check_whole, complaint, unknown

# Four numbers of this size make a product that float64 holds.
_MODERATE = 1e60
# A parameter that has no default.
_NEEDED = inspect.Parameter.empty
_TYPES: Mapping[type, Any] = {bool: "bool", int: "int64", float: "double", str: "string"}


@dataclasses.dataclass(frozen=True)
class Maker(abc.ABC):
    """Makes problems that differ in their parameters, `frames` among them.

    Arguments:
        name: of the problem, as a spec says it.
    """

    name: str

    @property
    @abc.abstractmethod
    def defaults(self) -> Mapping[str, Any]:
        """The parameters and their defaults."""

    @property
    def needed(self) -> list[str]:
        """The parameters that have no default."""
        return [name for name, default in self.defaults.items() if default is _NEEDED]

    @property
    def identity(self) -> Mapping[str, str]:
        """What tells this problem from others, whatever its parameters are."""
        return {"problem": self.name}

    def normal(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """All parameters as plain JSON values, in one form however they were written.

        Raises:
            InputError: one line for each that cannot be used, where that is seen at once.
        """
        return self.as_given(given)

    def as_given(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """The same, whether the parameters can be used or not."""
        known = {name: value for name, value in self.defaults.items() if value is not _NEEDED}
        return {
            name: _alike(value, self.defaults.get(name))
            for name, value in {**known, **given}.items()
        }

    @abc.abstractmethod
    def build(self, parameters: Mapping[str, Any]) -> Problem:
        """The problem.

        Raises:
            InputError: one line for each parameter that cannot be used.
            UserCodeError: the user's code raised.
        """

    def check(self, parameters: Mapping[str, Any]) -> None:
        """See that a problem can be built, as cheaply as can be; raises as `build` does."""
        self.build(parameters)

    def check_names(self, given: Mapping[str, Any], where: str) -> None:
        """See that parameters exist.

        Arguments:
            given: by name.
            where: what they were given in.

        Raises:
            InputError: one does not.
        """
        faults = [
            unknown(f"{where} parameter of {self.name!r}", name, self.defaults)
            for name in given
            if name not in self.defaults
        ]
        if faults:
            raise InputError(faults)

    def columns(self, sample: Mapping[str, Any]) -> dict[str, Column]:
        """A column for each parameter; what is no single number or word by default is JSON.

        Arguments:
            sample: parameters of a problem, which tell the type where there is no default.
        """
        return {
            name: Column(
                _TYPES.get(type(sample[name] if default in (_NEEDED, None) else default), "string"),
                f"parameter of {self.name}",
            )
            for name, default in self.defaults.items()
        }


class RopeMaker(Maker):
    """Makes the ropes of one kind."""

    @functools.cached_property
    def defaults(self) -> Mapping[str, Any]:
        """See `Maker`."""
        return {"frames": 20, **ROPES[self.name]().model_dump(mode="json")}

    def normal(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """See `Maker`."""
        rest = {**given}
        frames = check_whole("frames", rest.pop("frames", 20), at_least=1, example="20")
        return {"frames": frames, **rope_of(self.name, rest).model_dump(mode="json")}

    def check(self, parameters: Mapping[str, Any]) -> None:
        """See `Maker`."""
        self.normal(parameters)

    def build(self, parameters: Mapping[str, Any]) -> Problem:
        """See `Maker`."""
        rest = {**parameters}
        frames = rest.pop("frames", 20)
        rope = rope_of(self.name, rest)
        nodes = rope.nodes()
        y0, args = np.stack([nodes.x0, nodes.v0]), rope.args(nodes)
        if rope.num_nodes < 2 or not _moderate(y0, *args):
            return rope.problem(frames)
        # The equations of all ropes of a shape are the same, and trying them takes milliseconds.
        return _shaped(self.name, *nodes.x0.shape, frames).with_numbers(
            y0,
            type(args)(*(np.array(each, dtype=np.float64) for each in args)),
            {"kind": self.name, "frames": frames, **rope.model_dump(mode="json")},
        )


@functools.lru_cache(maxsize=64)
def _shaped(kind: str, dim: int, num_nodes: int, frames: int) -> Problem:
    """A rope of a shape, whatever its numbers are."""
    rope = ROPES[kind](start=(0.0,) * dim, end=(1.0,) * dim, num_nodes=num_nodes)
    return rope.problem(frames)


def _moderate(*numbers: np.ndarray) -> bool:
    """Whether no product of a few of the numbers or their inverses overflows."""
    sizes = np.abs(np.concatenate([np.ravel(each) for each in numbers]))
    return bool(np.all((sizes == 0) | ((sizes > 1 / _MODERATE) & (sizes < _MODERATE))))


class LibraryMaker(Maker):
    """Makes another problem of the library."""

    @functools.cached_property
    def defaults(self) -> Mapping[str, Any]:
        """See `Maker`."""
        return _parameters(PROBLEMS[self.name])

    def build(self, parameters: Mapping[str, Any]) -> Problem:
        """See `Maker`."""
        return PROBLEMS[self.name](**parameters)


@dataclasses.dataclass(frozen=True)
class FileMaker(Maker):
    """Makes what a name in a user's Python file stands for.

    Arguments:
        folder: that the file name starts from.
        digest: sha256 of the file.
    """

    folder: Path
    digest: str

    @property
    def identity(self) -> Mapping[str, str]:
        """See `Maker`; what counts is what stands in the file, and not where the file is."""
        return {"name": self.name.rpartition(":")[2], "file": self.digest}

    @functools.cached_property
    def _found(self) -> Any:
        found = named_in_file(self.name, self.folder)
        if digest_of(self.name, self.folder) != self.digest:
            raise InputError(
                complaint(
                    "problem",
                    self.name,
                    "the file as it was when the sweep was read",
                    "do not change it while the sweep runs",
                )
            )
        return found

    @functools.cached_property
    def defaults(self) -> Mapping[str, Any]:
        """See `Maker`."""
        found = self._found
        if isinstance(found, Rope):
            return {"frames": 20}
        if isinstance(found, Problem) or not callable(found):
            return {}
        return _parameters(found)

    def build(self, parameters: Mapping[str, Any]) -> Problem:
        """See `Maker`."""
        rest = {**parameters}
        return as_problem(self._found, self.name, rest.pop("frames", None), **rest)


@functools.lru_cache(maxsize=4)
def _file_maker(name: str, folder: Path, digest: str) -> FileMaker:
    """That of a file as it is now; kept, so that what its functions compile to is kept too."""
    return FileMaker(name, folder, digest)


def maker_for(name: str, folder: Path) -> Maker:
    """The maker of a problem by its name.

    Arguments:
        name: of the library, or FILE.py:NAME.
        folder: that a relative file name starts from.

    Raises:
        InputError: there is none, or one of its parameters is named like a column.
        UserCodeError: the user's file raised.
    """
    if ":" in name or name.endswith(".py"):
        maker: Maker = _file_maker(name, folder, digest_of(name, folder))
    elif name in ROPES:
        maker = RopeMaker(name)
    elif name in PROBLEMS:
        maker = LibraryMaker(name)
    else:
        raise InputError(unknown("problem", name, [*PROBLEMS, "FILE.py:NAME"]))
    if taken := [each for each in maker.defaults if each in COLUMNS]:
        allowed = "parameters that are not named like a column of the sweep's table"
        raise InputError(complaint("problem", taken[0], allowed, f"rename it in {name}"))
    return maker


def digest_of(name: str, folder: Path) -> str:
    """The sha256 of a user's problem file.

    Raises:
        InputError: it cannot be read.
    """
    path, _ = file_and_name(name, folder)
    return hashlib.sha256(read_bytes("problem", path)).hexdigest()


def column_values(columns: Mapping[str, Column], parameters: Mapping[str, Any]) -> dict[str, Any]:
    """What stands in the columns of parameters; none where a list stands for a single number.

    Arguments:
        columns: as `Maker.columns` gives them.
        parameters: of a problem.
    """
    found: dict[str, Any] = {}
    for name, column in columns.items():
        value = parameters.get(name)
        if column.type == "string":
            found[name] = value if isinstance(value, str) else json.dumps(value)
        else:
            found[name] = value if _TYPES.get(type(value)) == column.type else None
    return found


def _parameters(function: Any) -> dict[str, Any]:
    """The named parameters of a function and their defaults, lists as lists."""
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return {
        each.name: list(each.default) if isinstance(each.default, tuple) else each.default
        for each in inspect.signature(function).parameters.values()
        if each.kind in kinds
    }


def _alike(value: Any, default: Any) -> Any:
    """A value with its numbers of the type that the default's numbers have."""
    if isinstance(value, (list, tuple)):
        each = default[0] if isinstance(default, list) and default else default
        return [_alike(entry, each) for entry in value]
    if isinstance(default, float) and type(value) is int:
        return float(value)
    if type(default) is int and isinstance(value, float) and value.is_integer():
        return int(value)
    return value
