"""The leading term of the global error, from the local one along a reference."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from ropeode.precision import in_float64
from ropeode.problems.problem import Problem, Rhs
from ropeode.references.reference import Reference
from ropeode.simulation.method import Method
from ropeode.theory.expansion import Expansion, expanded
from ropeode.theory.flow import long_flow
from ropeode.theory.step_samples import StepSamples

# Local errors are taken so many times in the shortest time over which a step is expanded; and from
# so many rungs of its ladder.
_DENSITY, _RUNGS = 6, 9
# How many states the order is read off at, and the most at which local errors are taken.
_STATES, _MOST = 8, 20_000
# The relative tolerance of the variational equation.
_RTOL = 1e-7


@dataclasses.dataclass(frozen=True, eq=False)
class PredictedError:
    """What a stepper's error is to leading order in dt: ``dt**order * states``.

    Arguments:
        order: at which the error begins, 1 or higher.
        times: the samples that the reference is trusted for, ``(times,)``.
        states: the coefficient of ``dt**order`` at each, signed: ``(times, *state)``.
        uncertain: by how much it may be wrong, as a part of its largest component.
    """

    order: int
    times: np.ndarray
    states: np.ndarray
    uncertain: float


@in_float64
def predicted_error(reference: Reference, method: Method) -> PredictedError | str:
    """The leading term of the global error of a stepper on the problem of a reference.

    With the local error ``dt**(p + 1) d(t, y)``, the error is ``dt**p e(t)`` and higher terms,
    where ``e' = f_y(t, y) e + d(t, y)`` along the solution y, and ``dt**p e(t0)`` is the error
    with which the stepper starts (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations
    I, theorem II.8.1; Henrici, Discrete Variable Methods in Ordinary Differential Equations,
    section 3.3).

    Arguments:
        reference: that the solution is taken from, as far as it is trusted.
        method: the stepper, ready to run on the reference's problem.

    Returns:
        The prediction, or why there is none.

    Raises:
        UserCodeError: the step raised.
    """
    problem = reference.problem
    times, states = problem.ts[: reference.trusted], reference.states[: reference.trusted]
    if problem.jump_times:
        return "the right-hand side jumps"
    if len(times) < 2:
        return "the reference is trusted for no frame"
    samples, frames = StepSamples(problem, method), np.diff(times)
    some = np.unique(np.linspace(0, len(times) - 2, _STATES).astype(int))
    local = expanded(samples, times[some], states[some], float(np.max(frames)))
    order = local.order
    if order is None:
        return f"rounding hides the local error, which is of order {local.seen + 2} or higher"
    if order < 1:
        return "the step solves another equation"
    # A part of each frame, the same for all, in which the solution is smooth.
    part = float(np.nanmin(local.reach)) / float(np.max(frames))
    along = _local_errors(samples, times, states, order, part)
    if isinstance(along, str):
        return along
    begin = local.start(order).value[0]
    fine, coarse = (
        _propagated(problem, times, begin, *(each[::stride] for each in along)) for stride in (1, 2)
    )
    size = float(np.max(np.abs(fine)))
    uncertain = float(np.max(np.abs(fine - coarse))) / size if size else 0.0
    return PredictedError(order, times, fine, uncertain)


def _local_errors(
    samples: StepSamples, times: np.ndarray, states: np.ndarray, order: int, part: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | str:
    """Times along a solution, its states there, and the rates at which the error grows by itself.

    Arguments:
        samples: of the stepper on the problem.
        times: where frames begin, and the last one ends.
        states: of the solution, at these.
        order: of the stepper.
        part: of each frame, within which a step is expanded.

    Returns:
        The arrays with a leading axis of times, an odd number of them; or why there are none.
    """
    frames, count = np.diff(times), 2 * int(np.ceil(_DENSITY / part / 2.0))
    if count * len(frames) > _MOST:
        return "the solution is stiff: it is smooth over a small part of a frame only"
    length = 1.0 + part
    exact = long_flow(samples.rates, times[:-1], states[:-1], length * frames, part)
    if exact is None:
        return "the solution is stiff: it is smooth over a small part of a frame only"
    # The last one is where the last frame ends.
    places = np.arange(count + 1) / count
    moved = exact.increments(places / length)
    t = (times[:-1, None] + places * frames[:, None]).ravel()
    y = (states[:-1, None] + moved).reshape(-1, *states.shape[1:])

    def increments(fractions: np.ndarray) -> np.ndarray:
        ends = ((places[:, None] + part * fractions) / length).ravel()
        ahead = exact.increments(ends).reshape(*moved.shape[:2], -1, *states.shape[1:])
        return (ahead - moved[:, :, None]).reshape(len(t), -1, *states.shape[1:])

    reach = np.repeat(part * frames, len(places))
    zeros = order + 1 if samples.carries_state else order
    local = Expansion(samples, t, y, reach, increments, _RUNGS, zeros)
    rate = local.rate(order).value
    if not local.one_step:
        rate = rate - derivative(samples.problem)(t, y, local.start(order).value)
    # Where one frame ends the next begins.
    keep = np.r_[np.arange(len(t)) % len(places) < count]
    keep[-1] = True
    return t[keep], y[keep], rate[keep]


def _propagated(
    problem: Problem,
    times: np.ndarray,
    begin: np.ndarray,
    t: np.ndarray,
    y: np.ndarray,
    rate: np.ndarray,
) -> np.ndarray:
    """The solution of ``e' = f_y e + rate`` at the sample times, ``(times, *state)``."""
    along = CubicSpline(t, np.stack([y, rate], axis=1))
    along_tangent, shape = derivative(problem), begin.shape
    scale = max(float(np.max(np.abs(rate))) * float(t[-1] - t[0]), float(np.max(np.abs(begin))))

    def slope(t: float, e: np.ndarray) -> np.ndarray:
        y, rate = along(t)
        tangent = e.reshape(1, *shape)
        return (along_tangent(np.array([t]), y[None], tangent)[0] + rate).ravel()

    solution = solve_ivp(
        slope,
        (times[0], times[-1]),
        begin.ravel(),
        method="DOP853",
        t_eval=times,
        rtol=_RTOL,
        atol=_RTOL * scale,
    )
    return solution.y.T.reshape(-1, *shape)


def derivative(problem: Problem) -> Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
    """The derivative of the right-hand side along tangents, for many times and states."""
    along, args = _compiledderivative(problem.rhs), problem.args
    return lambda t, y, tangent: np.asarray(along(t, y, tangent, args))


@functools.lru_cache(maxsize=64)
def _compiledderivative(rhs: Rhs) -> Callable:
    def along(t: Any, y: Any, tangent: Any, args: Any) -> Any:
        return jax.jvp(lambda y: rhs(t, y, args), (y,), (tangent,))[1]

    return jax.jit(jax.vmap(along, in_axes=(0, 0, 0, None)))
