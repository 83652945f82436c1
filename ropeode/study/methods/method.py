"""What a method is, and what one run of it gave."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Literal, Protocol

import numpy as np

from ropeode.problems import Problem

Status = Literal["ok", "unstable", "diverged", "unsolved", "step limit", "time limit", "failed"]


@dataclasses.dataclass(frozen=True, eq=False)
class Attempt:
    """One run of a method at one effort.

    Arguments:
        status: `ok`, `diverged`, `unsolved`, `step limit`, `time limit` or `failed`.
        why: it is not `ok`; None if it is.
        states: at the sample times that it reached, ``(times, *state)``.
        steps: how many; None where nobody knows.
        rhs_evaluations: of the right-hand side; likewise.
        jacobian_evaluations: of its Jacobian; likewise.
        seconds: without compiling.
    """

    status: Status
    why: str | None
    states: np.ndarray
    steps: int | None
    rhs_evaluations: int | None
    jacobian_evaluations: int | None
    seconds: float


# Runs one effort, stopping after so many seconds where it can be stopped.
Run = Callable[[float, float], Attempt]


class LadderMethod(Protocol):
    """A method that can be run at several efforts."""

    @property
    def label(self) -> str:
        """As in tables and plots."""
        ...

    @property
    def family(self) -> str:
        """The family of methods that it belongs to, which has one colour."""
        ...

    @property
    def adaptive(self) -> bool:
        """Whether its effort is a relative tolerance; if not, it is steps per frame."""
        ...

    def refusal(self, problem: Problem) -> str | None:
        """Why it cannot run on a problem; None if it can."""
        ...

    def ready(self, problem: Problem) -> Run:
        """Compile what can be compiled; what is returned runs it."""
        ...


def tolerances(problem: Problem, rtol: float) -> tuple[float, float]:
    """The relative tolerance and the absolute one that goes with it.

    The absolute one is the relative one times the largest component of the initial state, as for
    references.
    """
    return rtol, rtol * problem.scale
