"""The first steps of a user's stepper: how it behaves, and whether JAX can compile it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Hashable, Sequence
from typing import Any

import jax
import numpy as np

from ropeode.errors import RopeodeError, UserCodeError
from ropeode.precision import in_float64
from ropeode.problems import Memory, Problem, callbacks_in
from ropeode.simulation.python_driver import PythonStepper, one_at_a_time
from ropeode.simulation.side_effects import (
    WRITES_OVER,
    Results,
    memory_effects,
    process_effects,
    process_state,
)
from ropeode.simulation.system import on_stored_states
from ropeode.simulation.trajectory import frame_lengths
from ropeode.simulation.user_clock import on_user_clock
from ropeode.steppers import Stepper

# Compiled and uncompiled steps have to agree for so many, that a step which counts how often it is
# called has counted to a hundred; and so closely, relative to the state.
_STEPS, _SAME = 144, 1e-11
# How another problem and step size differ from the first.
_OTHER = 1.25
# With loops of JAX's own inside, which are slow where they are not compiled.
_STEPS_WITH_LOOPS = 6
# A longer program, such as that of an iteration that was unrolled, takes XLA minutes and gigabytes
# to compile: with 3000 lines a quarter of a minute, and more than twice as long with twice as many.
_MOST_LINES = 3000
# The size of a step, of a frame: small, so that no stepper is unstable.
_FRACTION = 1.0 / 4096.0

# Outcomes, each with its stepper, so that no other object takes that one's `id`.
_TRIALS: dict[Hashable, tuple[Stepper, Trial]] = {}
_MOST_KEPT = 256

# What a step is called whose output does not depend on its input alone; and the same where it is
# not known what it remembers.
_NOT_DETERMINISTIC = "not deterministic: the same input gave different output; the step keeps"
HIDDEN_STATE = (
    f"{_NOT_DETERMINISTIC} hidden state (a global variable or a closure), or draws random numbers"
)


@dataclasses.dataclass(frozen=True)
class Trial:
    """How a stepper behaves, apart from what it computes.

    Arguments:
        compiled: whether JAX can trace it, with the same results.
        hidden_state: how the same input gave different output, in words; empty if it never did.
        side_effects: what it does besides returning a result, each as in "modifies args".
        finite: whether its first steps from a regular state are finite.
        asks_for_forces: whether it calls the right-hand side or acceleration that it is handed.
        remembers: whether something that it may remember has changed, or may have.
    """

    compiled: bool
    hidden_state: str = ""
    finite: bool = True
    side_effects: tuple[str, ...] = ()
    asks_for_forces: bool = True
    remembers: bool = False

    def require_finite(self) -> None:
        """See that the first steps are finite.

        Raises:
            UserCodeError: they are not.
        """
        if not self.finite:
            raise UserCodeError(
                "step: its first step from a regular state is not finite; allowed: finite "
                "positions and velocities. Fix: look for a division by zero or an overflow."
            )


def trial_of(stepper: Stepper, problem: Problem) -> Trial:
    """How a stepper behaves in its first steps on a problem that it can run on.

    Raises:
        UserCodeError: the step raised, or returned something that is no state.
    """
    if stepper.compiled is not None:
        return Trial(stepper.compiled)
    shapes = tuple((np.shape(leaf), np.result_type(leaf)) for leaf in jax.tree.leaves(problem.args))
    key = (_key(stepper), problem.rhs, problem.mechanics, problem.y0.shape, shapes)
    kept = _TRIALS.get(key)
    if kept is None:
        if len(_TRIALS) >= _MOST_KEPT:
            _TRIALS.clear()
        kept = _TRIALS[key] = stepper, _tried(stepper, problem)
    return kept[1]


def _key(stepper: Stepper) -> Hashable:
    """What finds the outcome of a trial again; a user's class may make unhashable objects."""
    if not vars(stepper):
        return type(stepper)
    try:
        hash(stepper)
    except TypeError:
        return id(stepper)
    return stepper


@in_float64
def _tried(stepper: Stepper, problem: Problem) -> Trial:
    t, dt = float(problem.ts[0]), float(frame_lengths(problem)[0]) * _FRACTION
    nudge = 0.125 * problem.scale * np.cos(np.arange(problem.y0.size)).reshape(problem.y0.shape)

    def fresh() -> PythonStepper:
        # A step may have written to the arguments that the last one had.
        return PythonStepper(problem, stepper)

    # Not in the middle of the user's step, whose time counts.
    fresh().compile_right_hand_side(t)
    # As no step would set it.
    errors = np.errstate(all="ignore", under="call", call=lambda *_: None)
    memory = Memory(stepper, ())
    with one_at_a_time(), errors:
        own = fresh()
        before = process_state()
        first = on_user_clock(_python_steps, own, t, dt, 2)
        asks_for_forces, finite = own.calls > 0, bool(np.all(np.isfinite(first)))
        on_user_clock(_python_steps, fresh(), t, dt, 2, nudge)
        again = on_user_clock(_python_steps, fresh(), t, dt, 2)
        side_effects = (
            *on_user_clock(memory_effects, fresh, t, problem.y0, dt),
            *process_effects(before),
        )
        if not np.array_equal(first, again, equal_nan=True):
            # It must not be traced: it would keep a tracer.
            hidden = _hidden_state(memory.changes())
            return Trial(False, hidden, finite, side_effects, asks_for_forces)
        if hidden := on_user_clock(_first_seen, stepper, problem, memory):
            return Trial(False, hidden, finite, side_effects, asks_for_forces)
        loops, fast = _compiled_steps(stepper, problem, t, dt)
        steps = _STEPS_WITH_LOOPS if loops else _STEPS
        quick = None if fast is None else fast(steps)
        # Such a loop would be compiled anew at each step.
        with jax.disable_jit(loops):
            results = Results()
            slow = on_user_clock(_python_steps, fresh(), t, dt, steps, 0.0, results)
            if results.are_written_over and WRITES_OVER not in side_effects:
                side_effects += (WRITES_OVER,)
            if quick is not None and _agree(quick, slow):
                remembers = memory.may_have_changed()
                return Trial(True, "", finite, side_effects, asks_for_forces, remembers)
            again = on_user_clock(_python_steps, fresh(), t, dt, steps)
    same = np.array_equal(slow, again, equal_nan=True)
    hidden = "" if same else _hidden_state(memory.changes())
    remembers = memory.may_have_changed()
    return Trial(False, hidden, finite, side_effects, asks_for_forces, remembers)


def _hidden_state(changes: Sequence[str]) -> str:
    """What a step is called that gives different output, from what changed in its memory."""
    return f"{_NOT_DETERMINISTIC} hidden state ({'; '.join(changes)})" if changes else HIDDEN_STATE


def _first_seen(stepper: Stepper, problem: Problem, memory: Memory) -> str:
    """How its steps depend on the problem and step size that it saw first; empty if they do not.

    If something changed in its memory, it steps on another problem, with another step size: once as
    it is, and once with the memory that it had before it saw any.
    """
    changes = memory.changes()
    if not changes:
        return ""

    def steps() -> np.ndarray:
        return _python_steps(PythonStepper(other, stepper), t, dt, 2)

    try:
        args = jax.tree.map(lambda leaf: _OTHER * leaf, problem.args)
        other = problem.changed(y0=_OTHER * problem.y0, args=args, exact=None)
        t, dt = float(other.ts[0]), float(frame_lengths(other)[0]) * _OTHER * _FRACTION
        later = steps()
        undo = memory.restore()
        try:
            first = steps()
        finally:
            undo()
    except RopeodeError:
        # The other problem cannot be made or solved, which nobody asked for.
        return ""
    if np.array_equal(first, later, equal_nan=True):
        return ""
    return f"{_NOT_DETERMINISTIC} something from its first call ({'; '.join(changes)})"


def _python_steps(
    own: PythonStepper,
    t: float,
    dt: float,
    steps: int,
    nudge: float | np.ndarray = 0.0,
    results: Results | None = None,
) -> np.ndarray:
    carried = own.init(t, own.problem.y0 + nudge, dt)
    for i in range(steps):
        carried = own.step(t + i * dt, carried, dt)
        if results is not None:
            results.keep(carried)
    # A copy: it may be handed out again, with other numbers in it.
    return np.array(own.state(t + steps * dt, carried, dt))


def _compiled_steps(
    stepper: Stepper, problem: Problem, t: float, dt: float
) -> tuple[bool, Callable[[int], np.ndarray] | None]:
    """Whether there are loops of JAX's own in a step, and the state after a number of steps.

    None where JAX cannot trace it, or not in few enough lines, or where it calls Python.
    """
    init, step, state = on_stored_states(stepper, problem.rhs, problem.mechanics)

    def run(args: Any, y: Any, t: Any, dt: Any, steps: Any) -> Any:
        carried = jax.lax.fori_loop(
            0,
            steps,
            lambda i, carried: step(args, t + i * dt, carried, dt),
            init(args, t, y, dt),
        )
        return state(args, t + steps * dt, carried, dt)

    try:
        traced = jax.jit(run).trace(problem.args, problem.y0, t, dt, _STEPS)
        if callbacks_in(traced.jaxpr):
            return False, None
        text = str(traced.jaxpr)
        loops = text.count("while[") + text.count("scan[") > 1
        if text.count("\n") > _MOST_LINES:
            return False, None
        compiled = traced.lower().compile()
    except Exception:
        # Whatever it is: in Python it shows for what it is.
        return False, None

    def fast(steps: int) -> np.ndarray:
        return np.asarray(compiled(problem.args, problem.y0, t, dt, steps))

    return loops, lambda steps: on_user_clock(fast, steps)


def _agree(fast: np.ndarray, slow: np.ndarray) -> bool:
    if not np.array_equal(np.isnan(fast), np.isnan(slow)):
        return False
    difference = np.max(np.abs(np.nan_to_num(fast - slow)), initial=0.0)
    return bool(difference <= _SAME * np.max(np.abs(np.nan_to_num(slow)), initial=0.0))
