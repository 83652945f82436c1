"""What the checks of one stepper share: its runs, and the references of the check ropes."""

from __future__ import annotations

import dataclasses
import functools
import re
import threading
from collections.abc import Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np

from ropeode.checking.check_ropes import (
    UNITS,
    convergence_problems,
    generic,
    in_other_units,
    undamped,
)
from ropeode.checking.convergence import RunAndDouble, converging, ladder
from ropeode.checking.report import Claims, Convergence, Finding
from ropeode.errors import ReferenceRefused
from ropeode.problems import Problem
from ropeode.references import Reference, reference_for
from ropeode.simulation import Method, method_of, simulate, step_size
from ropeode.steppers import STEPPER_LIBRARIES, ProblemClass, StepFunction, Stepper, as_stepper
from ropeode.study import problem_class
from ropeode.threads import cores

# Of the size of the rope, what rounding alone makes of a few steps.
_ROUNDING = 1e-10
_LIBRARIES = tuple(f"{library}:" for library in STEPPER_LIBRARIES)
# References of check ropes, by the numbers of the rope, and how many of them are kept.
_REFERENCES: dict[tuple, Future[Reference]] = {}
_LOCK, _MOST_KEPT = threading.Lock(), 256
# Where a line of a finding has such a number.
_NOT_FINITE = re.compile(r"\b(nan|inf)\b")


class Examination:
    """A stepper under examination, with its runs on check ropes.

    Arguments:
        step: whatever `ropeode.as_stepper` takes, or a `Method` for check ropes.
        claims: of its author; None for what the stepper declares of itself.

    Raises:
        InputError: there is no such stepper, or it cannot run on check ropes.
        UserCodeError: a user's step raised, or keeps hidden state.
    """

    def __init__(self, step: Any, claims: Claims | None = None):
        # Without damping: some steppers cannot be told of it, and are checked without.
        self.method = method_of(step, undamped())
        self.stepper = self.method.stepper
        self.claims = own_claims(self.stepper) if claims is None else claims
        method = self.claims.method
        # A class is held to what it declares, too, wherever nothing else is claimed.
        self._declared = self.stepper if _declares_facts(self.stepper) else None
        # That of the same name is the stepper itself, which may be a user's class.
        if method not in (None, self.stepper.label):
            self._declared = as_stepper(method)
        self._convergences: dict[str, Convergence] = {}
        # The last run that did not stay finite, in words.
        self.lost = ""

    @property
    def own_forces(self) -> bool:
        """Whether it computes forces of its own from `args`, and knows nothing of the drive."""
        return not self.method.trial.asks_for_forces

    @property
    def may_sweep(self) -> bool:
        """Whether it may treat nodes or directions in turn, as no method claimed by name does."""
        return self.claims.method in (None, self.stepper.label)

    def run(self, problem: Problem, steps_per_frame: int) -> np.ndarray:
        """The states at the sample times, ``(times, *state)``.

        From the first sample on whose state is not finite, all are not-a-number.

        Arguments:
            problem: a check rope.
            steps_per_frame: equal steps in each interval between sample times.

        Raises:
            UserCodeError: the user's code raised, or returned something that is no state.
        """
        states = padded_states(problem, self.method, steps_per_frame)
        if not np.all(np.isfinite(states[-1])):
            ends = int(np.argmin(np.isfinite(states).reshape(len(states), -1).all(axis=1)))
            self.lost = (
                f"the step returns numbers that are not finite (nan or infinite): on the rope "
                f"{problem.name!r} with dt = {step_size(problem, steps_per_frame):.3g}, before "
                f"t = {problem.ts[ends]:.6g}"
            )
        return states

    def with_nan(self, finding: Finding) -> Finding:
        """A finding, which calls what is not a number by its name and says where it came up."""
        if finding.status != "fail" or not self.lost or not _NOT_FINITE.search(finding.line):
            return finding
        return dataclasses.replace(finding, line=self.lost)

    def one_step(self, problem: Problem, dt: float) -> np.ndarray:
        """The state after one step of a given length, ``state``.

        The frames after it are not looked at; with as many as all check ropes have, no other
        program is compiled.
        """
        ts = problem.ts[0] + dt * np.arange(len(problem.ts))
        return self.run(problem.changed(ts=ts), 1)[1]

    def refusal(self, problem: Problem) -> str | None:
        """Why the stepper cannot be run on a problem; None if it can."""
        if self.stepper.equal_frames and not problem.equal_frames:
            return "a two-step method needs equal frames"
        return None

    @functools.cached_property
    def problems(self) -> dict[str, Problem]:
        """`convergence_problems` without the forces that the stepper cannot be told of."""
        return {name: self.told(problem) for name, problem in convergence_problems().items()}

    def told(self, problem: Problem) -> Problem:
        """A check rope without the forces that the stepper cannot be told of."""
        args = problem.args
        unknown = [force for force in self.cannot_be_told if np.any(getattr(args, force))]
        none = {force: np.zeros_like(getattr(args, force)) for force in unknown}
        return problem.changed(args=args._replace(**none)) if unknown else problem

    @property
    def cannot_be_told(self) -> dict[str, str]:
        """The forces that the stepper cannot be told of, and why."""
        forces = {}
        if self.own_forces:
            forces["drive"] = "it computes its own forces"
        if self.stepper.needs == "second order, no damping":
            forces["damping"] = "it takes forces that depend on time and positions only"
        return forces

    def expected(self, problem: Problem) -> int | None:
        """The order that is claimed on a problem; None where nothing is."""
        if self.claims.order is None and self._declared is not None:
            return self._declared.order(problem_class(problem))
        return self.claims.order_on(problem_class(problem))

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
        own = self.run(generic(), 1)
        other = self.run(in_other_units(generic()), 1) / UNITS
        return bool(np.max(np.abs(own - other)) <= _ROUNDING * generic().scale)

    def convergence(self, name: str) -> Convergence:
        """What the runs of one of `convergence_problems` show; computed once."""
        if name not in self._convergences:
            self._convergences[name] = self.observed(self.problems[name])
        return self._convergences[name]

    def observed(self, problem: Problem) -> Convergence:
        """What the runs of a check rope show, at as many step sizes as it takes."""
        certified = reference_of(problem)
        other = in_other_units(problem) if self.keeps_units else None

        @functools.cache
        def run(steps: int) -> RunAndDouble:
            double = None if other is None else self.run(other, steps) / UNITS
            return step_size(problem, steps), self.run(problem, steps), double

        expected = self.expected(problem)

        @functools.cache
        def unsolved(steps: int) -> bool:
            lost = bool(np.isnan(run(steps)[1]).any())
            return lost and simulate(problem, self.method, steps).status == "unsolved"

        def observe(steps: Sequence[int]) -> Convergence:
            runs = [run(each) for each in steps]
            lost = {run(each)[0] for each in steps if unsolved(each)}
            return converging(certified, runs, expected=expected, unsolved=lost)

        return ladder(observe)


def own_claims(stepper: Stepper) -> Claims:
    """What a stepper declares of itself: a class all its facts, others their order."""
    if _declares_facts(stepper):
        # The stepper itself: a user's class has a name that stands in no list.
        return Claims(method=stepper)  # type: ignore[arg-type]
    return Claims(order=stepper.order(ProblemClass()) or None)


def _declares_facts(stepper: Stepper) -> bool:
    """Whether more than an order; only the class of a stepper says whether it is symplectic."""
    return not isinstance(stepper, StepFunction) and not stepper.label.startswith(_LIBRARIES)


def padded_states(problem: Problem, method: Method, steps_per_frame: int) -> np.ndarray:
    """The states of a run as `Examination.run` returns them."""
    states = simulate(problem, method, steps_per_frame).states
    missing = len(problem.ts) - len(states)
    return np.pad(states, [(0, missing)] + 3 * [(0, 0)], constant_values=np.nan)


def reference_of(problem: Problem) -> Reference:
    """The certified reference of a check rope; computed once in a process.

    Of several threads that ask for the same reference, the first computes it. If that is
    interrupted, or fails in another way than by a refusal, whoever asks next does.

    Raises:
        ReferenceRefused: the problem has none.
    """
    key = problem.name, *(each.tobytes() for each in (problem.ts, problem.y0, *problem.args))
    with _LOCK:
        is_first = key not in _REFERENCES
        if is_first and len(_REFERENCES) >= _MOST_KEPT:
            _REFERENCES.clear()
        own = _REFERENCES.setdefault(key, Future())
    if is_first:
        try:
            own.set_result(reference_for(problem))
        except BaseException as error:
            own.set_exception(error)
            if not isinstance(error, ReferenceRefused):
                _REFERENCES.pop(key, None)
    return own.result()


def references_ahead(problems: Iterable[Problem]) -> None:
    """Compute the references of check ropes in threads of their own, before they are needed.

    Arguments:
        problems: of which; those with uneven frames first, for they take a program of their own,
            which is compiled beside that of the others.
    """
    # Its threads end with the work. They are no daemons: a process that ends while one of these
    # compiles would be aborted. Errors are raised again where the same reference is needed.
    pool = ThreadPoolExecutor(cores())
    for problem in problems:
        pool.submit(reference_of, problem)
    pool.shutdown(wait=False)
