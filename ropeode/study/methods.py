"""Methods at a ladder of efforts: steppers by their step size, adaptive solvers by a tolerance."""

from __future__ import annotations

import contextlib
import dataclasses
import inspect
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from ropeode.errors import InputError, call_user_code
from ropeode.precision import in_float64
from ropeode.problems import Problem, named_in_file
from ropeode.references import (
    Counter,
    Solution,
    Solver,
    Stopwatch,
    finite_samples,
    functions_of,
    solve,
)
from ropeode.simulation import intervals, method_of, simulate
from ropeode.steppers import Stepper, as_stepper, library_solvers
from ropeode.study.accuracy_table import problem_class
from ropeode.study.each_once import each_once, repeated
from ropeode.validation import bad_value, shown, unknown, whole_number

EXPLICIT, IMPLICIT = "adaptive explicit", "adaptive implicit"
CONSTANT = ":constant"
# Runs end here at the latest. diffrax's own limit is 4096, and a tolerance is no step size.
MOST_STEPS = 10_000_000
# Of SciPy's solvers: LSODA changes between both kinds.
_IMPLICIT_IN_SCIPY = ("BDF", "Radau", "LSODA")
# Of a function that solves a problem.
_PARAMETERS = ("problem", "rtol")
_LIBRARIES = ("diffrax", "scipy")

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


@dataclasses.dataclass(frozen=True)
class ConstantSteps:
    """A stepper, whose effort is the number of steps per frame.

    Arguments:
        label: as in tables and plots.
        family: of methods that it belongs to, which has one colour.
        stepper: that takes the steps.
    """

    label: str
    family: str
    stepper: Stepper

    adaptive: ClassVar[bool] = False

    def refusal(self, problem: Problem) -> str | None:
        """Why it cannot run on a problem; None if it can."""
        return self.stepper.refusal(problem)

    def ready(self, problem: Problem) -> Run:
        """Compile the stepper; one program serves all numbers of steps."""
        method = method_of(self.stepper, problem)
        # Whoever cannot take such a long step may be able to take the steps that are asked for.
        with contextlib.suppress(InputError):
            simulate(problem, method, 1)

        def run(effort: float, seconds: float) -> Attempt:
            # The number of steps says how long it takes; see `ropeode.study.in_turns`.
            del seconds
            stopwatch = Stopwatch()
            found = simulate(problem, method, int(effort))
            # Other programs on the same machine take nothing from it, as from the others. But a
            # step in Python may wait for what it began elsewhere.
            taken = stopwatch.seconds if method.trial.compiled else found.seconds
            frames = problem.frames if found.diverged_at is None else found.diverged_at
            steps = int(effort) * int(intervals(problem).samples[frames])
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


@dataclasses.dataclass(frozen=True)
class Adaptive:
    """A solver of diffrax or SciPy that chooses its steps, whose effort is a relative tolerance.

    The absolute one is that times the largest component of the initial state, as for references.
    Steps end on the sample times, so that no value is interpolated. Implicit solvers of SciPy get
    the exact Jacobian, but for LSODA, which finds it by differences where it needs one.

    Arguments:
        label: as in tables and plots.
        family: of methods that it belongs to, which has one colour.
        solver: that takes the steps.
    """

    label: str
    family: str
    solver: Solver

    adaptive: ClassVar[bool] = True

    def refusal(self, problem: Problem) -> str | None:
        """It runs on whatever has a right-hand side in JAX or NumPy."""
        del problem
        return None

    @in_float64
    def ready(self, problem: Problem) -> Run:
        """Compile the solver, or the right-hand side and its Jacobian where the solver needs it."""
        counter = Counter(problem, self.solver) if self.solver.library == "diffrax" else None
        options: dict[str, Any] = {"compensated": False}
        if counter is None:
            options = {"functions": functions_of(problem, self.solver.implicit)}

        def solved(rtol: float, **limits: Any) -> Solution:
            return solve(problem, self.solver, rtol, rtol * problem.scale, **limits, **options)

        if counter is not None:
            # One program serves all tolerances.
            with contextlib.suppress(InputError):
                solved(1e-3, max_steps=1)

        def run(effort: float, seconds: float) -> Attempt:
            # LSODA warns where it gives up, which the status says.
            with warnings.catch_warnings():
                if counter is None:
                    warnings.simplefilter("ignore")
                found = solved(effort, max_steps=MOST_STEPS, seconds=seconds)
            calls, jacobians = found.rhs_evaluations, found.jacobian_evaluations
            if counter is not None:
                calls, jacobians = counter.of(found)
            return Attempt(
                status=_status(found),
                why=found.failure,
                states=found.states,
                steps=found.steps,
                rhs_evaluations=calls,
                jacobian_evaluations=jacobians,
                seconds=found.seconds,
            )

        return run


def _status(found: Solution) -> Status:
    if found.failure is None:
        return "ok"
    if found.ran_out:
        return "step limit" if found.steps >= MOST_STEPS else "time limit"
    return "diverged" if found.failure.endswith("not finite") else "failed"


@dataclasses.dataclass(frozen=True)
class OwnSolver:
    """A function ``solve(problem, rtol)``, whose effort is the tolerance.

    It returns the states at ``problem.ts``, ``(times, *state)``, and how often it evaluated the
    right-hand side, or None. A run of it cannot be stopped.

    Arguments:
        label: as in tables and plots.
        solve: the function.
    """

    label: str
    solve: Callable[[Problem, float], tuple[Any, int | None]]

    adaptive: ClassVar[bool] = True
    family: ClassVar[str] = "your own"

    def refusal(self, problem: Problem) -> str | None:
        """Its author knows."""
        del problem
        return None

    def ready(self, problem: Problem) -> Run:
        """Nothing is compiled: the first run of each effort is not timed."""

        @in_float64
        def run(effort: float, seconds: float) -> Attempt:
            del seconds
            # By the wall clock: it may wait for a program or a device that computes for it.
            began = time.perf_counter()
            returned = call_user_code(self.label, self.solve, problem, effort)
            taken = time.perf_counter() - began
            states, calls = _checked(self.label, problem, returned)
            reached = finite_samples(states)
            lost = reached < len(problem.ts)
            return Attempt(
                status="diverged" if lost else "ok",
                why=f"its state is not finite at frame {reached}" if lost else None,
                states=states[:reached],
                steps=None,
                rhs_evaluations=calls,
                jacobian_evaluations=None,
                seconds=taken,
            )

        return run


LadderMethod = ConstantSteps | Adaptive | OwnSolver


def _checked(label: str, problem: Problem, returned: Any) -> tuple[np.ndarray, int | None]:
    shape = (len(problem.ts), *problem.y0.shape)

    def wrong(what: str) -> InputError:
        return InputError(
            f"{label}: it returned {what}; allowed: (states, rhs_evaluations), with real states of "
            f"shape {shape} and a whole number >= 1 or None. Fix: return the states at problem.ts, "
            "and how often the right-hand side was evaluated."
        )

    if not isinstance(returned, tuple) or len(returned) != 2:
        raise wrong(shown(returned))
    given, calls = returned
    try:
        states = np.asarray(given)
    except ValueError:
        raise wrong("states of different lengths") from None
    if states.dtype.kind not in "iuf":
        raise wrong(f"states of type {states.dtype}")
    if np.ma.is_masked(given):
        raise wrong("states that are masked")
    if states.shape != shape:
        raise wrong(f"states of shape {states.shape}")
    try:
        calls = None if calls is None else whole_number(calls, at_least=1)
    except ValueError as error:
        raise wrong(f"{shown(calls)} evaluations ({error})") from None
    return states.astype(np.float64), calls


def _is_solve(given: Any) -> bool:
    """Whether something is a function of a problem and a tolerance."""
    return _parameters_of(given)[: len(_PARAMETERS)] == _PARAMETERS


def _parameters_of(given: Any) -> tuple[str, ...]:
    """The names of a function's parameters; none of what is no function, or does not tell."""
    if inspect.isclass(given) or not callable(given):
        return ()
    try:
        return tuple(inspect.signature(given).parameters)
    except (TypeError, ValueError):
        return ()


def _name_of(given: Any) -> str:
    """The name of a function, or of the type of an object that can be called."""
    return getattr(given, "__name__", type(given).__name__)


def as_method(what: Any, folder: str | Path = ".") -> LadderMethod:
    """Whatever can be run at a ladder of efforts, as a method.

    Solvers of diffrax and SciPy that estimate their error are adaptive here, ``diffrax:Tsit5`` as
    ``scipy:RK45``; with constant steps they are ``diffrax:Tsit5:constant``. So are their classes.

    Arguments:
        what: such a name; a function ``solve(problem, rtol)``, also as ``FILE.py:NAME``; or
            whatever `ropeode.as_stepper` takes.
        folder: that a relative file name starts from; the current one by default.

    Raises:
        InputError: it is none of these.
        UserCodeError: the user's file or class raised.
    """
    if isinstance(what, str):
        return _named(what.strip(), Path(folder))
    if _is_solve(what):
        return OwnSolver(_name_of(what), what)
    if inspect.isclass(what):
        library = what.__module__.partition(".")[0]
        if library in _LIBRARIES:
            return _named(f"{library}:{what.__name__}", Path(folder))
    _refuse_other_parameters(what)
    return _constant(as_stepper(what))


def _refuse_other_parameters(what: Any) -> None:
    """Say what a function of two parameters should be: no step has so few."""
    names = _parameters_of(what)
    if len(names) == len(_PARAMETERS):
        raise bad_value(
            "method",
            f"{_name_of(what)}({', '.join(names)})",
            f"solve({', '.join(_PARAMETERS)}), and steps",
            f"name its parameters {' and '.join(_PARAMETERS)}",
        )


def _named(text: str, folder: Path) -> LadderMethod:
    library, _, name = text.partition(":")
    if library in _LIBRARIES:
        name, _, how = name.partition(":")
        if how and f":{how}" != CONSTANT:
            raise InputError(unknown(f"option of {library}:{name}", how, [CONSTANT[1:]]))
        if how:
            return _constant(as_stepper(f"{library}:{name}"), text)
        return _of_diffrax(name) if library == "diffrax" else _of_scipy(name)
    if ".py:" in text:
        found = named_in_file(text, folder, what="method")
        if _is_solve(found):
            return OwnSolver(text, found)
        _refuse_other_parameters(found)
    return _constant(as_stepper(text, folder=folder))


def _constant(stepper: Stepper, label: str | None = None) -> ConstantSteps:
    return ConstantSteps(label or stepper.label, stepper.family, stepper)


def _of_diffrax(name: str) -> LadderMethod:
    # Not above: diffrax takes a second.
    import diffrax

    from ropeode.steppers import DiffraxStepper

    stepper: Any = as_stepper(f"diffrax:{name}")
    if not isinstance(stepper.solver, diffrax.AbstractAdaptiveSolver):
        return _constant(stepper)
    if type(stepper) is not DiffraxStepper:
        raise bad_value(
            "method",
            stepper.label,
            "adaptive solvers that take the right-hand side whole; this one takes it in two parts",
            f"write {stepper.label}{CONSTANT}",
        )
    tableau = getattr(stepper.solver, "tableau", None)
    implicit = isinstance(stepper.solver, diffrax.AbstractImplicitSolver)
    implicit |= bool(getattr(tableau, "implicit", False))
    return Adaptive(stepper.label, IMPLICIT if implicit else EXPLICIT, Solver("diffrax", name))


def _of_scipy(name: str) -> Adaptive:
    if name not in (allowed := library_solvers("scipy")):
        raise InputError(unknown("solver of scipy", name, allowed))
    family = IMPLICIT if name in _IMPLICIT_IN_SCIPY else EXPLICIT
    return Adaptive(f"scipy:{name}", family, Solver("SciPy", name))


def chosen_methods(problem: Problem, given: Any, defaults: Sequence[str]) -> list[LadderMethod]:
    """Methods that can run on a problem, each once.

    Arguments:
        problem: to be solved.
        given: a list of whatever `as_method` takes, or one; None for those of the defaults that
            can run on the problem and are meant for it.
        defaults: names.

    Raises:
        InputError: one line for each that does not exist, is repeated or cannot run.
    """
    problem.require_equations()
    if given is None:
        return [each for name in defaults if _fits(each := as_method(name), problem)]

    def fault(method: LadderMethod, earlier: LadderMethod | None) -> str | None:
        if earlier is not None:
            another = isinstance(method, OwnSolver) and method != earlier
            fix = "give one of the functions another __name__" if another else "drop one"
            return repeated("method", method.label, fix)
        return method.refusal(problem)

    return each_once("method", given, as_method, "rk4 or diffrax:Tsit5", fault)


def _fits(method: LadderMethod, problem: Problem) -> bool:
    if isinstance(method, ConstantSteps) and not method.stepper.solves(problem_class(problem)):
        return False
    return method.refusal(problem) is None
