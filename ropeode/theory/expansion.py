"""The expansion of a step in dt at single states: where it parts from the exact flow."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.theory.extrapolation import RUNGS, STEP_LADDER, coefficient
from ropeode.theory.flow import short_flow
from ropeode.theory.step_samples import StepSamples

# The highest order that is looked for.
HIGHEST_ORDER = 10
# A coefficient is known if it is so many times its error. It counts as zero if it is less than so
# many times its error, and this is small beside the solution's own coefficient: by the third factor
# up to the fourth, and by ten times as much at each after that, for methods of high order have
# small error constants. What lies between is neither.
_CERTAIN, _LOST, _RESOLVED = 10.0, 3.0, 1e-3
_EPS = float(np.finfo(np.float64).eps)
# In roundings of its largest component: what a state may hold, how far a state is disturbed to see
# what its rounding does to the right-hand side, and how closely two steps must be the same as one
# after another.
_ROUNDINGS, _DISTURBANCE, _SAME = 4.0, 64.0, 1e4
# Steps of a method with memory, and how many of the first are left to its start.
EXPANSION_STEPS, SETTLED = 10, 3
# So many more of a user's, which may begin as another method than it goes on as.
_BEGINNING = 3
# By how much of the right-hand side two steps in a row must differ that are still settling.
_SETTLING = 1e-2
# The most terms that are fitted to what the steps show, and how many steps are left out to see what
# the fit owes to them.
_MOST_TERMS, _LEFT_OUT = 7, 1


class Term(NamedTuple):
    """A coefficient of the error's expansion, at each of several states.

    Fields:
        value: ``(states, *state)``.
        error: of the largest component of each quantity, estimated, ``(quantities, states)``.
        known: whether it is certainly not zero, ``(quantities, states)``.
        zero: whether it is zero, as closely as rounding lets it be seen.
        natural: the size of the solution's own coefficient, or that of the next power of dt.
    """

    value: np.ndarray
    error: np.ndarray
    known: np.ndarray
    zero: np.ndarray
    natural: np.ndarray


class Expansion:
    """The error of n steps, ``sum of dt**p (start_p + n dt rate_p + ...)``, at several states.

    At p = -1 there is a term for a step that is not the identity at dt = 0; at p = 0 for one that
    solves another equation, ``y' = f + rate_0``; a method of order p begins with `start_p` and
    `rate_p`. Of a one-step method ``dt**(p + 1) rate_p`` is the local error, and all starts are
    zero.

    Arguments:
        samples: of the stepper on a problem.
        t: times, ``(states,)``.
        y: states, ``(states, *state)``.
        reach: how long the exact solution from each state is known, ``(states,)``.
        increments: how far it moves in fractions of that, ``(fractions,)``:
            ``(states, fractions, *state)``.
        rungs: how many of the ladder's are used, from the longest.
        zeros: how many powers of dt are known to be missing from the error of n steps.
        settled: how many of the first steps of a method with memory are left to its start.
        one_step: whether n steps are known to be n times one step; otherwise it is found out.

    Attributes:
        samples, reach: as given.
        slopes: the right-hand side, ``(states, *state)``.
        ladder: the longest step made at each state, ``(states,)``.
        one_step: whether n steps are n times one step. If not, what the step carries remembers
            more than the state.

    Raises:
        UserCodeError: the step raised.
    """

    @in_float64
    def __init__(
        self,
        samples: StepSamples,
        t: np.ndarray,
        y: np.ndarray,
        reach: np.ndarray,
        increments: Callable[[np.ndarray], np.ndarray],
        rungs: int = RUNGS,
        zeros: int = 0,
        settled: int = SETTLED,
        one_step: bool = False,
    ):
        self.samples, self.problem = samples, samples.problem
        self.t, self.y, self.reach = t, y, reach
        self.slopes = samples.rates(t, y)
        # What a step that projects leaves of the constraints is in the state, and it settles as
        # memory does.
        one_step = one_step or (samples.carries_state and not self.problem.rigid)
        steps = 1 if one_step else EXPANSION_STEPS
        if samples.may_begin and not one_step:
            settled, steps = settled + _BEGINNING, steps + _BEGINNING
        self.ladder = reach / steps
        dt = self.ladder[:, None] * STEP_LADDER[:rungs]
        states = samples.after(t, y, dt, steps)
        self.one_step = steps == 1 or _is_one_step(samples, t, y, dt, states)
        self._settling = self.one_step and steps > 1 and _settles(samples, t, dt, states)
        self.one_step &= not self._settling
        if self.one_step and steps > 1:
            # One step may be as long as the solution is smooth.
            self.ladder, dt = reach, dt * steps
            states, steps = samples.after(t, y, dt, 1), 1
        every = range(1, 2) if self.one_step else range(settled, steps + 1)
        moved = {n: increments(n / steps * STEP_LADDER[:rungs]) for n in every}
        errors = {n: (states[:, :, n] - y[:, None]) - moved[n] for n in every}
        noise = _noise(samples, t, y, dt, errors[every[0]]).reshape(-1, rungs)
        self._missing, self._settled = zeros, settled
        self._terms: dict[tuple[int, int], Term] = {}
        self._series = {
            n: _Series(self._functions(errors[n]), self._functions(moved[n]), n * noise, zeros)
            for n in every
        }

    def rate(self, order: int) -> Term:
        """The growth of the error of this order per unit of time."""
        return self._term(order + 1, 1)

    def start(self, order: int) -> Term:
        """The error of this order at the start."""
        return self._term(order, 0)

    def swing(self, order: int) -> np.ndarray:
        """How far the error of this order swings from step to step, ``(states,)``.

        What a root of the method at -1 has set swinging does not die away.
        """
        if self.one_step or order < self._missing:
            return np.zeros(len(self.t))
        shape = (len(self.problem.quantities), len(self.t))
        *_, before, here, after = (each[order] for each in self._series.values())
        swing = _largest(after.value - 2.0 * here.value + before.value) / 4.0
        known = swing > _CERTAIN * (before.error + here.error + after.error)
        return np.max(np.where(known, swing, 0.0).reshape(shape), axis=0) / self.ladder**order

    def at_zero(self) -> tuple[np.ndarray, Term]:
        """What a settled step does at dt = 0: the states before it, and how it changes them."""
        if self.one_step:
            return self.y, self.rate(-1)
        before, after = (self._series[n][0] for n in (self._settled, self._settled + 1))
        shape = (len(self.problem.quantities), len(self.t))
        base, change = map(self._states, (before.value, after.value - before.value))
        error = before.error + after.error
        known = _largest(after.value - before.value) > _CERTAIN * error
        zero = ~known & (error <= _RESOLVED * before.natural)
        parts = (each.reshape(shape) for each in (error, known, zero, before.natural))
        return self.y + base, Term(change, *parts)

    @functools.cached_property
    def orders(self) -> np.ndarray:
        """Of the first term of each quantity that is known not to be zero.

        Returns:
            ``(quantities, states)``; not-a-number where all terms are zero or lost in rounding.
        """
        orders = np.full((len(self.problem.quantities), len(self.t)), np.nan)
        for order in range(-1, HIGHEST_ORDER + 1):
            known = self.start(order).known | self.rate(order).known
            orders[np.isnan(orders) & known] = order
            if not np.any(np.isnan(orders)):
                break
        return orders

    @functools.cached_property
    def seen(self) -> int:
        """The order up to which the terms of each quantity are known or zero at enough states.

        It is -2 where none are.
        """
        for order in range(-1, HIGHEST_ORDER + 1):
            if not self._is_seen(order):
                return order - 1
        return HIGHEST_ORDER

    @functools.cached_property
    def order(self) -> int | None:
        """Of the step at these states: that of the first term that is not zero at any of them.

        None where rounding hides the terms before one is known; the order is then above `seen`.
        """
        for order in range(-1, HIGHEST_ORDER + 1):
            if np.any(self.start(order).known | self.rate(order).known):
                return order
            if not self._is_seen(order):
                return None
        return None

    def _is_seen(self, order: int) -> bool:
        """Whether each quantity has terms of this order that are known, or zero.

        At most states they must be; one state may be special, for at rest much is zero that is not
        so elsewhere. Of a one-step method one will do, if at most others nothing speaks against
        zero.
        """
        for term in (self.start(order), self.rate(order)):
            clear = term.zero | term.known
            size = _largest(_by_quantity(self.problem, term.value[:, None])[..., 0, :])
            likely = clear | (size <= term.error) if self.one_step else clear
            if not np.all(np.any(clear, axis=1) & (np.mean(likely, axis=1) > 0.5)):
                return False
        return True

    def _term(self, power: int, growth: int) -> Term:
        """The coefficient of ``dt**power n**growth``."""
        if (power, growth) not in self._terms:
            self._terms[power, growth] = self._new_term(power, growth)
        return self._terms[power, growth]

    def _new_term(self, power: int, growth: int) -> Term:
        shape = (len(self.problem.quantities), len(self.t))
        if power < self._missing or (self.one_step and not growth):
            none = np.zeros(shape)
            return Term(np.zeros_like(self.y), none, none > 0.0, none == 0.0, none)
        if self.one_step:
            value, error, natural = self._series[1][power]
        else:
            degrees = np.tile(self._degrees(power), shape[0])
            value, error, natural = _in_steps(self._series, power, growth, degrees)
        known = _largest(value) > _CERTAIN * error
        zero = (_largest(value) <= _LOST * error) & (error <= _resolved(power) * natural)
        if self._settling and power > 0:
            # It may take more steps than are made here, and its first ones look like growth.
            known, zero = np.zeros_like(known), np.zeros_like(zero)
        unit = self.ladder**power
        return Term(
            self._states(value.reshape(*shape, -1) / unit[:, None]),
            error.reshape(shape) / unit,
            known.reshape(shape),
            (zero & ~known).reshape(shape),
            natural.reshape(shape) / unit,
        )

    def _degrees(self, power: int) -> np.ndarray:
        """The highest power of n that comes with a power of dt, ``(states,)``.

        The error of order p moves with the time ``n dt``, so that ``dt**p (n dt)**k`` appear, from
        the first p on at which there is an error. What is done at each step whatever dt is, as by
        a factor, makes all powers of n.
        """
        degrees = np.full(len(self.t), 1 if power else _MOST_TERMS - 1)
        for order in range(power - 1, -2, -1):
            terms = [self.start(order), *([self.rate(order)] if order < power - 1 else [])]
            zero = np.all([each.zero for each in terms], axis=(0, 1))
            degrees[~zero] = power - order if order >= 0 else _MOST_TERMS - 1
        return degrees

    def _states(self, values: np.ndarray) -> np.ndarray:
        """The opposite of `_functions`, of values without rungs: ``(states, *state)``."""
        by_quantity = values.reshape(len(self.problem.quantities), len(self.t), -1)
        return np.moveaxis(by_quantity, 0, 1).reshape(self.y.shape)

    def _functions(self, states: np.ndarray) -> np.ndarray:
        """States ``(states, rungs, *state)`` as ``(quantities * states, rungs, components)``."""
        return _by_quantity(self.problem, states).reshape(-1, states.shape[1], self._components)

    @property
    def _components(self) -> int:
        return self.y[0].size // len(self.problem.quantities)


def expanded(samples: StepSamples, t: np.ndarray, y: np.ndarray, longest: float) -> Expansion:
    """The expansion of a step at several states.

    Arguments:
        samples: of the stepper on a problem.
        t: times, ``(states,)``.
        y: states, ``(states, *state)``.
        longest: step that may be made, in the problem's unit of time.

    Raises:
        UserCodeError: the step raised.
    """
    exact = short_flow(samples.rates, t, y, longest)
    return Expansion(samples, t, y, exact.length, exact.increments)


class _Coefficient(NamedTuple):
    """As `coefficient` returns it, and the size that is natural for it, ``(functions,)``."""

    value: np.ndarray
    error: np.ndarray
    natural: np.ndarray


class _Series:
    """The coefficients of the error after a number of steps, one after the other.

    Arguments:
        errors: on the ladder, ``(functions, rungs, components)``.
        moved: how far the solution moves, of the same shape.
        noise: how far rounding moves an error, ``(functions, rungs)``.
        zeros: how many of the first coefficients are known to be zero.
    """

    def __init__(self, errors: np.ndarray, moved: np.ndarray, noise: np.ndarray, zeros: int):
        self._errors, self._moved, self._noise, self._first = errors, moved, noise, zeros
        self._found: list[_Coefficient] = []
        self._zeros = np.full(len(errors), zeros)
        # The solution does not move at dt = 0.
        known = np.ones_like(self._zeros)
        self._own = functools.cache(
            lambda power: _largest(coefficient(moved, noise, power, known)[0])
        )

    def __getitem__(self, power: int) -> _Coefficient:
        while len(self._found) <= power - self._first:
            self._find(self._first + len(self._found))
        return self._found[power - self._first]

    def _find(self, power: int) -> None:
        value, error = coefficient(self._errors, self._noise, power, self._zeros)
        natural = self._natural(power)
        zero = (_largest(value) <= _CERTAIN * error) & (error <= _resolved(power) * natural)
        self._zeros[zero & (self._zeros == power)] = power + 1
        self._found.append(_Coefficient(value, error, natural))

    def _natural(self, power: int) -> np.ndarray:
        """The size of the solution's own coefficients of this power and the next one."""
        if not power:
            return _largest(self._moved[:, 0])
        return np.maximum(self._own(power), self._own(power + 1))


def _resolved(power: int) -> float:
    """How small the error of a coefficient must be, beside the solution's own."""
    return _RESOLVED * 10.0 ** -max(0, power - 4)


def _in_steps(
    series: dict[int, _Series], power: int, growth: int, degrees: np.ndarray
) -> _Coefficient:
    """The coefficient of ``dt**power n**growth``.

    At a fixed power of dt the error after n steps is a polynomial in n, at most of a known degree,
    once what the start has set swinging has died away, or is fitted with it. Of several such fits
    the one is taken whose estimated error is smallest. What does not fit counts as uncertainty, and
    so does what the fit owes to the first steps or to the last: what dies away slowly looks like a
    polynomial of high degree, but like another one later.
    """
    every = [each[power] for each in series.values()]
    values, errors = (np.stack([each[i] for each in every]) for i in range(2))
    value, error = np.zeros_like(values[0]), np.full_like(errors[0], np.inf)
    least = error
    for fit in _fits(tuple(series)):
        if fit.powers <= growth:
            continue
        coefficients = np.tensordot(fit.weights, values, 1)
        own = coefficients[growth]
        rest = np.max(_largest(values - np.tensordot(fit.basis, coefficients, 1)), axis=0)
        uncertain = np.tensordot(np.abs(fit.weights[growth]), np.maximum(errors, rest), 1)
        for part in fit.parts if power else ():
            uncertain = np.maximum(uncertain, _largest(np.tensordot(part[growth], values, 1) - own))
        # What is done at each step whatever dt is, as by a factor, makes a power series in n, and
        # of the same kind at all states: so is its fit.
        doubt = uncertain if power else np.full_like(uncertain, np.max(uncertain))
        better = (doubt < least) & (fit.powers <= degrees + 1)
        least = np.where(better, doubt, least)
        value[better], error[better] = own[better], uncertain[better]
    return _Coefficient(value, error, every[-1].natural)


class _Fit(NamedTuple):
    """A fit of powers of n, and of powers that change their sign at each step.

    Fields:
        basis: ``(steps, terms)``.
        weights: from values to coefficients, ``(terms, steps)``.
        parts: as `weights`, without the first steps, and without the last ones.
        powers: how many of the terms are powers of n.
    """

    basis: np.ndarray
    weights: np.ndarray
    parts: list[np.ndarray]
    powers: int


@functools.cache
def _fits(steps: tuple[int, ...]) -> list[_Fit]:
    n, fits = np.array(steps, dtype=float), []
    for powers, swings in itertools.product(range(1, _MOST_TERMS + 1), range(_MOST_TERMS)):
        if powers + swings > _MOST_TERMS or swings > powers:
            continue
        # A root -1 of the method makes terms that change their sign at each step.
        swinging = (-1.0) ** n[:, None] * np.vander(n, swings, increasing=True)
        basis = np.hstack([np.vander(n, powers, increasing=True), swinging])
        parts = []
        for some in (slice(_LEFT_OUT, None), slice(None, -_LEFT_OUT)):
            part = np.zeros(basis.T.shape)
            part[:, some] = np.linalg.pinv(basis[some])
            parts.append(part)
        fits.append(_Fit(basis, np.linalg.pinv(basis), parts, powers))
    return fits


def _is_one_step(
    samples: StepSamples, t: np.ndarray, y: np.ndarray, dt: np.ndarray, states: np.ndarray
) -> bool:
    """Whether the stepper may be stopped and started again at any state that it hands out.

    That is tried after the first step, and after all but the last: it may begin as another method.
    """
    rungs, stops = [0, dt.shape[1] // 2], np.array([1, states.shape[2] - 2])
    states, dt = states[:, rungs], dt[:, rungs, None]
    before, after = states[:, :, stops], states[:, :, stops + 1]
    times, sizes = (
        np.broadcast_to(each, before.shape[:3]).ravel()
        for each in (t[:, None, None] + stops * dt, dt)
    )
    again = samples.after(times, before.reshape(-1, *y.shape[1:]), sizes[:, None], 1)
    again = again[:, 0, 1].reshape(after.shape)
    # Velocities that are differences of positions have their rounding, divided by dt.
    size = _EPS * float(np.max(np.abs(y)))
    close = _SAME * size + _DISTURBANCE * size / dt.reshape(-1, 2, *(1,) * y.ndim)
    start = states[:, :, :1] - y[:, None, None]
    return bool(np.all(np.abs(start) <= close) and np.all(np.abs(again - after) <= close))


def _settles(samples: StepSamples, t: np.ndarray, dt: np.ndarray, states: np.ndarray) -> bool:
    """Whether the second step solves another equation than the first, however short both are.

    So do steps whose velocities are differences of positions that are projected to constraints,
    where the projection is not exact: what it leaves, of the size dt^2, changes velocities by dt.
    """
    rungs = [0, dt.shape[1] // 2]
    states, dt = states[:, rungs], dt[:, rungs, None]
    before, after = states[:, :, :2], states[:, :, 1:3]
    times = (t[:, None, None] + np.arange(2) * dt).ravel()
    rates = samples.rates(times, before.reshape(-1, *before.shape[3:])).reshape(before.shape)
    wrong = (after - before) / dt.reshape(-1, 2, *(1,) * (before.ndim - 2)) - rates
    apart, size = (
        np.max(np.abs(np.moveaxis(each, 1, 0)).reshape(2, -1), axis=1, initial=0.0)
        for each in (wrong[:, :, 1] - wrong[:, :, 0], rates[:, :, 1])
    )
    long, short = apart / np.where(size > 0.0, size, 1.0)
    return bool(short > max(_SETTLING, long / 2.0))


def _noise(
    samples: StepSamples, t: np.ndarray, y: np.ndarray, dt: np.ndarray, errors: np.ndarray
) -> np.ndarray:
    """How far rounding moves the error of a step, ``(quantities, states, rungs)``.

    Arguments:
        errors: of a step, ``(states, rungs, *state)``.
    """
    rates, longest = samples.rates(t, y), np.max(dt, axis=1)
    wave = np.cos(np.arange(y.size)).reshape(y.shape)
    moved = np.abs(y) + longest.reshape(-1, *(1,) * (y.ndim - 1)) * np.abs(rates)
    near = y + _DISTURBANCE * _EPS * wave * moved
    uncertain = np.abs(samples.rates(t, near) - rates)
    # A rate may stand still at one time and not at another.
    for time in (t, t + longest / 2.0):
        late = time + _DISTURBANCE * _EPS * np.abs(time)
        uncertain += np.abs(samples.rates(late, y) - samples.rates(time, y))
    size, speed, rate = (
        _largest(_by_quantity(samples.problem, each[:, None])) for each in (y, rates, uncertain)
    )
    noise = _EPS * (size + dt * speed) + dt * rate / _DISTURBANCE
    if samples.problem.mechanics is not None:
        # Positions move with the velocities.
        noise[0] += dt * noise[1] * (0.0 if samples.carries_state else EXPANSION_STEPS)
        # A velocity may be computed as a difference of positions, whose rounding is divided by dt.
        # It is if the shortest steps show such errors at some state where they would be large; at
        # another, at rest, the position may not move at all, which looks exact.
        difference = _EPS * size[0] / dt
        clear = difference[:, -1] > _DISTURBANCE * noise[1, :, -1]
        shown = _largest(_by_quantity(samples.problem, errors)[1])[clear, -1]
        share = float(np.nanmax(shown / difference[clear, -1], initial=0.0))
        noise[1] += min(1.0, share) * difference
    return _ROUNDINGS * noise


def _by_quantity(problem: Problem, states: np.ndarray) -> np.ndarray:
    """States ``(states, rungs, *state)`` as ``(quantities, states, rungs, components)``."""
    if problem.mechanics is None:
        return states.reshape(1, *states.shape[:2], -1)
    return np.moveaxis(states, 2, 0).reshape(2, *states.shape[:2], -1)


def _largest(values: np.ndarray) -> np.ndarray:
    """The largest of the components along the last axis."""
    return np.max(np.abs(values), axis=-1, initial=0.0)
