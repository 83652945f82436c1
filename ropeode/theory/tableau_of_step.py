"""The tableau of a method, from nothing but its step.

A step asks for slopes, and whoever answers may choose them, so that the coefficients can be read
off what it makes of them. What was read is then tried on nonlinear equations, where step and
tableau must agree to the last digits.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from ropeode.errors import UserCodeError
from ropeode.precision import in_float64
from ropeode.problems import Problem, free_coordinates
from ropeode.simulation import as_seen
from ropeode.steppers import BuiltIn, Stepper, as_stepper
from ropeode.tableaus import NystromTableau, Tableau
from ropeode.theory.reading import ExplicitReading, Iterates, NotASum, read_implicit
from ropeode.theory.recorded_step import Kind, NotReadable, RecordedStep, TooManyCalls
from ropeode.validation import shortly

# The state of a step that is not tried on a problem: numbers, and nodes in space.
_NUMBERS = (24,)
_NODES = (2, 8, 3)
# Times and step sizes of the nonlinear equations, how many steps are made, and how closely step and
# tableau must agree after each. A method of many steps may begin with some of a one-step method.
_NONLINEAR = ((0.4, 0.3), (0.4, 0.05), (1000.0, 0.1))
_NUMBERS_OF_STEPS = (1, 2, 20)
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
    if stepper.moves_links:
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


def _kinds(stepper: Stepper, problem: Problem | None) -> Iterator[Kind]:
    any_ode = stepper.needs == "any ODE"
    if problem is None:
        if any_ode:
            yield Kind(np.zeros(_NUMBERS), np.ones(_NUMBERS, dtype=bool), None, False, False)
        start, free, args = np.zeros(_NODES), np.ones(_NODES[1:], dtype=bool), None
    elif problem.mechanics is None:
        y0 = problem.y0
        yield Kind(y0, np.ones(y0.shape, dtype=bool), problem.args, False, False)
        return
    else:
        turned = problem.mechanics.node_axis == 1
        start = np.stack(tuple(as_seen(problem.y0, problem.mechanics, turned)))
        free, args = free_coordinates(problem), problem.args
        free = free.T if turned else free
    if any_ode:
        yield Kind(start, free, args, True, False)
    yield Kind(start, free, args, True, True)


def _found(stepper: Stepper, kind: Kind) -> Tableau | NystromTableau:
    """Read the tableau and try it: in Python where that will do, which is faster, else in JAX."""
    ways = [False, True]
    if stepper.compiled is False:
        ways = [False]
    elif stepper.compiled and not isinstance(stepper, BuiltIn):
        ways = [True]
    errors: list[UserCodeError] = []
    for in_jax in ways:
        try:
            return _read(RecordedStep(stepper, kind, in_jax), kind)
        except UserCodeError as error:
            errors.append(error)
    raise errors[0]


def _read(step: RecordedStep, kind: Kind) -> Tableau | NystromTableau:
    try:
        reading = ExplicitReading(step, kind.second_order)
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
    y, phase, *factors = np.random.default_rng(15).standard_normal((5, *step.shape))

    def waves(t: float, y: np.ndarray) -> np.ndarray:
        if isinstance(tableau, NystromTableau) and tableau.a is None:
            y = y * [[1.0], [0.0]]
        # Each number is moved by itself, by its neighbour, and by another half, if there is one.
        moved = (y, np.roll(y, 1, axis=1), np.roll(y[::-1], 2, axis=1))
        mixed = sum(factor * each for factor, each in zip(factors, moved, strict=True))
        return np.sin(0.3 * mixed + np.cos(0.7 * t + phase))

    def slope(i: int, t: float, y: np.ndarray) -> np.ndarray:
        return waves(t, y) if isinstance(tableau, Tableau) else np.stack([y[1], waves(t, y)[1]])

    def taken(t: float, y: np.ndarray, dt: float) -> np.ndarray:
        if isinstance(tableau, Tableau):
            return tableau.step(waves, t, y, dt)
        return np.stack(
            tableau.step(lambda t, x, v: waves(t, np.stack([x, v]))[1], t, y[0], y[1], dt)
        )

    for t, dt in _NONLINEAR:
        state, made = y, 0
        for steps in _NUMBERS_OF_STEPS:
            for i in range(made, steps):
                state = taken(t + i * dt, state, dt)
            made = steps
            found = step.run(slope, t, y, dt, steps=steps).result
            size = 1.0 + np.max(np.abs(state))
            if not np.max(np.abs(found - state)) <= steps * _SAME * size:
                raise NotReadable("is nonlinear in the slopes" if steps == 1 else "carries memory")
