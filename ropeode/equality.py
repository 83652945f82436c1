"""When two values are equal, whatever arrays they hold."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np

# Arrays of more bytes than this count by their hash.
_SMALL = 4096


class ByContent:
    """A frozen dataclass whose values are equal if they hold the same, arrays to the last bit.

    Fields with ``compare=False`` do not count, such as the time that a run took.
    """

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        return type(self) is type(other) and content(self) == content(other)

    def __hash__(self) -> int:
        return hash(content(self))

    def _contents(self) -> Any:
        return tuple(
            getattr(self, each.name)
            for each in dataclasses.fields(self)  # pyright: ignore[reportArgumentType]
            if each.compare
        )


def content(value: Any) -> Hashable:
    """What a value holds: equal for two values that hold the same."""
    if isinstance(value, ByContent):
        return type(value), content(value._contents())
    if isinstance(value, float):
        # Not a number equals itself here.
        return value if value == value else "not a number"
    if isinstance(value, (np.ndarray, np.generic)):
        array = np.asarray(value)
        plain = array.dtype.type.__module__ == "numpy" and not array.dtype.hasobject
        if not plain or array.dtype == np.longdouble:
            # Numbers of which not every bit counts, and objects.
            return array.shape, tuple(map(repr, array.ravel().tolist()))
        contents = array.tobytes()
        short = len(contents) <= _SMALL
        return (
            array.shape,
            array.dtype.str,
            contents if short else hashlib.blake2b(contents).digest(),
        )
    if isinstance(value, Mapping):
        return frozenset((key, content(entry)) for key, entry in value.items())
    if isinstance(value, (tuple, list)):
        return tuple(map(content, value))
    if dataclasses.is_dataclass(value) and not isinstance(value, type) and _by_fields(value):
        return type(value), content(ByContent._contents(value))  # pyright: ignore[reportArgumentType]
    return value if isinstance(value, Hashable) else id(value)


def _by_fields(value: Any) -> bool:
    """Whether a dataclass has no comparison of its own beyond that of its fields."""
    own = type(value).__eq__
    return own is object.__eq__ or type(value).__dataclass_params__.eq
