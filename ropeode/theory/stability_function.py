"""The stability function of a stepper: by what a step multiplies modes of linear equations."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal

import numpy as np

from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.simulation import Method, method_of
from ropeode.theory.linear_method import FIRST_ORDER, OSCILLATOR, LinearEquation, LinearMethod

# Points on circles about zero, whose terms are zero from a quarter of this number on.
_POINTS, _CIRCLES = 128, (0.5, 0.25, 0.0625)
_ROUNDING = 1e-12
# Modes without any symmetry. An implicit step far away is one too.
_GENERIC = np.array([0.3 + 0.4j, -0.7 + 0.5j, -0.2 - 0.9j])
_TOLERANCE = 1e-8
_QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])
# Times, step sizes and sizes of states at which the step has to be the same linear map.
_CASES = (
    (0.0, 1.0, 1.0),
    (0.0, 1.0, 1e-6),
    (0.0, 1.0, 1e6),
    (37.25, 1.0, 1.0),
    (0.0, 2.0**-12, 1.0),
    (0.0, 2.0**6, 1.0),
)
_UNSETTLED = "it has not settled after 16 steps: later steps are not one matrix of what is carried"


@dataclasses.dataclass(frozen=True)
class LeadingTerm:
    """``coefficient * z**power``.

    Arguments:
        coefficient: real.
        power: a whole number.
    """

    coefficient: float
    power: int


@dataclasses.dataclass(frozen=True, eq=False)
class StabilityFunction:
    """By what one step multiplies a mode ``exp(lambda t)`` of a linear equation, at z = dt lambda.

    A step for any ODE multiplies the solution of ``y' = lambda y`` by R(z). One for mechanical
    problems is judged on ``x'' = -omega^2 x - 2 gamma x'``, which has two modes: z stands for
    the oscillation whose modes are z and its conjugate, so that ``dt omega = |z|`` and the
    damping ratio ``gamma/omega`` is ``-Re z/|z|``. Where a step has memory, it multiplies what it
    carries by a matrix, and R(z) is the eigenvalue nearest to exp(z).

    Source: Hairer, Wanner, Solving Ordinary Differential Equations II, section IV.2; with memory,
    section V.1.

    Arguments:
        stepper: its name with options.
        equation: on which it was judged.
        damped: whether it takes an oscillator with damping; without, z is imaginary.
        amplification: the leading term in y of ``ln |R(iy)|``, which is the growth in a step
            of an oscillation that should keep its size; None if it keeps it to rounding.
    """

    stepper: str
    equation: Literal["y' = lambda y", "x'' = -omega^2 x - 2 gamma x'"]
    damped: bool
    amplification: LeadingTerm | None
    _method: LinearMethod = dataclasses.field(repr=False, compare=False)

    @in_float64
    def radius(self, z: Any, other: Any = None) -> np.ndarray:
        """The largest factor by which anything grows in a step, in the shape of `z`.

        Arguments:
            z: complex, of any shape.
            other: the second mode of each oscillator; by default the conjugate of the first.
                Of no meaning for a step for any ODE.

        Returns:
            ``|R(z)|``, or the spectral radius of what is carried; infinite where the step is not
            finite.
        """
        z = np.asarray(z, dtype=complex)
        # As R of the conjugate is the conjugate of R.
        flat = np.where(z.imag < 0, z.conj(), z).ravel()
        partner = flat.conj() if other is None else np.asarray(other, dtype=complex).ravel()
        matrices = self._method.matrices(self._method.equation.modes(flat, partner))
        found = np.max(np.abs(_eigenvalues(matrices)), axis=1)
        return np.where(np.isfinite(found), found, np.inf).reshape(z.shape)

    @property
    def is_quick(self) -> bool:
        """Whether thousands of values cost little; not those of a step in Python."""
        return self._method.is_compiled


@in_float64
def stability_function_of(problem: Problem, stepper: Any) -> StabilityFunction | str:
    """The stability function of a stepper, from its own steps.

    It is tried on ``y' = lambda y`` with complex lambda first, as a real system of two equations,
    and if it is no step for any ODE on the oscillator. That it is the same linear map for small
    and for large states, at other times, and at other step sizes for the same z, is checked.

    Arguments:
        problem: on which the stepper runs; if that is not mechanical, the oscillator is not tried.
        stepper: whatever `ropeode.as_stepper` takes.

    Returns:
        Why there is none, if so: a sentence for each equation that was tried.

    Raises:
        InputError: there is no such stepper, or it cannot run on the problem.
        UserCodeError: a user's step raised on that problem.
    """
    method = method_of(stepper, problem)
    first = _on(FIRST_ORDER, method)
    if isinstance(first, StabilityFunction) or problem.mechanics is None:
        return first
    second = _on(OSCILLATOR, method)
    return second if isinstance(second, StabilityFunction) else f"{first} {second}"


def _on(equation: LinearEquation, method: Method) -> StabilityFunction | str:
    """The stability function on one of the test equations."""
    found, name = LinearMethod(equation, method), equation.name
    args, damped = equation.modes(_GENERIC, -_GENERIC), True
    if why := _refusal(found, method, args):
        return f"On {name} {why}."
    if equation is OSCILLATOR:
        with_damping = equation.modes(_GENERIC, _GENERIC.conj())
        damped = method.stepper.needs != "second order, no damping" and not _refusal(
            found, method, with_damping
        )
        # What is a one-step method without damping may have memory with it.
        args = np.concatenate([args, with_damping]) if damped else args
    if not found.settle(args):
        return f"On {name} {_UNSETTLED}."
    return StabilityFunction(
        stepper=method.stepper.label,
        equation=name,
        damped=damped,
        amplification=_amplification(found),
        _method=found,
    )


def _refusal(found: LinearMethod, method: Method, args: np.ndarray) -> str | None:
    """Why the stepper is no linear map on a test equation; None if it is one."""
    if method.stepper.refusal(found.problem):
        return "it cannot run, since it needs another kind of problem"
    try:
        return _is_linear(found, args)
    except Exception as error:
        # Whatever it is: the step is not made for this equation.
        cause = error.__cause__ or error
        return f"it raises {type(cause).__name__}: {' '.join(str(cause).split())[:120]}"


def _is_linear(method: LinearMethod, args: np.ndarray) -> str | None:
    """What keeps it from being one linear map of z alone; None if nothing does.

    Arguments:
        method: is asked for runs.
        args: generic ones of its equation at dt = 1.
    """
    matrices = method.powers(args)
    y = np.random.default_rng(7).normal(size=(len(args), method.size))
    expected = np.einsum("kirc,kc->kir", matrices, y)
    largest = np.max(np.abs(expected))
    if method.size == len(_QUARTER):
        # To turn by a quarter before or after must be the same.
        turned = matrices @ _QUARTER - _QUARTER @ matrices
        if not np.max(np.abs(turned)) <= _TOLERANCE * largest:
            return "it treats the two components of the state in different ways"
    for t, dt, size in _CASES:
        units = np.float64(dt) ** np.array(method.equation.powers)
        own, state = units[: args.shape[1]], size * units[args.shape[1] :]
        with np.errstate(all="ignore"):
            found = [
                method.runs(row, (start * state)[None], t, dt)[0] / state
                for row, start in zip(args * own, y, strict=True)
            ]
            off = np.max(np.abs(found - expected))
        if off <= _TOLERANCE * largest:
            continue
        if t:
            return f"it depends on time: at t = {t:g} it is another step than at 0"
        if dt != 1.0:
            return (
                f"the step of size {dt:g} is not that of size 1 at the same dt lambda, so that "
                "there is no function of dt lambda alone"
            )
        return f"it is not linear: states of size {size:g} do not move by a matrix"
    return None


def _amplification(method: LinearMethod) -> LeadingTerm | None:
    """The leading term in y of ``ln |R(iy)|``; None if there is none above rounding.

    The Taylor coefficients of ``ln(R(z)/exp(z))`` are real, so that at z = iy those of even powers
    make its real part. Circles shrink until none of the branch points, where R would be another
    eigenvalue, is inside.
    """
    for size in _CIRCLES:
        points = size * np.exp(2j * np.pi * np.arange(_POINTS) / _POINTS)
        with np.errstate(all="ignore"):
            relative = np.log(_principal(method, points) / np.exp(points))
        terms = np.fft.fft(relative).real / _POINTS
        if np.max(np.abs(terms[_POINTS // 4 : _POINTS // 2])) <= _ROUNDING:
            break
    for power in range(0, _POINTS // 8, 2):
        if np.abs(terms[power]) > _ROUNDING:
            sign = (-1.0) ** (power // 2)
            return LeadingTerm(float(sign * terms[power] / size**power), power)
    return None


def _principal(method: LinearMethod, z: np.ndarray) -> np.ndarray:
    """The eigenvalue nearest to exp(z); for oscillators without damping, ``x'' = z^2 x``."""
    eigenvalues = _eigenvalues(method.matrices(method.equation.modes(z, -z)))
    nearest = np.argmin(np.abs(eigenvalues - np.exp(z)[:, None]), axis=1)
    return eigenvalues[np.arange(len(z)), nearest]


def _eigenvalues(matrices: np.ndarray) -> np.ndarray:
    """``(cases, size)``; infinite where a matrix is not finite."""
    finite = np.all(np.isfinite(matrices), axis=(1, 2))
    found = np.full(matrices.shape[:2], np.inf, dtype=complex)
    found[finite] = np.linalg.eigvals(matrices[finite])
    return found
