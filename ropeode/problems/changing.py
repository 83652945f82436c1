"""What JAX saw of a function of the user's, which may have changed since."""

from __future__ import annotations

import abc
from typing import Any


class Changing(abc.ABC):
    """A function that may compute something else when it is looked at again."""

    @abc.abstractmethod
    def __call__(self, *inputs: Any) -> Any:
        """What the function returns."""

    @abc.abstractmethod
    def again(self) -> Changing:
        """The function as it is now; the same object where it still computes the same."""

    @abc.abstractmethod
    def fits(self, inputs: tuple) -> bool:
        """Whether it is the function of inputs with such a structure and such shapes."""
