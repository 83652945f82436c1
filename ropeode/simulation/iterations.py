"""What happens inside the steps of implicit methods."""

from __future__ import annotations

from typing import Any, NamedTuple


class Iterations(NamedTuple):
    """What a stepper says of the iterations inside its steps since the start of some runs.

    Fields:
        solved: whether its equations were solved, ``(blocks, lanes)``.
        jacobians: evaluated, each with the right-hand side; 0 where it does not say,
            ``(blocks, lanes)``.
    """

    solved: Any
    jacobians: Any
