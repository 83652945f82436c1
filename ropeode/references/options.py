"""The options of a reference."""

from __future__ import annotations

from typing import Annotated, TypedDict

from pydantic import Field, ValidationInfo, field_validator

from ropeode.references.certificate import Level
from ropeode.validation import Input, Positive, WholePositive, bad_value, field

SMALLEST_RTOL = 1e-13
LARGEST_RTOL = 1e-3
# At the level `extended`: float64 has 16 digits, and two to spare.
DIGITS = 18
TIME_LIMIT = 60.0

Rtol = Annotated[Positive, Field(ge=SMALLEST_RTOL, le=LARGEST_RTOL)]


class Asked(TypedDict, total=False):
    """The fields of `ReferenceOptions` that a study of a problem takes by name."""

    accuracy: float | None
    rtol: float | None
    level: Level
    digits: int
    time_limit: float


class ReferenceOptions(Input):
    """The options of `ropeode.reference`, which describes them.

    Arguments:
        accuracy: the largest error bound that is still trusted; None for the default, which
            depends on how far the solution moves.
        rtol: relative tolerance of the float64 solvers; None for the tightest that helps.
        level: `consensus` or `extended`.
        digits: to which the two runs in extended precision must agree.
        time_limit: in seconds, for all runs in extended precision together.
        dense: compute the states between the samples as well.

    Raises:
        InputError: one line for each option that cannot be used.
    """

    accuracy: Positive | None = field(None, allowed="a finite number > 0", example="1e-6")
    rtol: Rtol | None = field(
        None,
        allowed=f"from {SMALLEST_RTOL:g} (float64 carries no more) to {LARGEST_RTOL:g}",
        example=f"{SMALLEST_RTOL:g}",
    )
    level: Level = field("consensus", allowed="consensus or extended", example='"extended"')
    digits: WholePositive = field(DIGITS, allowed="a whole number >= 1", example="24")
    time_limit: Positive = field(TIME_LIMIT, allowed="a finite number > 0", example="600")
    dense: bool = field(False, allowed="true or false", example="true")

    @field_validator("level")
    @classmethod
    def _without_rtol(cls, level: Level, info: ValidationInfo) -> Level:
        rtol = info.data.get("rtol")
        if level == "extended" and rtol is not None:
            fix = "leave it out, or ask for digits"
            raise bad_value("rtol", rtol, "none with level 'extended'", fix)
        return level
