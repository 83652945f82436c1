"""Damping that acts at each step, however long that is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import special

from ropeode.checking.candidate import Candidate
from ropeode.checking.diagnosis.diagnostic_ropes import hardly_damped
from ropeode.checking.diagnosis.equation import Runs
from ropeode.checking.diagnosis.fit import Observed, fit
from ropeode.checking.diagnosis.fitted_numbers import numbers_of
from ropeode.checking.diagnosis.runs import runs_of
from ropeode.checking.report import Diagnosis
from ropeode.problems.problem import Problem

_STEPS = (16, 32, 64, 128)
FEWEST_RUNS = 3
# Of the motion: how far a rope with the fitted damping may be from the run.
_CLOSE = 0.1
# The slope of log(rate) over log(dt) is -1 give or take this.
_SLOPE = 0.1
_LEAST_HALF_WIDTH = 0.02
# At the finest dt the damping rate times the span is at least this: it shows in the motion.
_FELT = 0.5


def damping_per_step(candidate: Candidate) -> Diagnosis | None:
    """Say so if the damping rate of a stepper grows as 1/dt.

    Arguments:
        candidate: the stepper; it runs on a rope whose damping is so small that the motion
            goes on even so.
    """
    problem = hardly_damped()
    runs = runs_of(candidate, problem, _STEPS)
    return damping_rate_diagnosis(problem, runs, problem.quantities)


def damping_rate_diagnosis(
    problem: Problem, runs: Runs, quantities: Sequence[str]
) -> Diagnosis | None:
    """Fit the damping to each run of a problem, and look how its rate depends on dt.

    Arguments:
        problem: that was to be solved.
        runs: step size and states of each.
        quantities: that the runs have.

    Returns:
        None where the rates do not grow as 1/dt, or a rope with them is not near the runs.
    """
    dts, rates, misfits = [], [], []
    runs = sorted(runs, key=lambda run: -run[0])
    for dt, states in runs:
        seen = _as_it_is(problem, states, quantities)
        if seen is None:
            continue
        found = fit(seen, ("damping",))
        (number,) = numbers_of(problem, found)
        if found.misfit > _CLOSE or number.found[0] <= 0.0:
            return None
        mean = 1.0 if not number.factor else float(np.mean(problem.args.damping))
        dts.append(dt)
        rates.append(float(number.found[0]) * mean / float(np.mean(problem.args.mass)))
        misfits.append(found.misfit)
    if len(dts) < FEWEST_RUNS:
        return None
    slope, half = _line(np.log(dts), np.log(rates))
    if half > _SLOPE or abs(slope + 1.0) > half or rates[-1] * _span(problem) < _FELT:
        return None
    lost = 1.0 - np.exp(-rates[-1] * dts[-1])
    return Diagnosis(
        "damping-per-step",
        f"damping acts per step: its fitted rate grows as 1/dt (slope {slope:.2f} "
        f"[{slope - half:.2f}, {slope + half:.2f}] of log rate over log dt); each step takes "
        f"{lost:.3g} of the velocity, however short it is, so that there is no limit as dt goes "
        "to 0: scale it with dt",
        {
            "dts": dts,
            "rates": rates,
            "slope": slope,
            "ci95": [slope - half, slope + half],
            "lost_per_step": lost,
            "misfits": misfits,
        },
    )


def _span(problem: Problem) -> float:
    return float(problem.ts[-1] - problem.ts[0])


def _as_it_is(problem: Problem, states: np.ndarray, quantities: Sequence[str]) -> Observed | None:
    """One run, with differences measured in units of its motion."""
    known = np.full(states.shape, np.nan)
    size = np.full(states.shape, np.inf)
    for name in quantities:
        half = problem.quantities.index(name)
        known[:, half] = states[:, half]
        size[:, half] = np.max(np.abs(states[:, half] - states[:1, half]), initial=0.0)
        if not np.all(np.isfinite(known[:, half])) or not np.all(size[:, half] > 0.0):
            return None
    return Observed(problem, known, size, dict.fromkeys(quantities))


def _line(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """The slope of the line of least squares, and half its 95% interval."""
    aside, up = x - np.mean(x), y - np.mean(y)
    slope = float(aside @ up / (aside @ aside))
    left = up - slope * aside
    degrees = len(x) - 2
    error = float(np.sqrt(left @ left / degrees / (aside @ aside)))
    return slope, max(float(special.stdtrit(degrees, 0.975)) * error, _LEAST_HALF_WIDTH)
