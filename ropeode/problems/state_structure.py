"""States that are pytrees: dicts, tuples, named tuples, registered dataclasses of arrays.

Solvers and norms see one flat array. Only the user's own functions see the pytree.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import numbers
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from ropeode.problems.signatures import check_signature
from ropeode.validation import bad_value, listed

_SAME = "return the same structure with the same shapes, as in jax.tree.map"
# A message names so many parts.
_MOST_PARTS = 6


def is_tree(state: Any) -> bool:
    """Whether a state is a pytree of arrays, and not one array.

    Lists, and tuples of numbers, are arrays, as for NumPy.
    """
    if isinstance(state, list) or (type(state) is tuple and all(map(_numbers, state))):
        return False
    try:
        return not jax.tree_util.all_leaves([state])
    except ValueError:
        return True


def _numbers(entry: Any) -> bool:
    return isinstance(entry, numbers.Number) or (
        type(entry) in (list, tuple) and all(map(_numbers, entry))
    )


@dataclasses.dataclass(frozen=True)
class StateStructure:
    """How the arrays of a pytree lie in a flat state.

    Arguments:
        tree: of the pytree.
        shapes: of its arrays.
    """

    tree: Any
    shapes: tuple[tuple[int, ...], ...]

    @classmethod
    def of(cls, name: str, state: Any, leaf_array: Callable[[str, Any], np.ndarray]) -> Any:
        """The structure of a state, and the state as a flat array.

        Arguments:
            name: of the state, for messages.
            state: a pytree.
            leaf_array: ``leaf_array(name, leaf)`` checks a leaf and returns it as an array.

        Raises:
            InputError: it has no leaves, or one of them is no array.
        """
        try:
            leaves, tree = jax.tree_util.tree_flatten_with_path(
                state, is_leaf=lambda each: not is_tree(each)
            )
        except ValueError as error:
            allowed = f"a pytree of JAX ({' '.join(str(error).split())})"
            raise bad_value(name, state, allowed, "name its parts by words") from error
        if not leaves:
            fix = "give it arrays, as in {'x': [1.0, 0.0], 'v': [0.0, 0.0]}"
            raise bad_value(name, state, "a pytree with arrays in it", fix)
        arrays = [leaf_array(name + jax.tree_util.keystr(path), leaf) for path, leaf in leaves]
        own = cls(tree, tuple(array.shape for array in arrays))
        return own, np.concatenate([array.reshape(-1) for array in arrays])

    def unravel(self, states: Any) -> Any:
        """The pytree of flat states ``(..., size)``; its arrays are ``(..., *shape)``."""
        ends = np.cumsum([math.prod(shape) for shape in self.shapes])
        leaves = [
            states[..., end - math.prod(shape) : end].reshape((*states.shape[:-1], *shape))
            for end, shape in zip(ends, self.shapes, strict=True)
        ]
        return self.tree.unflatten(leaves)

    def ravel(self, name: str, tree: Any, axes: int = 0, fix: str = _SAME) -> Any:
        """The opposite of `unravel`; in NumPy, unless JAX traces a part of it.

        Arguments:
            name: of what this is, for messages.
            tree: a pytree of this structure.
            axes: how many axes its arrays have in front of their shapes.
            fix: what to do where it is another one.

        Raises:
            InputError: it has another structure, or other shapes.
        """
        allowed = f"the structure of the state, {self}"
        try:
            leaves = self.tree.flatten_up_to(tree)
        except (ValueError, TypeError):
            raise bad_value(name, _described(tree), allowed, fix) from None
        traced = any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(leaves))
        library: Any = jnp if traced else np
        try:
            arrays = [library.asarray(leaf) for leaf in leaves]
        except (ValueError, TypeError):
            arrays = []
        if any(each.dtype.kind not in "iufb" for each in arrays):
            raise bad_value(name, tree, "real numbers", fix)
        if [each.shape[axes:] for each in arrays] != [*self.shapes] or axes > arrays[0].ndim:
            allowed = f"the shapes of the state, {self}"
            raise bad_value(name, _described(tree), allowed, fix)
        lead = arrays[0].shape[:axes]
        return library.concatenate([each.reshape(*lead, -1) for each in arrays], axis=-1)

    def flat(self, name: str, function: Callable) -> Callable:
        """A user's ``function(t, y, args)`` of the pytree as one of flat states."""
        if not callable(function):
            return function
        check_signature(name, function, ["t", "y", "args"], "")
        return functools.partial(_of_flat_states, self, function)

    def flat_rhs(self, function: Callable) -> Callable:
        """A user's right-hand side of the pytree as one of flat states."""
        of_flat_states = self.flat("rhs", function)

        if not callable(function):
            return function
        return functools.partial(_flat_rhs, self, of_flat_states)

    def flat_exact(self, function: Callable) -> Callable:
        """A user's exact solution, of pytrees, as one of flat states."""
        return functools.partial(_flat_exact, self, function)

    @property
    def parts(self) -> str:
        """Its parts in their order, as in ``y['v'] of shape (2,) and y['x'] of shape (2,)``."""
        names = [f"y{path}" for path in self._paths()]
        each = [f"{name} of shape {own}" for name, own in zip(names, self.shapes, strict=True)]
        more = [f"{len(each) - _MOST_PARTS} more"] if len(each) > _MOST_PARTS else []
        return listed([*each[:_MOST_PARTS], *more])

    @property
    def euler(self) -> str:
        """Euler's step for such states, in Python."""
        if len(self.shapes) > _MOST_PARTS:
            new: Any = "jax.tree.map(lambda y, k: y + dt * k, y, k)"
        else:
            new = self.tree.unflatten([_Code(f"y{at} + dt * k{at}") for at in self._paths()])
        return f"`k = rhs(t, y, args)`, `return {new}`"

    def _paths(self) -> list[str]:
        """How to get at each part, as in ``['x']``."""
        every = self.tree.unflatten(range(len(self.shapes)))
        return [
            jax.tree_util.keystr(path) for path, _ in jax.tree_util.tree_leaves_with_path(every)
        ]

    def __str__(self) -> str:
        return str(_shapes_in(self.unravel(np.zeros(sum(map(math.prod, self.shapes))))))


# Not inside `StateStructure`, so that pickles can name them.
def _of_flat_states(own: StateStructure, function: Callable, t: Any, y: Any, args: Any) -> Any:
    return function(t, own.unravel(y), args)


def _flat_rhs(own: StateStructure, of_flat_states: Callable, t: Any, y: Any, args: Any) -> Any:
    return own.ravel("rhs result", of_flat_states(t, y, args)).astype(float)


def _flat_exact(own: StateStructure, function: Callable, ts: Any) -> Any:
    return own.ravel("exact result", function(ts), axes=1)


class _Code(str):
    """A piece of Python, which stands for itself in a pytree that is shown."""

    def __repr__(self) -> str:
        return str(self)


def _described(tree: Any) -> Any:
    """A pytree, or the array in its place, for messages."""
    return f"an array of shape {np.shape(tree)}" if hasattr(tree, "shape") else _shapes_in(tree)


def _shapes_in(tree: Any) -> Any:
    """A pytree with the shapes of its arrays in their place, for messages."""
    return jax.tree.map(np.shape, tree)
