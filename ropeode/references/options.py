"""The options of a reference."""

from __future__ import annotations

from typing import Annotated, Any, TypedDict

import numpy as np
from pydantic import Field, PlainValidator, ValidationInfo, field_validator

from ropeode.arrays import real_array
from ropeode.problems import Problem, refuse_others
from ropeode.references.certificate import Level
from ropeode.validation import Input, Positive, WholePositive, bad_value, field

SMALLEST_RTOL = 1e-13
LARGEST_RTOL = 1e-3
# At the level `extended`: float64 has 16 digits, and two to spare.
DIGITS = 18
# Tolerances are numbers in float64.
MOST_DIGITS = 300
TIME_LIMIT = 60.0

Rtol = Annotated[Positive, Field(ge=SMALLEST_RTOL, le=LARGEST_RTOL)]


def _atol(value: Any) -> Any:
    """None, or a number or array as plain numbers, which can be compared."""
    if value is None:
        return None
    array = real_array("atol", value, "1e-20, or one number for each component")
    if not np.all(array > 0.0):
        raise bad_value("atol", value, "finite numbers > 0", "atol=1e-20")
    return _tuples(array.tolist())


def _tuples(value: Any) -> Any:
    return tuple(_tuples(each) for each in value) if isinstance(value, list) else value


class More(TypedDict, total=False):
    """The fields of `ReferenceOptions` that `reference` takes by name only."""

    atol: Any
    level: Level
    digits: int
    time_limit: float


class Asked(More, total=False):
    """The fields of `ReferenceOptions` that a study of a problem takes by name."""

    accuracy: float | None
    rtol: float | None


class AskedButRtol(More, total=False):
    """The same for a study whose methods have tolerances of their own."""

    accuracy: float | None


class ReferenceOptions(Input):
    """The options of `ropeode.reference`, which describes them.

    Arguments:
        accuracy: the largest error bound that is still trusted; None for the default, which
            depends on how far the solution moves.
        rtol: relative tolerance of the float64 solvers; None for the tightest that helps.
        atol: absolute tolerance at that relative one (at 1e-13 where that is None): one number,
            or an array of the state's shape; None for `rtol` times the largest component of the
            initial state.
        level: `consensus` or `extended`.
        digits: to which the two runs in extended precision must agree.
        time_limit: in seconds, for all runs together, without compiling.

    Raises:
        InputError: one line for each option that cannot be used.
    """

    accuracy: Positive | None = field(None, allowed="a finite number > 0", example="1e-6")
    rtol: Rtol | None = field(
        None,
        allowed=f"from {SMALLEST_RTOL:g} (float64 carries no more) to {LARGEST_RTOL:g}",
        example=f"{SMALLEST_RTOL:g}",
    )
    atol: Annotated[Any, PlainValidator(_atol)] = field(
        None, allowed="a finite number > 0, or an array of them", example="1e-20"
    )
    level: Level = field("consensus", allowed="consensus or extended", example='"extended"')
    digits: Annotated[WholePositive, Field(le=MOST_DIGITS)] = field(
        DIGITS, allowed=f"a whole number from 1 to {MOST_DIGITS}", example="24"
    )
    time_limit: Positive = field(TIME_LIMIT, allowed="a finite number > 0", example="600")

    @field_validator("level")
    @classmethod
    def _without_tolerances(cls, level: Level, info: ValidationInfo) -> Level:
        for name in ("rtol", "atol"):
            value = info.data.get(name)
            if level == "extended" and value is not None:
                fix = "leave it out, or ask for digits"
                raise bad_value(name, value, "none with level 'extended'", fix)
        return level

    def __init__(self, /, *values: Any, **named: Any):
        refuse_others(named, type(self).model_fields)
        super().__init__(*values, **named)

    def tolerance_scale(self, problem: Problem) -> Any:
        """The absolute tolerance of each run, divided by its relative one.

        Arguments:
            problem: what is solved.

        Raises:
            InputError: `atol` is an array of another shape than the state.
        """
        if self.atol is None:
            return problem.scale
        if np.shape(self.atol) not in ((), problem.y0.shape):
            raise bad_value(
                "atol",
                np.shape(self.atol),
                f"one number, or an array of the state's shape, {problem.y0.shape}",
                "give each component a tolerance",
            )
        with np.errstate(over="ignore"):
            ratio = np.asarray(self.atol) / (self.rtol or SMALLEST_RTOL)
        if not np.all(np.isfinite(ratio)):
            allowed = "numbers that are finite when divided by rtol"
            raise bad_value("atol", self.atol, allowed, "stay below the size of the state")
        return ratio
