"""The options of a reference."""

from __future__ import annotations

import dataclasses
from typing import Any, TypedDict, get_args

from ropeode.errors import InputError
from ropeode.problems import checks
from ropeode.references.certificate import Level
from ropeode.validation import check_positive, check_whole, complaint, unknown

SMALLEST_RTOL = 1e-13
LARGEST_RTOL = 1e-3
# At the level `extended`: float64 has 16 digits, and two to spare.
DIGITS = 18
TIME_LIMIT = 60.0


class Asked(TypedDict, total=False):
    """The fields of `ReferenceOptions` that a study of a problem takes by name."""

    accuracy: float | None
    rtol: float | None
    level: Level
    digits: int
    time_limit: float


@dataclasses.dataclass(frozen=True)
class ReferenceOptions:
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

    accuracy: float | None = None
    rtol: float | None = None
    level: Level = "consensus"
    digits: int = DIGITS
    time_limit: float = TIME_LIMIT
    dense: bool = False

    def __post_init__(self) -> None:
        checks.run(
            lambda: self._set("accuracy", self._checked_accuracy()),
            lambda: self._set("rtol", self._checked_rtol()),
            self._check_level,
            lambda: self._set(
                "digits", check_whole("digits", self.digits, at_least=1, example="18")
            ),
            lambda: self._set(
                "time_limit", check_positive("time_limit", self.time_limit, example="60")
            ),
        )

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def _checked_accuracy(self) -> float | None:
        if self.accuracy is None:
            return None
        return check_positive("accuracy", self.accuracy, example="1e-6")

    def _checked_rtol(self) -> float | None:
        if self.rtol is None:
            return None
        if self.level == "extended":
            fix = "leave it out, or ask for digits"
            raise InputError(complaint("rtol", self.rtol, "none with level 'extended'", fix))
        rtol = check_positive("rtol", self.rtol, example="1e-12")
        if not SMALLEST_RTOL <= rtol <= LARGEST_RTOL:
            raise InputError(
                complaint(
                    "rtol",
                    rtol,
                    f"from {SMALLEST_RTOL:g} (float64 carries no more) to {LARGEST_RTOL:g}",
                    f"for example rtol={SMALLEST_RTOL:g}",
                )
            )
        return rtol

    def _check_level(self) -> None:
        if self.level not in get_args(Level):
            raise InputError(unknown("level", self.level, get_args(Level)))
