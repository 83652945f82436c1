"""Exact solutions are held against a solver in extended precision and equations written anew."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ropeode.problems import PROBLEMS, Problem
from tests.problems.exact import EXACT
from tests.verification.extrapolation import integrate

EPS = np.finfo(np.float64).eps


def oscillator_rhs(given, t, y):
    x, v = y[:, 0], y[:, 1]
    force = -np.longdouble(given["stiffness"]) * x - np.longdouble(given["damping"]) * v
    return np.stack([v, force / np.longdouble(given["mass"])], axis=1)


def chain_rhs(given, t, y):
    k, d, m = (np.longdouble(given[name]) for name in ("stiffness", "damping", "mass"))
    x, v = y[:, 0], y[:, 1]
    wide = np.pad(x, ((0, 0), (1, 1)))
    return np.stack([v, (k * (wide[:, :-2] - 2 * x + wide[:, 2:]) - d * v) / m], axis=1)


def kepler_rhs(given, t, y):
    x = y[:, 0]
    return np.stack([y[:, 1], -x / np.sqrt(np.sum(x * x, axis=2, keepdims=True)) ** 3], axis=1)


def forced_rhs(given, t, y):
    return -np.longdouble(given["rate"]) * (y - np.cos(np.longdouble(given["frequency"]) * t))


def pendulum_rhs(given, t, y):
    rate = np.longdouble(given["gravity"]) / np.longdouble(given["length"])
    return np.stack([y[:, 1], -rate * np.sin(y[:, 0])], axis=1)


EQUATIONS = {
    "oscillator": oscillator_rhs,
    "linear-chain": chain_rhs,
    "kepler": kepler_rhs,
    "forced": forced_rhs,
    "pendulum": pendulum_rhs,
}


# No numbers so small that their products leave the normal ones.
numbers = st.one_of(st.just(0.0), st.floats(1e-9, 3), st.floats(-3, -1e-9))


@st.composite
def damped(draw):
    """Mass, stiffness and damping: none, any, or near the critical one of some stiffness."""
    mass, stiffness = draw(st.floats(0.1, 10)), draw(st.floats(0.05, 20))
    near = st.builds(
        lambda sign, k: 1 + sign * 10.0**-k, st.sampled_from([-1, 1]), st.floats(1, 17)
    )
    ratio = draw(st.one_of(st.just(0.0), st.floats(0, 4), near))
    damping = ratio * 2 * float(np.sqrt(mass * stiffness))
    return {"mass": mass, "stiffness": stiffness, "damping": damping}


PARAMETERS = {
    "oscillator": st.builds(
        lambda masses, x0, v0: {**masses, "x0": x0, "v0": v0}, damped(), numbers, numbers
    ),
    "linear-chain": st.builds(
        lambda masses, many, x, v: (
            masses | {"num_masses": many, "displacement": x[:many], "velocity": v[:many]}
        ),
        damped(),
        st.sampled_from([1, 4]),
        *2 * [st.lists(numbers, max_size=4)],
    ),
    "kepler": st.fixed_dictionaries(
        {"eccentricity": st.floats(0, 0.99) | st.floats(0.99, 0.9999), "periods": st.floats(0.1, 3)}
    ),
    "forced": st.fixed_dictionaries(
        {"rate": st.floats(0.01, 30), "frequency": st.floats(-6, 6), "y0": numbers}
    ),
    "pendulum": st.fixed_dictionaries(
        {
            "length": st.floats(0.2, 5),
            "gravity": st.floats(0.2, 5),
            "angle": st.one_of(numbers, st.floats(-9, 9)),
            "velocity": numbers,
        }
    ),
}


def integrated(name: str, problem: Problem, y0: np.ndarray, ts: np.ndarray) -> np.ndarray:
    """The same equation in extended precision, by other code."""
    equation = EQUATIONS[name]
    return integrate(lambda t, y: equation(problem.parameters, t, y), y0, ts)


def units_apart(problem: Problem, a: np.ndarray, b: np.ndarray) -> float:
    """The largest difference of each quantity, in rounding units of its largest value."""
    apart = []
    for name in problem.quantities:
        one, other = problem.quantity(name, a), problem.quantity(name, b)
        size = np.max(np.abs(other)) or 1.0
        apart.append(float(np.max(np.abs(one - other)) / (EPS * size)))
    return max(apart)


def test_every_exact_solution_is_tested():
    have_one = {name for name, build in PROBLEMS.items() if build().exact is not None}
    assert have_one == set(EXACT) == set(EQUATIONS) == set(PARAMETERS)


@pytest.mark.parametrize("name", EXACT)
@settings(deadline=None, max_examples=8)
@given(data=st.data())
def test_solves_the_equation(name, data):
    """And the problem is this equation, at any state and time."""
    problem = PROBLEMS[name](frames=data.draw(st.integers(1, 9)), **data.draw(PARAMETERS[name]))
    y, t = np.random.default_rng(3).normal(size=problem.y0.shape), data.draw(st.floats(0, 9))
    expected = EQUATIONS[name](problem.parameters, np.full((1,) * (y.ndim + 1), t), y[None])[0]
    size = float(np.max(np.abs(expected)))
    found = problem.rhs(t, y, problem.args)
    np.testing.assert_allclose(found, expected.astype(np.float64), rtol=1e-13, atol=1e-13 * size)

    start = problem.exact(problem.ts)[0]
    np.testing.assert_allclose(start, problem.y0, rtol=EPS, atol=EPS * problem.scale)
    # Times that no oscillation can be zero at together.
    ts = problem.ts[-1] * np.linspace(0, 1, 14) ** 1.1
    exact = problem.exact(ts)
    assert exact.dtype == np.float64
    assert exact.shape == (len(ts), *problem.y0.shape)
    truth = integrated(name, problem, problem.y0, ts)
    # The truth is good to 1e-17 times what becomes of an error in the initial state.
    pattern = np.cos(np.arange(problem.y0.size)).reshape(problem.y0.shape)
    moved = integrated(name, problem, problem.y0 * (1 + 2.0**-40 * pattern), ts)
    growth = units_apart(problem, moved, truth) * EPS * 2.0**40
    assert units_apart(problem, exact, truth) <= 1.0 + growth * 1e-17 / EPS


@settings(deadline=None, max_examples=12)
@given(gap=st.floats(-17, -1), sign=st.sampled_from([-1, 1]), stiffness=st.floats(0.5, 3))
@example(gap=-17.0, sign=1, stiffness=1.0)
def test_near_critical_damping_every_digit_holds(gap, sign, stiffness):
    """From rest, the displacement decays by many orders of magnitude and keeps its sign."""
    damping = 2 * float(np.sqrt(stiffness)) * (1 + max(sign, 0) * 10.0**gap)
    problem = PROBLEMS["oscillator"](frames=30, stiffness=stiffness, damping=damping)
    truth = integrated("oscillator", problem, problem.y0, problem.ts).astype(np.float64)
    np.testing.assert_allclose(problem.exact(problem.ts)[:, 0], truth[:, 0], rtol=1e-15)


def test_very_strong_damping_neither_overflows_nor_cancels():
    problem = PROBLEMS["oscillator"](frames=5, damping=1e9, v0=1.0)
    slow = -1e-9
    displacement = (1 + 1e-9) * np.exp(slow * problem.ts[1:])
    exact = problem.exact(problem.ts)[1:, :, 0, 0].T
    np.testing.assert_allclose(exact, [displacement, slow * displacement], rtol=1e-14)
