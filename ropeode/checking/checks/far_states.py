"""Steps from states that no run comes to: springs that are torn apart, nodes that hardly move.

What a threshold does to a ratio of lengths or speeds, no change of units shows. Each step is
expanded in dt and held against the exact flow.
"""

from __future__ import annotations

import functools

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import generic, undamped
from ropeode.checking.report import Finding
from ropeode.checking.time_limit import within
from ropeode.errors import UserCodeError
from ropeode.problems.problem import Problem
from ropeode.theory.expansion import Expansion, expanded
from ropeode.theory.step_samples import StepSamples

# What a solver that iterates up to an absolute tolerance may leave of a step: of a state, where the
# step is not the identity at dt = 0, and of its rate of change.
_OF_STATE, _OF_RATE = 1e-7, 1e-3
# The processor time of all steps; see `scales`.
_SECONDS = 10.0


def _states(problem: Problem) -> dict[str, np.ndarray]:
    """States of a rope, each by what is unusual about it; the first one is usual."""
    x, v = problem.y0
    pin = x[np.argmin(problem.args.free)]
    torn = x + 30.0 * (np.arange(len(x)) == len(x) - 1)[:, None]

    def stretched(ratio: float) -> np.ndarray:
        return np.stack([pin + ratio * (x - pin), v])

    def moving(*factors: float) -> np.ndarray:
        return np.stack([x, v * np.array(factors)[:, None]])

    return {
        "nothing": problem.y0,
        "all springs are four times as long": stretched(4.0),
        "all springs are twelve times as long": stretched(12.0),
        "all springs are forty times as long": stretched(40.0),
        "all springs are a tenth as long": stretched(0.1),
        "one spring is forty times as long": np.stack([torn, v]),
        "the rope is at rest": moving(0.0, 0.0, 0.0, 0.0, 0.0),
        "a node hardly moves": moving(1.0, 1.0, 1e-6, 1.0, 1.0),
        "a node moves a million times as slowly as others": moving(1e3, 1.0, 1e-3, 1e3, 1e3),
        "a node moves a thousand times as fast as others": moving(1.0, 1.0, 1.0, 1e3, 1.0),
    }


def far_states(examination: Examination) -> Finding:
    """A step from an unusual state solves the same equation, and to the same order."""
    problem = undamped() if "damping" in examination.cannot_be_told else generic()
    states = _states(problem)
    y = np.stack(list(states.values()))
    t, longest = np.full(len(y), problem.ts[0]), float(problem.ts[1] - problem.ts[0])
    samples = StepSamples(problem, examination.method)
    work = functools.partial(expanded, samples, t, y, longest)
    try:
        expansion = within(_SECONDS, "steps from unusual states", work)
    except UserCodeError as error:
        line = f"not known: {error.problems[0].removeprefix('step: ').split('; allowed')[0]}"
        return Finding("far-states", "note", line)
    usual, *others = (int(order) for order in _orders(expansion, samples.rates(t, y)))
    for name, order in zip(list(states)[1:], others, strict=True):
        if order < min(usual, _NO_FAULT):
            what = (
                f"is of order {order}, not {usual}"
                if order > 0
                else "does not solve the rope's equations"
                if order == 0
                else "jumps at dt = 0"
            )
            line = f"where {name}, a step {what}; is there a threshold or a limit?"
            return Finding("far-states", "fail", line, {"order": order, "usual": usual})
    line = f"a step from any of {len(others)} unusual states does what it does from a usual one"
    return Finding("far-states", "pass", line)


# Stands for an order where no fault shows up to the highest that is looked at.
_NO_FAULT = 4


def _orders(expansion: Expansion, rates: np.ndarray) -> np.ndarray:
    """Of the first term of the error that is not small, at each state, ``(states,)``."""
    orders = np.full(len(expansion.t), _NO_FAULT)
    size = np.max(np.abs(expansion.y), axis=(2, 3))
    for order in reversed(range(-1, _NO_FAULT)):
        rate = expansion.rate(order)
        error = np.max(np.abs(rate.value), axis=(2, 3))
        if order < 0:
            wrong = error > _OF_STATE * size
        else:
            speed = np.max(np.abs(rates), axis=(2, 3))
            wrong = error * expansion.ladder[:, None] ** order > _OF_RATE * speed
        orders[np.any(wrong & rate.known.T, axis=1)] = order
    return orders
