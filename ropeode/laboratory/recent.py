"""What was computed lately, as far as it fits into so much memory."""

from __future__ import annotations

import collections
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

Value = TypeVar("Value")


class Recent(Generic[Value]):
    """Values by key. Those that were not asked for the longest are dropped.

    Arguments:
        most_bytes: that the values may take together; the newest is kept in any case.
        bytes_of: what a value takes.
    """

    def __init__(self, most_bytes: int, bytes_of: Callable[[Value], int]) -> None:
        self._most, self._bytes_of = most_bytes, bytes_of
        self._values: collections.OrderedDict[Hashable, Value] = collections.OrderedDict()
        self._bytes = 0

    def __contains__(self, key: Hashable) -> bool:
        """Whether the value of a key is there."""
        return key in self._values

    def __getitem__(self, key: Hashable) -> Value:
        """The value of a key, which is there."""
        self._values.move_to_end(key)
        return self._values[key]

    def __setitem__(self, key: Hashable, value: Value) -> None:
        """Keep a value."""
        self.drop(key)
        self._values[key] = value
        self._bytes += self._bytes_of(value)
        while self._bytes > self._most and len(self._values) > 1:
            self.drop(next(iter(self._values)))

    def drop(self, key: Hashable) -> None:
        """Forget the value of a key, if it is there."""
        if key in self._values:
            self._bytes -= self._bytes_of(self._values.pop(key))

    def get(self, key: Hashable, compute: Callable[[], Value]) -> Value:
        """The value of a key; computed, if it is not there."""
        if key not in self:
            self[key] = compute()
        return self[key]
