"""The tableau of a method, from nothing but its step.

A step asks for slopes, and whoever answers may choose them, so that the coefficients can be read
off what it makes of them. What was read is then tried on nonlinear equations, where step and
tableau must agree to the last digits.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from ropeode.errors import UserCodeError
from ropeode.precision import in_float64
from ropeode.problems.problem import Problem
from ropeode.simulation.system import as_seen
from ropeode.steppers import as_stepper
from ropeode.steppers.base import BuiltIn, Stepper
from ropeode.theory.explicit_reading import ExplicitReading, Iterates, NotASum, NotReadable
from ropeode.theory.implicit_reading import read_implicit
from ropeode.theory.nystrom import NystromTableau
from ropeode.theory.recorded_step import RecordedStep, TooManyCalls
from ropeode.theory.tableau import Tableau
from ropeode.validation import shortly

# The state of a step that is not tried on a problem: numbers, and nodes in space.
_NUMBERS = (24,)
_NODES = (2, 8, 3)
# Times and step sizes of the nonlinear equations, and how closely step and tableau must agree.
_NONLINEAR = ((0.4, 0.3), (0.4, 0.05), (1000.0, 0.1))
_SAME = 1e-13


class StepTableau(NamedTuple):
    """The tableau of a step.

    Fields:
        tableau: of a Runge-Kutta method; of a Nystrom method, where positions and velocities have
            their own coefficients; None where there is none.
        reason: why there is none, as the end of a sentence that begins with "it"; else empty.
    """

    tableau: Tableau | NystromTableau | None
    reason: str = ""


@in_float64
def tableau_of(stepper: Any, problem: Problem | None = None) -> StepTableau:
    """The tableau of a step, found by watching the step.

    It takes all coefficients from the step, none from what the stepper declares. No statement is
    made unless step and tableau agree to 1e-13 on equations that were not used to find it.

    Arguments:
        stepper: whatever `ropeode.as_stepper` takes.
        problem: what kind of state and which arguments the step is handed. Without one, a step
            for any ODE is tried on plain vectors, then on positions and velocities.

    Returns:
        The tableau, or why there is none. Coefficients are fractions where the step's numbers are
        the roundings of such. Of an implicit step it is found where the stages are at different
        times and have weights, and where the step solves its equations to the last digits.

    Raises:
        InputError: there is no such stepper.
    """
    stepper = as_stepper(stepper)
    if problem is not None:
        stepper = stepper.on(problem.structure)
    if stepper.needs == "nodes in a row":
        return StepTableau(None, "moves nodes in a row, and solves no right-hand side")
    reasons = []
    for kind in _kinds(stepper, problem):
        try:
            return StepTableau(_found(stepper, kind))
        except TooManyCalls:
            return StepTableau(None, "iterates without end")
        except NotReadable as error:
            # A step that treats positions and velocities apart may be one for those alone.
            if isinstance(error, Iterates) or not kind.mechanical:
                return StepTableau(None, str(error))
            reasons.append(str(error))
        except UserCodeError as error:
            reasons.append(f"cannot be watched ({shortly(error.__cause__ or error)})")
    return StepTableau(None, reasons[0])


@dataclasses.dataclass(frozen=True)
class _Kind:
    """What a step may be a method for: which state it has, and what is asked of it."""

    shape: tuple[int, ...]
    args: Any
    mechanical: bool
    second_order: bool


def _kinds(stepper: Stepper, problem: Problem | None) -> Iterator[_Kind]:
    any_ode = stepper.needs == "any ODE"
    if problem is not None and problem.mechanics is None:
        yield _Kind(problem.y0.shape, problem.args, False, False)
        return
    if problem is not None and problem.mechanics is not None:
        args, mechanics = problem.args, problem.mechanics
        shape = as_seen(problem.y0, mechanics, mechanics.node_axis == 1).shape
    else:
        shape, args = _NODES, None
        if any_ode:
            yield _Kind(_NUMBERS, None, False, False)
    if any_ode:
        yield _Kind(shape, args, True, False)
    yield _Kind(shape, args, True, True)


def _found(stepper: Stepper, kind: _Kind) -> Tableau | NystromTableau:
    """Read the tableau and try it: in Python where that will do, which is faster, else in JAX."""
    ways = [False, True]
    if stepper.compiled is False:
        ways = [False]
    elif stepper.compiled and not isinstance(stepper, BuiltIn):
        ways = [True]
    errors: list[UserCodeError] = []
    for in_jax in ways:
        step = RecordedStep(
            stepper, kind.shape, mechanical=kind.mechanical, args=kind.args, in_jax=in_jax
        )
        try:
            return _read(step, kind)
        except UserCodeError as error:
            errors.append(error)
    raise errors[0]


def _read(step: RecordedStep, kind: _Kind) -> Tableau | NystromTableau:
    try:
        reading = ExplicitReading(step, 2 if kind.second_order else 1)
        reading.check()
        tableau = reading.nystrom() if kind.second_order else reading.runge_kutta()
    except NotASum as explicit:
        if kind.second_order:
            raise
        try:
            tableau = read_implicit(step)
            _check_nonlinear(step, tableau)
        except NotReadable:
            raise explicit from None
        return tableau
    _check_nonlinear(step, tableau)
    return tableau


def _check_nonlinear(step: RecordedStep, tableau: Tableau | NystromTableau) -> None:
    """See that step and tableau agree on a nonlinear equation that depends on time.

    Raises:
        NotReadable: they do not.
    """
    random = np.random.default_rng(15)
    size = int(np.prod(step.shape))
    matrix = random.standard_normal((size, size)) / np.sqrt(size)
    y, phase = random.standard_normal((2, size))
    if isinstance(tableau, NystromTableau) and tableau.a is None:
        matrix[:, size // 2 :] = 0.0

    def waves(t: float, y: np.ndarray) -> np.ndarray:
        return np.sin(matrix @ y.reshape(-1) + np.cos(0.7 * t + phase)).reshape(step.shape)

    def slope(i: int, t: float, y: np.ndarray) -> np.ndarray:
        return waves(t, y) if isinstance(tableau, Tableau) else np.stack([y[1], waves(t, y)[1]])

    def taken(t: float, y: np.ndarray, dt: float) -> np.ndarray:
        if isinstance(tableau, Tableau):
            return tableau.step(waves, t, y, dt)
        return np.stack(
            tableau.step(lambda t, x, v: waves(t, np.stack([x, v]))[1], t, y[0], y[1], dt)
        )

    for t, dt in _NONLINEAR:
        state = y.reshape(step.shape)
        for steps, what in ((1, "is nonlinear in the slopes"), (2, "carries memory")):
            state = taken(t + (steps - 1) * dt, state, dt)
            found = step.run(slope, t, y.reshape(step.shape), dt, steps=steps).result
            if not np.max(np.abs(found - state)) <= _SAME * (1.0 + np.max(np.abs(state))):
                raise NotReadable(what)
