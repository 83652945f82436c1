"""What trajectories from any program tend to, where it is not the solution of their problem."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import DOP853

from ropeode.checking.diagnosis.fitted_terms import Change, Fit, Fitting
from ropeode.checking.diagnosis.methods import runge_kutta
from ropeode.checking.diagnosis.program_words import term_found, wrong_term
from ropeode.checking.diagnosis.programs import Runs
from ropeode.checking.diagnosis.rope_forces import (
    Forces,
    Terms,
    has_rope_forces,
    initial_states,
    right_terms,
)
from ropeode.checking.report import Diagnosis
from ropeode.checking.richardson import limit_of
from ropeode.checking.simple_numbers import shortest
from ropeode.checking.trajectories.convergence import first_frames
from ropeode.checking.written_precision import rounding_of
from ropeode.norms import NORMS
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.references import Reference
from ropeode.theory import is_rope
from ropeode.theory.terms import AXES, TERMS

# At first a motion depends on the parameters most simply, and later frames add little. With
# fewer than three frames none could be kept back to confirm what the others say.
_MOST_FRAMES, _FEWEST_FRAMES = 6, 3
# A limit is at least as uncertain as this part of the motion, like the solutions that are compared
# with it; and says something if it is at most as uncertain as that part.
_FLOOR, _LARGEST_UNCERTAINTY = 1e-9, 3e-3
# How precise those solutions are, as a part of the limit's uncertainty and of the problem's size;
# and the most steps in each frame.
_PRECISION, _FINEST, _COARSEST, _MOST_STEPS = 1e-2, 1e-11, 1e-7, 512
# Of ropes that move the same so many are said.
_MOST_SAID = 3
_EXACT = runge_kutta(DOP853.A[1:], DOP853.B)
# How closely the acceleration of a problem is that of a rope.
_SAME = 1e-9


@in_float64
def diagnose_trajectories(reference: Reference, runs: Runs, quantities: Sequence[str]) -> Diagnosis:
    """Find what runs of a problem solve instead of it.

    The program cannot be run again. So terms of the forces are fitted to the first two thirds of
    what the runs tend to, and the rest must confirm them.

    Arguments:
        reference: of the problem that the program should solve.
        runs: step size and states ``(times, *state)`` of each; not-a-number from where it
            diverged.
        quantities: of the problem, that the runs have; the numbers of others do not count.

    Returns:
        `unknown` if no change of terms explains the runs.
    """
    problem = reference.problem
    if not _moves_as_rope(problem, reference):
        return _unknown("the problem has no parameters that could be fitted")
    for frames in range(min(problem.frames, _MOST_FRAMES, reference.trusted - 1), 0, -1):
        part = problem.changed(ts=problem.ts[: frames + 1], exact=None)
        limit = _observed([(dt, states[: frames + 1]) for dt, states in runs], part, quantities)
        if limit is not None:
            return _diagnose_limit(limit, frames, reference)
    return _unknown(
        "the runs do not tend to any limit with an integer order as dt goes to 0 (at least three "
        "step sizes are needed)"
    )


@dataclasses.dataclass(frozen=True)
class _Observed:
    """The trajectory that the runs of a problem tend to as dt goes to 0.

    Arguments:
        problem: the problem that the runs should solve.
        states: ``(times, *state)``; not-a-number in quantities that the runs lack.
        uncertainty: of each number, of the same shape; infinite in quantities that the runs lack.
        orders: the order with which each quantity tends to its limit; None where the runs do
            not depend on dt.
    """

    problem: Problem
    states: np.ndarray
    uncertainty: np.ndarray
    orders: dict[str, int | None]

    @property
    def orders_in_words(self) -> str:
        """With which the runs tend to it."""
        texts = {
            name: f"order {order}" if order else "an unknown order"
            for name, order in self.orders.items()
        }
        if len({*texts.values()}) == 1:
            return texts[next(iter(texts))]
        return " and ".join(f"{text} in {name}" for name, text in texts.items())


def _observed(runs: Runs, problem: Problem, quantities: Sequence[str]) -> _Observed | None:
    """Extrapolate runs to dt = 0; None if a quantity has no limit, or one that is uncertain."""
    states = np.full((len(problem.ts), *problem.y0.shape), np.nan)
    uncertainty = np.full(states.shape, np.inf)
    orders: dict[str, int | None] = {}
    for name in quantities:
        half = problem.quantities.index(name)
        numbers = [run[:, half] for _, run in runs]
        written = np.concatenate([each[1:].ravel() for each in numbers])
        rounding = rounding_of(written[np.isfinite(written)])
        limit = limit_of([dt for dt, _ in runs], numbers, rounding)
        if limit is None:
            return None
        motion = float(np.max(np.abs(limit.values - limit.values[:1])))
        uncertain = limit.order is not None
        if uncertain and limit.uncertainty[-1] > _LARGEST_UNCERTAINTY * motion:
            return None
        states[:, half] = limit.values
        each = np.maximum(limit.uncertainty, _FLOOR * max(motion, 1e-300))
        uncertainty[:, half] = each.reshape(-1, *(1,) * (limit.values.ndim - 1))
        orders[name] = limit.order
    return _Observed(problem, states, uncertainty, orders)


def _diagnose_limit(limit: _Observed, frames: int, reference: Reference) -> Diagnosis:
    problem, right = limit.problem, reference.states[: frames + 1]
    bounds = [reference.bound(NORMS[f"{name}-max"])[frames] for name in problem.quantities]
    apart = np.abs(limit.states - right) / (limit.uncertainty + np.reshape(bounds, (-1, 1, 1)))
    if all(np.max(problem.quantity(name, apart[1:])) <= 1.0 for name in limit.orders):
        return _unknown(
            f"the runs tend to the right solution over the first {first_frames(frames)}, with "
            f"{limit.orders_in_words}; runs of a single problem cannot show why the order is too "
            "low"
        )
    if frames < _FEWEST_FRAMES:
        return _unknown(
            f"the runs tend to a wrong solution, but their limit is certain enough for a fit only "
            f"over the first {first_frames(frames)}, too few to keep some back to confirm it; use "
            "smaller steps, or samples at shorter intervals"
        )
    confirmed = _confirmed(limit, frames)
    if not confirmed:
        return _unknown(
            "the runs tend to a wrong solution; no change of gravity, damping, springs, mass or "
            "initial velocity explains it"
        )
    return _diagnosis(limit, confirmed)


def _moves_as_rope(problem: Problem, reference: Reference) -> bool:
    """Whether the acceleration of a problem is that of a rope with springs, and nothing else."""
    if not (is_rope(problem) and has_rope_forces(problem)):
        return False
    for t, y in zip(problem.ts[: _MOST_FRAMES + 1], reference.states, strict=False):
        own = np.asarray(problem.rhs(t, y, problem.args))[1]
        known = Forces(problem.args, right_terms(1))(*y[:, None])[0]
        if np.max(np.abs(own - known)) > _SAME * np.max(np.abs(known), initial=1e-300):
            return False
    return True


def _confirmed(limit: _Observed, frames: int) -> list[Fit]:
    """The ropes with the fewest changes, fitted to the beginning, that also predict the rest.

    There may be several that move alike, between which the runs cannot decide.
    """
    beginning = limit.uncertainty.copy()
    beginning[-(frames // 3) :] = np.inf
    steps = _steps_for(limit)

    def motion(terms: Terms, samples: int) -> np.ndarray:
        return _exact_motion(limit.problem, terms, samples, steps)

    every = Fitting(motion, limit.states, limit.uncertainty)
    for first in Fitting(motion, limit.states, beginning).explaining(_changes_of(limit.problem)):
        before = {fit.changes: fit for fit in first}
        confirmed = [
            fit
            for fit in every.refined(first)
            if fit.explains
            if np.all(
                np.abs(fit.values - before[fit.changes].values)
                <= fit.spread + before[fit.changes].spread
            )
        ]
        if confirmed:
            # The simplest numbers come first.
            return sorted(
                confirmed, key=lambda fit: sum(_digits(each.value) for each in _numbers(fit))
            )
    return []


def _steps_for(limit: _Observed) -> int:
    """How many steps in each frame solve the rope more precisely than its limit is known.

    Half of them would do, which leaves a factor of 2^8 to ropes with stiffer springs.
    """
    problem, steps = limit.problem, 4
    finite = np.isfinite(limit.uncertainty)
    precision = float(np.min(limit.uncertainty[finite]))
    tolerance = float(np.clip(_PRECISION * precision / problem.scale, _FINEST, _COARSEST))
    samples = len(problem.ts) - 1
    coarse, fine = (_exact_motion(problem, right_terms(1), samples, n) for n in (steps, 2 * steps))
    while np.max(np.abs(fine - coarse)[:, :, 0]) > tolerance * problem.scale:
        steps *= 2
        if steps >= _MOST_STEPS:
            break
        coarse, fine = fine, _exact_motion(problem, right_terms(1), samples, 2 * steps)
    return 2 * steps


def _exact_motion(problem: Problem, terms: Terms, samples: int, steps: int) -> np.ndarray:
    """How ropes with such terms move, by the method of order 8 of DOP853 with equal steps.

    Arguments:
        problem: a rope, with the sample times.
        terms: of the copies of the rope.
        samples: how many, beside the first.
        steps: in each frame.

    Returns:
        ``(copies, samples, *state)``; not finite where a copy blows up.
    """
    forces, (x, v), states = Forces(problem.args, terms), initial_states(problem, terms), []
    with np.errstate(all="ignore"):
        for length in np.diff(problem.ts[: samples + 1]):
            for _ in range(steps):
                x, v = _EXACT(forces, x, v, length / steps)
            states.append(np.stack([x, v], axis=1))
    return np.stack(states, axis=1)


def _changes_of(problem: Problem) -> list[Change]:
    """The terms of a rope with springs that can be told from each other."""
    args, v0 = problem.args, problem.y0[1]
    gravity, damping = np.abs(np.ravel(args.gravity)), np.asarray(args.damping)
    axes = [*AXES[: len(v0)]]
    names = ["spring", "rest", "forces", "first_ends", "second_ends", "all"]
    names += ["velocity"] if np.any(v0) else [f"velocity_{axis}" for axis in axes]
    if np.any(gravity):
        names.append("gravity")
        # Along the axis of the largest component the factor says it.
        del axes[int(np.argmax(gravity))]
    names += [f"gravity_{axis}" for axis in axes] + ["dashpot", "per_spring"]
    # Equal dampings are changed by a factor.
    names += ["damping"] if np.any(damping) else []
    names += ["further"] if np.ptp(damping) or not np.any(damping) else []
    return [(name,) for name in names]


class _Number(NamedTuple):
    """The value of a term, as the shortest number that its spread allows."""

    name: str
    value: float
    spread: float


def _numbers(fit: Fit) -> list[_Number]:
    """Those that a fit changed."""
    every = zip(fit.changes, fit.values.tolist(), fit.spread.tolist(), strict=True)
    return [_Number(change[0], shortest(value, off), off) for change, value, off in every]


def _digits(value: float) -> int:
    return len(f"{abs(value):.3e}".split("e")[0].rstrip("0."))


def _diagnosis(limit: _Observed, fits: Sequence[Fit]) -> Diagnosis:
    """The diagnosis that a program solves a rope with other terms.

    Arguments:
        limit: of its runs.
        fits: ropes between which the runs cannot decide, at least one.
    """
    words = [
        " and ".join(wrong_term(limit.problem, *number) for number in _numbers(fit)) for fit in fits
    ]
    unsaid = len(fits) - _MOST_SAID
    line = f"your stepper solves, to {limit.orders_in_words}, another rope: "
    line += "; or, which these runs cannot tell apart, ".join(words[:_MOST_SAID])
    line += f"; or one with {unsaid} further sets of numbers" if unsaid > 0 else ""
    evidence = {
        "terms": _terms_of(fits[0]),
        "alternatives": [_terms_of(fit) for fit in fits[1:]],
        "orders": limit.orders,
        "misfit": fits[0].misfit,
    }
    # Which of several changes is meant nobody knows.
    remedies = [TERMS[number.name].remedy for number in _numbers(fits[0]) if len(fits) == 1]
    return Diagnosis("parameters", line, evidence, "; ".join(dict.fromkeys(remedies)))


def _terms_of(fit: Fit) -> list[dict[str, Any]]:
    """The terms that a fit changed, as evidence."""
    return [term_found(name, found=value, spread=spread) for name, value, spread in _numbers(fit)]


def _unknown(line: str) -> Diagnosis:
    return Diagnosis("unknown", line)
