"""Many problems that differ in their numbers only."""

from __future__ import annotations

import functools
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, overload

import jax
import numpy as np

from ropeode.arrays import float64_only
from ropeode.display import Displayed
from ropeode.errors import InputError
from ropeode.problems import checks
from ropeode.problems.problem import Problem
from ropeode.problems.state_structure import is_tree
from ropeode.validation import bad_value, not_traced, unknown

if TYPE_CHECKING:
    from ropeode.problems.rope_input import RopeInput

# Field of a rope, and the name of it in the arguments of its right-hand side.
_ARGUMENTS = {
    "node_mass": "mass",
    "stiffness": "stiffness",
    "damping": "damping",
    "gravity": "gravity",
}
_VELOCITY = "initial_velocity"


class Numbers(NamedTuple):
    """The numbers of some members; the last axis of each array counts them.

    Fields:
        y0: initial states, ``(*state, members)``.
        args: arguments of the right-hand side; each leaf ``(..., members)``.
    """

    y0: np.ndarray
    args: Any


class Ensemble(Displayed, Sequence[Problem]):
    """Problems that share functions, shapes, sample times and jump times; each is a member.

    Made by `Ensemble.of` from problems, or, which is much faster, by `Rope.ensemble` from arrays
    of parameters or by `Ensemble.varying` from arrays of initial states or arguments. A member
    is a `Problem` like any other: ``ensemble[3]``.

    Arguments:
        first: the first member.
        size: the number of members.
        numbers: ``numbers(start, stop)`` gives the `Numbers` of these members. Called for some
            at a time, so that an ensemble takes no more memory than the arrays behind it.
        member: gives a member by its index.
        built_apart: those members that may differ in what makes a stepper refuse them; the
            others are like the first.

    Examples:
        >>> from ropeode import Rope
        >>> ropes = Rope(num_nodes=4).ensemble(frames=3, damping=[0.0, 0.01, 0.1])
        >>> len(ropes), ropes[0].name
        (3, 'rope')
        >>> ropes
        <Ensemble: 3 problems; the first is rope, 4 nodes, damping 0, 3 frames>
    """

    def __init__(
        self,
        first: Problem,
        size: int,
        numbers: Callable[[int, int], Numbers],
        member: Callable[[int], Problem],
        built_apart: Sequence[Problem] = (),
    ):
        self.first = first
        self.built_apart = built_apart
        self._size, self._numbers, self._member = size, numbers, member

    @classmethod
    def of(cls, problems: Sequence[Problem]) -> Ensemble:
        """An ensemble of problems that exist already.

        Raises:
            InputError: there is none, or they differ in more than their numbers.

        Examples:
            >>> from ropeode import Ensemble, Rope
            >>> Ensemble.of([Rope(num_nodes=4, damping=d).problem(frames=3) for d in (0.01, 0.1)])
            <Ensemble: 2 problems; the first is rope, 4 nodes, damping 0.01, 3 frames>
        """
        members = list(problems)
        if not members:
            raise bad_value("problems", members, "at least one problem", "give one")
        first = members[0]
        for index, each in enumerate(members):
            if difference := _difference(each, first):
                raise bad_value(
                    "problems",
                    f"{first.name!r} and, at index {index}, {each.name!r}",
                    f"problems of one family (these differ in their {difference})",
                    "run them one by one, or in an ensemble for each family",
                )

        numbers = functools.partial(_stacked, members)
        return cls(first, len(members), numbers, members.__getitem__, members)

    @classmethod
    def varying(
        cls,
        problem: Problem,
        *,
        y0: Any = None,
        args: Any = None,
        parameters: Callable[[int], Mapping[str, Any]] | None = None,
    ) -> Ensemble:
        """An ensemble of a problem with other numbers.

        The right-hand side is tried on the first member only.

        Arguments:
            problem: whose functions and sample times all members have.
            y0: initial states, ``(members, *state)``, or a pytree of such arrays like the state;
                by default that of `problem`.
            args: arguments with one more axis in front of each array, ``(members, ...)``; by
                default those of `problem`.
            parameters: gives the `parameters` of a member, by its index; by default none.

        Raises:
            InputError: an array has another shape or numbers that are not finite, or their
                lengths differ, or there is none.

        Examples:
            >>> from ropeode import Ensemble, Rope
            >>> problem = Rope(num_nodes=4).problem(frames=3)
            >>> Ensemble.varying(problem, y0=[problem.y0, problem.y0 + 1e-6, problem.y0 + 1e-3])
            <Ensemble: 3 problems; the first is rope, 3 frames>
        """
        not_traced("y0 and args", (y0, args))
        varied: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
        own, structure = jax.tree.flatten(problem.args)
        if y0 is not None:
            if problem.structure is not None and is_tree(y0):
                y0 = problem.structure.ravel("y0", jax.tree.map(np.asarray, y0), axes=1)
            varied["y0"] = [(np.asarray(y0), problem.y0)]
        if args is not None:
            try:
                # Lists in place of arrays are no structure of their own.
                arrays = structure.flatten_up_to(args)
            except ValueError:
                others = jax.tree.structure(args)
                fix = "name them alike"
                raise bad_value("args", others, f"arguments like {structure}", fix) from None
            varied["args"] = [(np.asarray(new), old) for new, old in zip(arrays, own, strict=True)]
        size = _check_arrays(varied)

        def of_all(name: str, values: Sequence[np.ndarray]) -> list[np.ndarray]:
            """What varies, in the type of the problem's own; what does not, once for each."""
            if name in varied:
                return [new.astype(old.dtype, copy=False) for new, old in varied[name]]
            return [np.broadcast_to(value, (size, *np.shape(value))) for value in values]

        (states,) = of_all("y0", [problem.y0])
        values = jax.tree.unflatten(structure, of_all("args", own))

        everything = Numbers(states, values)
        member = functools.partial(_one_of, problem, everything, parameters)
        start = member(0)
        checks.right_hand_side(start.rhs, start.ts[0], start.y0, start.args)
        return cls(start, size, functools.partial(_some_of, everything), member)

    def _contents(self) -> Any:
        """The first member, and the numbers of all."""
        return self.first, self.numbers(0, self._size)

    def numbers(self, start: int, stop: int) -> Numbers:
        """The numbers of the members from `start` up to, and without, `stop`."""
        return self._numbers(start, stop)

    def __len__(self) -> int:
        return self._size

    @overload
    def __getitem__(self, index: int) -> Problem: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Problem]: ...
    def __getitem__(self, index: int | slice) -> Problem | Sequence[Problem]:
        """A member, or a list of them."""
        if isinstance(index, slice):
            return [self._member(each) for each in range(*index.indices(self._size))]
        if not -self._size <= index < self._size:
            raise IndexError(f"member {index} of an ensemble of {self._size}")
        return self._member(index % self._size)

    def __iter__(self) -> Iterator[Problem]:
        return map(self._member, range(self._size))


# Not inside `Ensemble`, whose pickle names them.
def _stacked(members: Sequence[Problem], start: int, stop: int) -> Numbers:
    some = members[start:stop]
    return Numbers(
        np.stack([each.y0 for each in some], axis=-1),
        jax.tree.map(lambda *leaves: np.stack(leaves, axis=-1), *(each.args for each in some)),
    )


def _some_of(everything: Numbers, start: int, stop: int) -> Numbers:
    return jax.tree.map(lambda array: np.moveaxis(array[start:stop], 0, -1), everything)


def _one_of(
    problem: Problem,
    everything: Numbers,
    parameters: Callable[[int], Mapping[str, Any]] | None,
    index: int,
) -> Problem:
    y0, args = jax.tree.map(lambda array: array[index], everything)
    return problem.with_numbers(y0, args, parameters(index) if parameters else {})


def same_problem(problem: Problem, other: Problem) -> bool:
    """Whether two problems have the same functions and numbers.

    Raises:
        InputError: one of them has no equations.
    """
    if problem is other:
        return True
    for each in (problem, other):
        each.require_equations()
    numbers = [jax.tree.leaves((each.y0, each.args)) for each in (problem, other)]
    # Declared jumps say how a solution is computed, and not which one it is.
    same = family_of(problem)[:-1] == family_of(other)[:-1]
    return same and all(map(np.array_equal, *numbers))


def family_of(problem: Problem) -> tuple[Hashable, ...]:
    """What the members of an ensemble share: equal where `Ensemble.of` takes two together."""
    shapes = _shapes((problem.y0, problem.args))
    times = problem.ts.tobytes(), problem.jump_times
    return problem.rhs, problem.mechanics, problem.structure, shapes, *times


def _difference(problem: Problem, first: Problem) -> str | None:
    """In what, besides numbers, a problem differs from the first; None if in nothing."""
    equations = "right-hand sides"
    names = (equations, equations, "states", "shapes", "sample times", "jump times")
    pairs = zip(names, family_of(problem), family_of(first), strict=True)
    return next((name for name, own, its in pairs if own != its), None)


def _check_arrays(varied: Mapping[str, list[tuple[np.ndarray, np.ndarray]]]) -> int:
    """The number of members.

    Arguments:
        varied: for each name, arrays, each with a member that shows its shape.

    Raises:
        InputError: as `Ensemble.varying` does.
    """
    lengths = {len(new) if new.ndim else 0 for pairs in varied.values() for new, _ in pairs}
    for name, pairs in varied.items():
        for new, old in pairs:
            float64_only(name, new)
            shape = np.shape(old)
            if new.ndim != len(shape) + 1 or new.shape[1:] != shape or new.dtype.kind not in "iufb":
                needed = ", ".join(("members", *map(str, shape)))
                raise bad_value(name, f"shape {new.shape}", f"numbers ({needed})", "reshape it")
            if not np.all(np.isfinite(new)):
                index = int(np.argwhere(~np.isfinite(new))[0][0])
                raise bad_value(name, new[index], "finite numbers", f"mend member {index}")
    if len(lengths) != 1 or not min(lengths):
        raise bad_value(
            " and ".join(varied) or "y0",
            f"{sorted(lengths)} members",
            "the same number of members in each, at least one",
            "give arrays of one length",
        )
    return lengths.pop()


def _shapes(tree: Any) -> Hashable:
    leaves, structure = jax.tree.flatten(tree)
    return structure, tuple((np.shape(leaf), np.asarray(leaf).dtype) for leaf in leaves)


def rope_ensemble(rope: RopeInput, frames: int, arrays: Mapping[str, Any]) -> Ensemble:
    """The ropes that `RopeInput.ensemble` describes; raises as it does."""
    own = type(rope).model_fields
    allowed = [name for name in (*_ARGUMENTS, _VELOCITY) if name in own]
    if wrong := [unknown("field", name, allowed) for name in arrays if name not in allowed]:
        raise InputError(wrong)
    values = {name: _members(name, array) for name, array in arrays.items()}
    lengths = {name: len(array) for name, array in values.items()}
    if len(set(lengths.values())) != 1:
        allowed_lengths = "arrays with as many members each, at least one array"
        raise bad_value("ensemble", lengths, allowed_lengths, "for example damping=[0.0, 0.1]")

    _check(rope, values)
    problem = _member(rope, values, 0).problem(frames)
    size = len(next(iter(values.values())))
    args = {
        name: np.broadcast_to(leaf, (size, *leaf.shape))
        for name, leaf in problem.args._asdict().items()
    }
    for field, name in _ARGUMENTS.items():
        if field in values:
            array = values[field]
            array = array[..., None] if field == "gravity" or array.ndim == 1 else array
            args[name] = np.broadcast_to(array, args[name].shape)
    y0 = None
    if _VELOCITY in values:
        velocity = values[_VELOCITY]
        rows = velocity[:, :, None] if velocity.ndim == 2 else np.moveaxis(velocity, 1, 2)
        y0 = np.repeat(problem.y0[None], size, axis=0)
        y0[:, 1] = rows * rope.free()
    return Ensemble.varying(
        problem,
        y0=y0,
        args=type(problem.args)(**args),
        parameters=functools.partial(_parameters, rope, values, problem.parameters),
    )


def _member(rope: RopeInput, values: Mapping[str, np.ndarray], index: int) -> RopeInput:
    return _with(rope, {name: array[index] for name, array in values.items()})


def _parameters(
    rope: RopeInput, values: Mapping[str, np.ndarray], common: Mapping[str, Any], index: int
) -> Mapping[str, Any]:
    return {**common, **_member(rope, values, index).model_dump(mode="json")}


def _members(name: str, array: Any) -> np.ndarray:
    try:
        values = np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.asarray(np.nan)
    if values.ndim == 0 or not len(values) or not np.all(np.isfinite(values)):
        raise bad_value(
            name,
            array,
            "an array of finite numbers, one entry along its first axis for each rope",
            f"for example {name}=[...]; what all ropes share belongs to the rope itself",
        )
    return values


def _check(rope: RopeInput, values: Mapping[str, np.ndarray]) -> None:
    """Raises:
    InputError: one line for each field with a value that a rope refuses.
    """
    if _VELOCITY in values and "stiffness" not in type(rope).model_fields:
        # Only each rope itself shows whether velocities stretch a link.
        every = range(len(values[_VELOCITY]))
        tried = [{name: array[index] for name, array in values.items()} for index in every]
    else:
        # A field's smallest and largest values show whether one is not allowed.
        tried = [
            {name: pick(array, axis=0) for name, array in values.items()}
            for pick in (np.min, np.max)
        ]
    for each in tried:
        _with(rope, each)


def _with(rope: RopeInput, changed: Mapping[str, np.ndarray]) -> RopeInput:
    """The rope with other values."""
    return type(rope)(
        **{**rope.model_dump(), **{name: value.tolist() for name, value in changed.items()}}
    )
