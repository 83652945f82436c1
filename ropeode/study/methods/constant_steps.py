"""Steppers as methods, whose effort is the number of steps per frame."""

from __future__ import annotations

import contextlib
import dataclasses

from ropeode.errors import InputError
from ropeode.problems import Problem
from ropeode.references import Stopwatch
from ropeode.simulation import method_of, simulate
from ropeode.steppers import Stepper
from ropeode.study.methods.method import Attempt, Run

CONSTANT = ":constant"


@dataclasses.dataclass(frozen=True)
class ConstantSteps:
    """A stepper.

    Arguments:
        stepper: that takes the steps.
        label: as in tables and plots.
    """

    stepper: Stepper
    label: str

    adaptive = False

    @property
    def family(self) -> str:
        """That of the stepper."""
        return self.stepper.family

    def refusal(self, problem: Problem) -> str | None:
        """As the stepper says."""
        return self.stepper.refusal(problem)

    def ready(self, problem: Problem) -> Run:
        """Compile the stepper; one program serves all numbers of steps."""
        method = method_of(self.stepper, problem)
        # Whoever cannot take such a long step may be able to take the steps that are asked for.
        with contextlib.suppress(InputError):
            simulate(problem, method, 1)

        def run(effort: float, seconds: float) -> Attempt:
            # The number of steps says how long it takes; see `ropeode.study.methods.in_turns`.
            del seconds
            stopwatch = Stopwatch()
            found = simulate(problem, method, int(effort))
            # Other programs on the same machine take nothing from it, as from the others. But a
            # step in Python may wait for what it began elsewhere.
            taken = stopwatch.seconds if method.trial.compiled else found.seconds
            frames = problem.frames if found.diverged_at is None else found.diverged_at
            steps = int(effort) * frames
            calls, jacobians = found.rhs_evaluations, found.jacobian_evaluations
            if calls is None and (calls := self._in_loops(steps)) is not None:
                jacobians = 0
            return Attempt(
                status=found.status,
                why=found.lost and f"it {found.lost}",
                states=found.states,
                steps=steps,
                rhs_evaluations=calls,
                jacobian_evaluations=jacobians,
                seconds=min(found.seconds, taken),
            )

        return run

    def _in_loops(self, steps: int) -> int | None:
        """The evaluations of an explicit solver of diffrax, which makes them in loops."""
        solver = getattr(self.stepper, "solver", None)
        if self.stepper.family != "diffrax" or solver is None:
            return None
        # Not above: it imports diffrax.
        from ropeode.references import explicit_evaluations

        return explicit_evaluations(type(solver), steps)
