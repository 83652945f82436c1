"""What the runs of one reference share: the time that they may take, and their tolerances."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from ropeode.progress import Progress, silent


@dataclasses.dataclass(eq=False)
class Budget:
    """The time for all runs of one reference, counted as they are made.

    Arguments:
        scale: the absolute tolerance of each run, divided by its relative one: one number, or an
            array of the state's shape.
        seconds: that all runs may take together. Compiling does not count, so that what was
            compiled before does not change a result.
        progress: called before each run, with what it is.
        samples: how many sample times the whole problem has. Programs are compiled for them, and
            serve what is left of the problem where a run ends early.
        spent: seconds that the runs have taken so far.
    """

    scale: Any
    seconds: float = math.inf
    progress: Progress = silent
    samples: int = 0
    spent: float = 0.0

    @property
    def left(self) -> float:
        """Seconds that are left."""
        return max(self.seconds - self.spent, 0.0)
