"""Random draws of parameters: each draw is the same to the last bit on every machine."""

from __future__ import annotations

import decimal
import functools
import hashlib
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Le
from pydantic import BeforeValidator, ConfigDict, model_validator

from ropeode.validation import (
    MOST_COUNTED,
    Input,
    WholePositive,
    fault_of,
    field,
    finite_number,
    plain,
    positive_number,
    shown,
    whole_number,
)

ForEach = Literal["node", "spring"]

_MOST_DRAWS = 2**32
# More digits than a float64 has, so that the rounded result is the same everywhere.
_DIGITS = 34


def _ordered(value: Any, number: Callable[[Any], Any]) -> tuple[Any, Any]:
    low, high = (number(end) for end in _pair(value))
    if low > high:
        raise ValueError(f"{low} is above {high}")
    return low, high


def _ends(value: Any) -> tuple[Any, Any]:
    """Two numbers, or two lists of as many numbers."""
    low, high = _pair(value)
    if isinstance(low, list) != isinstance(high, list):
        raise ValueError("both ends are numbers, or both are lists")
    if not isinstance(low, list):
        return _ordered(value, finite_number)
    if not low or len(low) != len(high):
        raise ValueError(f"{len(low)} and {len(high)} numbers")
    ends = [_ends(pair) for pair in zip(low, high, strict=True)]
    return tuple(low for low, _ in ends), tuple(high for _, high in ends)


def _positive_ends(value: Any) -> tuple[float, float]:
    return _ordered(value, positive_number)


def _whole_ends(value: Any) -> tuple[int, int]:
    return _ordered(value, functools.partial(whole_number, at_least=-MOST_COUNTED))


def _pair(value: Any) -> list[Any]:
    value = [*value] if isinstance(value, (list, tuple)) else []
    if len(value) != 2:
        raise ValueError("two ends are needed")
    return [list(end) if isinstance(end, tuple) else end for end in value]


def _choices(value: Any) -> tuple[Any, ...]:
    if not isinstance(value, (list, tuple)) or not value:
        raise ValueError(f"{shown(plain(value))} is not a list of values")
    return tuple(value)


def _seeds(value: Any) -> tuple[int, ...]:
    if not isinstance(value, (list, tuple)) or not value:
        raise ValueError("at least one is needed, in a list")
    seeds = tuple(whole_number(each, at_least=0) for each in value)
    if len(set(seeds)) < len(seeds):
        raise ValueError("one is repeated")
    return seeds


class Draws(Input):
    """How many draws there are.

    Arguments:
        count: draws for each seed.
        seeds: of the random numbers.

    Raises:
        InputError: one line for each that cannot be used.
    """

    count: Annotated[WholePositive, Le(_MOST_DRAWS)] = field(
        1, allowed="a whole number from 1 to 2^32", example="100"
    )
    seeds: Annotated[tuple[int, ...], BeforeValidator(_seeds)] = field(
        (0,), allowed="different whole numbers >= 0", example="[0, 1]"
    )


class Distribution(Input):
    """The distribution of a parameter: one of the four.

    Arguments:
        uniform: the two ends; where they are lists, each component is drawn between its own.
        log_uniform: the two ends, above zero; the logarithm is uniform between theirs.
        integers: the smallest and the largest whole number.
        choice: values, all equally likely.
        for_each: `node` or `spring`: a list is drawn, with one entry for each of them.

    Raises:
        InputError: one line for each that cannot be used.
    """

    uniform: Annotated[Any, BeforeValidator(_ends)] = field(
        None, allowed="two ends, the smaller one first", example="[0.0, 0.1]"
    )
    log_uniform: Annotated[Any, BeforeValidator(_positive_ends)] = field(
        None, allowed="two ends above zero, the smaller one first", example="[10.0, 1000.0]"
    )
    integers: Annotated[Any, BeforeValidator(_whole_ends)] = field(
        None, allowed="two whole numbers, the smaller one first", example="[4, 32]"
    )
    choice: Annotated[Any, BeforeValidator(_choices)] = field(
        None, allowed="a list of values", example="[8, 16]"
    )
    for_each: ForEach | None = field(None, allowed='"node" or "spring"', example='"node"')

    model_config = ConfigDict(validate_default=False)

    @model_validator(mode="after")
    def _one_of_them(self) -> Distribution:
        if len(self._kinds) != 1:
            why = "exactly one of uniform, log_uniform, integers and choice is needed"
            raise fault_of("uniform", self._kinds, why)
        return self

    @property
    def _kinds(self) -> list[str]:
        kinds = ("uniform", "log_uniform", "integers", "choice")
        return [kind for kind in kinds if getattr(self, kind) is not None]

    @property
    def as_written(self) -> dict[str, Any]:
        """The distribution as a spec has it."""
        return self.model_dump(exclude_none=True)

    @property
    def extremes(self) -> list[Any]:
        """The two ends, or all values of a choice; of one entry where lists are drawn."""
        return list(getattr(self, self._kinds[0]))

    def value(self, seed: int, draw: int, name: str, entries: int | None) -> Any:
        """One draw.

        It depends on its arguments alone: other draws, seeds and parameters may be added or
        removed. The random bits are those of NumPy's `SeedSequence`, which are the same in
        every version, and logarithms are computed in decimal numbers, which are the same on
        every machine.

        Arguments:
            seed: of the design.
            draw: its number with this seed, from 0 on.
            name: of the parameter.
            entries: the length of the list to draw; None for a value that is not a list.
        """
        size = len(self.uniform[0]) if self.uniform and isinstance(self.uniform[0], tuple) else 1
        bits = _bits(seed, draw, name, size * (entries or 1))
        drawn = [self._one(bits[i : i + size]) for i in range(0, len(bits), size)]
        return drawn[0] if entries is None else drawn

    def _one(self, bits: Sequence[int]) -> Any:
        if self.choice is not None:
            return self.choice[_below(bits[0], len(self.choice))]
        if self.integers is not None:
            low, high = self.integers
            return low + _below(bits[0], high - low + 1)
        if self.log_uniform is not None:
            low, high = self.log_uniform
            return _between_logarithms(low, high, _fraction(bits[0]))
        low, high = self.uniform
        if not isinstance(low, tuple):
            return _between(low, high, _fraction(bits[0]))
        each = zip(low, high, bits, strict=True)
        return [_between(start, end, _fraction(one)) for start, end, one in each]


def _bits(seed: int, draw: int, name: str, count: int) -> list[int]:
    """``count`` numbers of 64 random bits; with more of them the first ones stay the same."""
    digest = hashlib.sha256(name.encode()).digest()
    words = np.frombuffer(digest, dtype="<u4").tolist()
    sequence = np.random.SeedSequence(entropy=seed, spawn_key=(draw, *words))
    return sequence.generate_state(count, np.uint64).tolist()


def _fraction(bits: int) -> float:
    """A number from 0 up to, but not including, 1."""
    return (bits >> 11) * 2.0**-53


def _below(bits: int, count: int) -> int:
    """A whole number from 0 to ``count - 1``; all equally likely to within ``count`` / 2^64."""
    return bits * count >> 64


def _between(low: float, high: float, fraction: float) -> float:
    return min(low + (high - low) * fraction, high)


def _between_logarithms(low: float, high: float, fraction: float) -> float:
    with decimal.localcontext(decimal.Context(prec=_DIGITS)):
        ratio = decimal.Decimal(high) / decimal.Decimal(low)
        drawn = float(decimal.Decimal(low) * (ratio.ln() * decimal.Decimal(fraction)).exp())
    return min(max(drawn, low), high)
