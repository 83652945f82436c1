"""Lyapunov exponents: known ones, and what cannot be told from zero."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from ropeode import InextensibleRope, Problem, Rope
from ropeode.analysis import lyapunov_exponent, mean_slope
from ropeode.errors import InputError
from ropeode.problems import PROBLEMS


@pytest.mark.slow
def test_lorenz():
    """0.9056: Sprott, Chaos and Time-Series Analysis (2003), table of flows."""
    found = lyapunov_exponent(PROBLEMS["lorenz"]().changed(ts=np.arange(1001.0)))
    low, high = found.interval
    # Of 500 time units: narrow enough to say something.
    assert low < 0.9056 < high < low + 0.1
    assert found.sign == "positive"


def polynomial(t, y, factors):
    """Two numbers by themselves: ``y' = a y + b y^2``."""
    return factors[0] * y + factors[1] * y**2


@pytest.mark.parametrize(
    ("rates", "largest", "sign"),
    [((0.5, -2.0), 0.5, "positive"), ((0.0, -1.0), 0.0, "not told from zero")],
)
def test_linear_systems_have_their_eigenvalue(rates, largest, sign):
    # Of frames that get longer.
    ts = np.linspace(0.0, 1.0, 61) ** 1.2 * 60
    found = lyapunov_exponent(Problem(polynomial, [1.0, 1.0], ts, np.array([rates, (0, 0)])))
    # A frame is divided evenly, so that there are 100 samples or more.
    np.testing.assert_allclose(found.times[1::2], (ts[1:] + ts[:-1]) / 2)
    # What is left of the other direction after half the span, and the solver's tolerance.
    assert found.value == pytest.approx(largest, abs=math.exp(-30 * 0.7) + 1e-8)
    assert found.sign == sign


@pytest.mark.slow
def test_growth_like_a_power_is_not_told_from_zero():
    """Two orbits of slightly different period part like t; over many periods that is no rate."""
    orbit = dataclasses.replace(PROBLEMS["kepler"](), ts=np.linspace(0, 50 * 2 * np.pi, 201))
    found = lyapunov_exponent(orbit)
    assert found.sign == "not told from zero"
    # ln 2 in the second half, for growth like t: that is half the resolution.
    assert found.value == pytest.approx(found.resolution / 2, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("problem", "rate"),
    [
        # The middle loses half the damping rate; a moved pin would show as zero.
        (Rope(num_nodes=3, pinned=(0, 2), damping=2.0, gravity=(0, -20)).problem(20), 2.0),
        # Once it hangs, each of its modes loses half; links that stretch would show as zero.
        (InextensibleRope(num_nodes=3, damping=0.4, gravity=(0, -100)).problem(60), 0.4),
    ],
)
def test_what_is_held_is_not_disturbed(problem, rate):
    found = lyapunov_exponent(problem, tangents=1)
    assert found.value == pytest.approx(-rate / 2, abs=found.resolution)
    assert found.sign == "negative"


def test_a_pole_ends_it():
    ts = np.linspace(0.0, 1.1, 61)
    factors = np.array([(0.0, 0.0), (1.0, 0.5)])
    problem = Problem(polynomial, [1.0, 1.0], ts, factors)
    found = lyapunov_exponent(problem)
    assert "stopped after t = 1: the step size has become too small" in found.failure
    assert 0.9 < found.times[-1] <= 1.0
    with pytest.raises(InputError, match="tangents: 0 given"):
        lyapunov_exponent(problem, tangents=0)


def test_mean_slope_covers_independent_increments():
    """95% of intervals hold the true mean; of 400 at least 92%, by three standard errors."""
    draw = np.random.default_rng(5)
    covered = 0
    for _ in range(400):
        walk = np.cumsum(0.3 + draw.normal(size=201))
        value, half = mean_slope(np.arange(201.0), walk)
        covered += abs(value - 0.3) <= half
    assert covered >= 0.92 * 400
