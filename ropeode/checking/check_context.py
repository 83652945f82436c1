"""All that the checks of one stepper share: its runs, and the references they are held against."""

from __future__ import annotations

import contextlib
import functools
import threading
from collections.abc import Iterable, Sequence
from concurrent.futures import Future

import numpy as np

from ropeode.checking.candidate import Candidate
from ropeode.checking.check_ropes import UNITS, convergence_problems, generic, in_other_units
from ropeode.checking.convergence import converging, ladder, steps_to_dts
from ropeode.checking.report import Claims, Convergence
from ropeode.errors import RopeodeError
from ropeode.problems.problem import Problem
from ropeode.references.compute import reference
from ropeode.references.reference import Reference
from ropeode.steppers.base import Stepper
from ropeode.study.accuracy_table import problem_class
from ropeode.threads import cores

# Of the size of the rope, what rounding alone makes of a few steps.
_ROUNDING = 1e-10
_REFERENCES: dict[tuple, Future[Reference]] = {}
_MOST_KEPT = 256
_LOCK = threading.Lock()


class Examination:
    """A candidate under examination.

    Arguments:
        candidate: what is judged.
        claims: what is said of it.
        declared: the stepper whose declared facts are claimed of it; None where none is.
    """

    def __init__(
        self,
        candidate: Candidate,
        claims: Claims,
        declared: Stepper | None = None,
    ):
        self.candidate, self.claims = candidate, claims
        self._declared = declared
        self._found: dict[str, Convergence] = {}
        self._simpler: dict[str, Problem] = {}

    def refusal(self, problem: Problem) -> str | None:
        """Why the candidate cannot be run on a problem; None if it can."""
        if self.candidate.stepper.equal_frames and not problem.equal_frames:
            return "a two-step method needs equal frames"
        return None

    def problem(self, name: str) -> Problem:
        """One of `convergence_problems`, without the forces that it cannot be told of."""
        problem = convergence_problems()[name]
        unknown = [force for force in self.cannot_be_told if np.any(getattr(problem.args, force))]
        if not unknown:
            return problem
        if name not in self._simpler:
            none = {force: np.zeros_like(getattr(problem.args, force)) for force in unknown}
            self._simpler[name] = problem.changed(args=problem.args._replace(**none))
        return self._simpler[name]

    @property
    def cannot_be_told(self) -> dict[str, str]:
        """The forces that the candidate cannot be told of, and why."""
        found = {}
        if self.candidate.own_forces:
            found["drive"] = "it computes its own forces"
        if self.candidate.stepper.needs == "second order, no damping":
            found["damping"] = "it takes forces that depend on time and positions only"
        return found

    def expected(self, problem: Problem) -> int | None:
        """The order that is claimed on a problem; None where nothing is."""
        if self.claims.order is not None or self._declared is None:
            return self.claims.order
        return self._declared.order(problem_class(problem))

    @property
    def symplectic(self) -> bool | None:
        """What is claimed, or declared; None where nothing is."""
        if self.claims.symplectic is not None or self._declared is None:
            return self.claims.symplectic
        return self._declared.symplectic

    @property
    def conserves_energy(self) -> bool | None:
        """What is claimed; what is symplectic does. None where nothing is claimed."""
        if self.claims.conserves_energy is None and self.symplectic:
            return True
        return self.claims.conserves_energy

    @functools.cached_property
    def keeps_units(self) -> bool:
        """Whether a run in other units differs by rounding alone, and so tells how large it is."""
        own = self.candidate.run(generic(), 1)
        other = self.candidate.run(in_other_units(generic()), 1) / UNITS
        return bool(np.max(np.abs(own - other)) <= _ROUNDING * generic().scale)

    def convergence(self, name: str) -> Convergence:
        """What the runs of one of `convergence_problems` show; found once."""
        if name not in self._found:
            self._found[name] = self.observed(self.problem(name))
        return self._found[name]

    def observed(self, problem: Problem) -> Convergence:
        """What the runs of a problem show, at as many step sizes as it takes.

        Arguments:
            problem: a check rope.
        """
        known = reference_of(problem)
        other = in_other_units(problem) if self.keeps_units else None
        made: dict[int, tuple[np.ndarray, np.ndarray | None]] = {}

        def observe(steps: Sequence[int]) -> Convergence:
            for each in steps:
                if each not in made:
                    states = self.candidate.run(problem, each)
                    double = None if other is None else self.candidate.run(other, each) / UNITS
                    made[each] = states, double
            return converging(
                known,
                list(zip(steps_to_dts(known, steps), (made[n][0] for n in steps), strict=True)),
                expected=self.expected(problem),
                doubles=[made[n][1] for n in steps],
            )

        return ladder(observe)


def reference_of(problem: Problem) -> Reference:
    """The certified reference of a check rope; made once in a process.

    Of several threads that ask for the same one, one makes it.

    Arguments:
        problem: a check rope.

    Raises:
        ReferenceRefused: none can be had.
    """
    numbers = (problem.ts, problem.y0, *problem.args)
    key = (problem.name, *(each.tobytes() for each in numbers))
    with _LOCK:
        made = _REFERENCES.get(key)
        if made is None and len(_REFERENCES) >= _MOST_KEPT:
            _REFERENCES.clear()
        own = _REFERENCES.setdefault(key, Future())
    if made is None:
        try:
            own.set_result(reference(problem))
        except BaseException as error:
            own.set_exception(error)
    return own.result()


def references_ahead(problems: Iterable[Problem]) -> None:
    """Begin to make references, in threads of their own, so that they are there when needed.

    Arguments:
        problems: check ropes.
    """
    # Those with uneven frames, which take a program of their own, are taken first, and last in
    # the list: so both programs are compiled side by side.
    waiting = sorted(problems, key=lambda problem: not problem.equal_frames)

    def work() -> None:
        with contextlib.suppress(IndexError, RopeodeError):
            while True:
                reference_of(waiting.pop())

    for _ in range(cores()):
        # What goes wrong is told to whoever asks for the same reference again. No daemons: a
        # process that ends while one of these compiles would be aborted.
        threading.Thread(target=work).start()
