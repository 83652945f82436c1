"""The largest Lyapunov exponent: how fast neighbouring solutions separate, or converge."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from scipy import special

from ropeode.display import Tabular
from ropeode.json_form import json_shows
from ropeode.precision import in_float64
from ropeode.problems import Problem, free_coordinates, require_problem
from ropeode.progress import Progress, bar, shows_progress
from ropeode.references import EXPLICIT_SOLVERS, IMPLICIT_SOLVERS, Solver, solve, step_budget
from ropeode.validation import bad_value, check_positive, check_whole

# Frames are divided until there are so many samples, to have something to average.
_SAMPLES = 100
_BATCHES = 10
_CONFIDENCE = 0.95


@json_shows("value", "ci95=interval", "sign", "resolution", "span", "failure")
@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class LyapunovExponent(Tabular):
    """The mean rate at which neighbouring solutions separate, from a finite span.

    Arguments:
        value: per time unit, the mean over the second half of the span and over the tangents.
            During the first half the tangents turn to the fastest direction.
        interval: the 95% interval; never narrower than `resolution` to each side.
        resolution: what a separation that grows like t^2, and not exponentially, shows as a
            rate in the second half of this span: ``2 ln 2 / (span / 2)``.
        times: that the solver reached, ``(times,)``: the sample times, and others between them
            if there are fewer than 100 frames.
        log_growth: ln of the factor by which each tangent has grown up to each sample,
            ``(tangents, times)``.
        solver: that integrated state and tangents together.
        rtol: its relative tolerance.
        failure: why it did not reach the last sample; None if it did.

    Examples:
        >>> from ropeode import load, lyapunov_exponent
        >>> exponent = lyapunov_exponent(load("lorenz").problem)
        >>> exponent.interval[0] > 0, round(exponent.resolution, 3)
        (True, 0.055)
    """

    value: float
    interval: tuple[float, float]
    resolution: float
    times: np.ndarray
    log_growth: np.ndarray
    solver: Solver
    rtol: float
    failure: str | None

    @property
    def span(self) -> float:
        """The time from the first sample to the last that was reached."""
        return float(self.times[-1] - self.times[0])

    @property
    def sign(self) -> Literal["positive", "negative", "not told from zero"]:
        """`positive` or `negative` if the whole interval is, else `not told from zero`."""
        low, high = self.interval
        if low > 0:
            return "positive"
        return "negative" if high < 0 else "not told from zero"


@shows_progress
@in_float64
def lyapunov_exponent(
    problem: Problem,
    *,
    tangents: int = 3,
    rtol: float = 1e-10,
    progress: Progress = bar,
) -> LyapunovExponent:
    """Measure the largest Lyapunov exponent along a problem's solution.

    With the state y the directions u of small disturbances are integrated, and their size:
    ``u' = J u - r u`` and ``(ln s)' = r`` with ``r = (u, J u) / (u, u)`` and J the derivative
    of the right-hand side. That is the method of Benettin et al., with continuous
    instead of occasional renormalisation, so that no step has to end for it.

    Where the exponent is positive, rounding separates the computed solution from the true one.
    From there on the exponent is that of another solution of the same equations: the same on an
    attractor or on an energy surface that solutions fill, but not in general.

    Where differentiated constraints are part of the equations, disturbances off the constraints
    neither grow nor decay by much. The solver's errors introduce them, so that a negative
    exponent is lost after some ``ln(1/rtol) / |value|`` time units.

    The interval comes from the means over ten pieces of the second half (batch means), from its
    drift, or from the spread of the tangents, whichever is widest. It covers the mean
    rate of *this span*. A span shorter than the slowest motion of the solution, such as
    the period of an orbit, says nothing about later times.

    Sources: Benettin, Galgani, Giorgilli, Strelcyn, Meccanica 15 (1980) 9-20 and 21-30;
    Christiansen, Rugh, Nonlinearity 10 (1997) 1063-1072 (the continuous form); Schmeiser,
    Operations Research 30 (1982) 556-568 (batch means).

    Arguments:
        problem: whose sample times say where to start and how far to go.
        tangents: how many directions, drawn at random. Coordinates that are held and
            directions that the constraints do not allow are left out.
        rtol: relative tolerance for state and tangents.
        progress: called before each run, with what it is.

    Returns:
        The exponent per unit of the problem's time.

    Raises:
        InputError: an argument cannot be used, or the solver stops in the first tenth.

    Examples:
        >>> from ropeode import load, lyapunov_exponent
        >>> lyapunov_exponent(load("lorenz").problem)
        <LyapunovExponent: ... per time unit, positive; over 50 time units>
    """
    require_problem(problem)
    problem.require_equations()
    tangents = check_whole("tangents", tangents, at_least=1, example="3")
    rtol = check_positive("rtol", rtol, example="1e-10")
    directions = _directions(problem, tangents)
    together = Problem(
        rhs=_WithTangents(problem.rhs, problem.y0.shape, tangents),
        # Of the state's size, so that one absolute tolerance is right for both.
        y0=np.concatenate(
            [problem.y0.ravel(), problem.scale * directions.ravel(), np.zeros(tangents)]
        ),
        ts=divided(problem.ts),
        args=problem.args,
        name=problem.name,
        jump_times=problem.jump_times,
    )
    solutions, budget = [], step_budget(problem)
    for method in (EXPLICIT_SOLVERS, IMPLICIT_SOLVERS):
        progress(f"Lyapunov exponent: {method.primary} at {rtol:.0e}", None)
        solution = solve(together, method.primary, rtol, rtol * problem.scale, max_steps=budget)
        solutions.append(solution)
        if solution.failure is None or solution.steps < budget:
            break
    solution = max(solutions, key=lambda each: len(each.states))
    times = together.ts[: len(solution.states)]
    if len(times) <= len(together.ts) // 10:
        raise bad_value(
            "problem",
            f"{problem.name}, with which {solution.solver} {solution.failure}",
            "a problem that the solver can follow to the end, with its tangents",
            "end it earlier",
        )
    log_growth = solution.states[:, -tangents:].T
    value, interval, resolution = _mean_rate(times, log_growth)
    return LyapunovExponent(
        value=value,
        interval=interval,
        resolution=resolution,
        times=times,
        log_growth=log_growth,
        solver=solution.solver,
        rtol=solution.rtol,
        failure=solution.failure,
    )


@dataclasses.dataclass(frozen=True)
class _WithTangents:
    """The right-hand side for a flat state, its tangents, and the logarithms of their growth.

    Equal ones make equal (and equally hashed) forms, so that compiled code is found again.
    """

    rhs: Callable
    shape: tuple[int, ...]
    tangents: int

    def __call__(self, t: Any, y: Any, args: Any) -> Any:
        """The derivative, of the same shape."""
        size = math.prod(self.shape)
        state, directions = y[:size], y[size : size * (1 + self.tangents)].reshape(-1, size)

        def field(state: Any) -> Any:
            return self.rhs(t, state.reshape(self.shape), args).reshape(-1)

        slope, push = jax.linearize(field, state)
        pushed = jax.vmap(push)(directions)
        rates = jnp.sum(directions * pushed, axis=1) / jnp.sum(directions**2, axis=1)
        turned = pushed - rates[:, None] * directions
        return jnp.concatenate([slope, turned.reshape(-1), rates])


def divided(ts: np.ndarray) -> np.ndarray:
    """Sample times with each frame divided evenly, so that there are 100 samples or more."""
    parts = math.ceil(_SAMPLES / (len(ts) - 1))
    return np.interp(np.arange((len(ts) - 1) * parts + 1), parts * np.arange(len(ts)), ts)


def _directions(problem: Problem, tangents: int) -> np.ndarray:
    """Unit vectors, ``(tangents, size)``, along which the problem can be disturbed at all."""
    free = np.ones(problem.y0.shape)
    if problem.mechanics is not None:
        free = free * free_coordinates(problem)
    drawn = np.random.default_rng(1).normal(size=(tangents, free.size)) * free.ravel()
    if problem.constraints is not None:
        constraints, start = problem.constraints, float(problem.ts[0])

        def residual(y: Any) -> Any:
            return ravel_pytree(constraints(start, y.reshape(problem.y0.shape), problem.args))[0]

        normal = np.asarray(jax.jacfwd(residual)(problem.y0.ravel())) * free.ravel()
        drawn = drawn - drawn @ np.linalg.pinv(normal) @ normal
    return drawn / np.linalg.norm(drawn, axis=1, keepdims=True)


def mean_slope(x: np.ndarray, series: np.ndarray) -> tuple[float, float]:
    """The mean slope of a series from end to end, and half its 95% interval.

    By batch means: ten pieces whose slopes count as independent. What drifts from the first
    half to the second is no mean, and widens the interval.

    Arguments:
        x: increasing, ``(samples,)``; five intervals or more.
        series: ``(samples,)``.
    """
    batches = min(_BATCHES, len(x) - 1)
    ends = np.round(np.linspace(0, len(x) - 1, batches + 1)).astype(int)
    slopes = np.diff(series[ends]) / np.diff(x[ends])
    quantile = special.stdtrit(batches - 1, 0.5 + _CONFIDENCE / 2)
    scatter = float(quantile) * float(np.std(slopes, ddof=1)) / math.sqrt(batches)
    first, middle, last = 0, len(x) // 2, len(x) - 1
    halves = [
        (series[end] - series[start]) / (x[end] - x[start])
        for start, end in ((first, middle), (middle, last))
    ]
    value = float((series[-1] - series[0]) / (x[-1] - x[0]))
    return value, max(scatter, abs(float(halves[1] - halves[0])) / 2)


def _mean_rate(
    times: np.ndarray, log_growth: np.ndarray
) -> tuple[float, tuple[float, float], float]:
    """The mean rate over the second half, its interval, and the resolution."""
    half = len(times) // 2
    slopes = [mean_slope(times[half:], series[half:]) for series in log_growth]
    rates = [rate for rate, _ in slopes]
    value = float(np.mean(rates))
    span = float(times[-1] - times[half])
    resolution = 2 * math.log(float(times[-1] - times[0]) / float(times[half] - times[0])) / span
    half_width = max([width for _, width in slopes] + [float(np.ptp(rates)) / 2, resolution])
    return value, (value - half_width, value + half_width), resolution
