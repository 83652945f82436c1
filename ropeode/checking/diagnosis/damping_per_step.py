"""Damping that acts at each step, however long the step is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import special

from ropeode.checking.diagnosis.fitted_numbers import numbers_of
from ropeode.checking.diagnosis.limits import ObservedLimit, Runs
from ropeode.checking.diagnosis.parameter_fit import fit_parameters
from ropeode.checking.report import Diagnosis
from ropeode.problems import Problem

_FEWEST_RUNS = 3
# How far a rope with the fitted damping may be from the run, as a part of the motion.
_CLOSE = 0.1
# The slope of log(rate) over log(dt) is -1 to within this.
_SLOPE = 0.1
_LEAST_HALF_WIDTH = 0.02
# At the finest dt the damping rate times the span is at least this, so that it shows.
_VISIBLE = 0.5


def damping_rate_diagnosis(
    problem: Problem, runs: Runs, quantities: Sequence[str]
) -> Diagnosis | None:
    """Fit the damping to each run of a problem, and see how its rate depends on dt.

    Returns:
        None if the rates do not grow as 1/dt, or a rope with these rates is not near the runs.
    """
    dts, rates, misfits = [], [], []
    runs = sorted(runs, key=lambda run: -run[0])
    for dt, states in runs:
        target = _single_run(problem, states, quantities)
        if target is None:
            continue
        fit = fit_parameters(target, ("damping",))
        (number,) = numbers_of(problem, fit)
        if fit.misfit > _CLOSE or number.fitted[0] <= 0.0:
            return None
        mean = 1.0 if not number.factor else float(np.mean(problem.args.damping))
        dts.append(dt)
        rates.append(float(number.fitted[0]) * mean / float(np.mean(problem.args.mass)))
        misfits.append(fit.misfit)
    if len(dts) < _FEWEST_RUNS:
        return None
    slope, half = _line(np.log(dts), np.log(rates))
    if half > _SLOPE or abs(slope + 1.0) > half or rates[-1] * _span(problem) < _VISIBLE:
        return None
    lost = 1.0 - np.exp(-rates[-1] * dts[-1])
    return Diagnosis(
        "damping-per-step",
        f"damping acts once per step, whatever dt is: its fitted rate grows as 1/dt (slope "
        f"{slope:.2f} [{slope - half:.2f}, {slope + half:.2f}] of log rate over log dt). Each "
        f"step removes a fraction {lost:.3g} of the velocity, so the runs have no limit as dt "
        "goes to 0; scale the damping with dt",
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


def _single_run(
    problem: Problem, states: np.ndarray, quantities: Sequence[str]
) -> ObservedLimit | None:
    """One run as the target of a fit, with differences in units of its motion."""
    values = np.full(states.shape, np.nan)
    size = np.full(states.shape, np.inf)
    for name in quantities:
        half = problem.quantities.index(name)
        values[:, half] = states[:, half]
        size[:, half] = np.max(np.abs(states[:, half] - states[:1, half]), initial=0.0)
        if not np.all(np.isfinite(values[:, half])) or not np.all(size[:, half] > 0.0):
            return None
    return ObservedLimit(problem, values, size, dict.fromkeys(quantities))


def _line(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """The slope of the least-squares line, and half its 95% interval."""
    x, y = x - np.mean(x), y - np.mean(y)
    slope = float(x @ y / (x @ x))
    residual = y - slope * x
    degrees = len(x) - 2
    error = float(np.sqrt(residual @ residual / degrees / (x @ x)))
    return slope, max(float(special.stdtrit(degrees, 0.975)) * error, _LEAST_HALF_WIDTH)
