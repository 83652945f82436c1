"""Right-hand sides of many kinds, against the same steps in NumPy.

The loop around a right-hand side is compiled into one function where XLA can do that, which
depends on what the right-hand side calls and how large the state is.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import Problem, simulate

MATRIX = np.ones((100, 100)) / 100


CASES = {
    "small": (jnp.sin, np.sin, 100),
    "large": (jnp.sin, np.sin, 2**17 + 1),
    "long sum": (lambda y: y / jnp.sum(y), lambda y: y / np.sum(y), 3000),
    "product": (lambda y: y @ MATRIX, lambda y: y @ MATRIX, 100),
    "sort": (lambda y: jnp.sort(-y), lambda y: np.sort(-y), 100),
    "transform": (
        lambda y: jnp.fft.ifft(1j * jnp.fft.fft(y)).imag,
        lambda y: np.fft.ifft(1j * np.fft.fft(y)).imag,
        100,
    ),
    "factors": (
        lambda y: jnp.diag(jax.lax.linalg.cholesky(jnp.diag(y))),
        lambda y: np.diag(np.linalg.cholesky(np.diag(y))),
        100,
    ),
}


@pytest.mark.parametrize(("function", "in_numpy", "size"), CASES.values(), ids=CASES)
def test_whatever_it_calls(function, in_numpy, size):
    start = np.linspace(1, 2, size)
    run = simulate(Problem(lambda t, y, args: function(y), start, [0.0, 1.0, 2.0]), "rk4", 2)
    expected = start
    for _ in range(4):
        expected = rk4_step(in_numpy, expected, 0.5)
    np.testing.assert_allclose(run.states[-1], expected, rtol=1e-13)


def rk4_step(function, y, dt):
    a = function(y)
    b = function(y + dt / 2 * a)
    c = function(y + dt / 2 * b)
    return y + dt / 6 * (a + 2 * b + 2 * c + function(y + dt * c))


def test_arguments_that_nothing_reads():
    """XLA ends the process where a function has a parameter that nothing reads."""
    unread = {"a": np.ones((2, 2)), "b": np.int64(4), "c": True}
    problem = Problem(lambda t, y, args: y, np.ones(3), [0.0, 1.0], unread)
    run = simulate(problem, "explicit-euler", 2)
    np.testing.assert_array_equal(run.states[-1], np.full(3, 2.25))


def test_a_state_that_stands_still():
    problem = Problem(lambda t, y, args: jnp.zeros(3), [1.0, 2.0, 3.0], [0.0, 1.0, 2.0])
    for stepper in ("explicit-euler", "rk4"):
        np.testing.assert_array_equal(simulate(problem, stepper, 3).states, [[1.0, 2.0, 3.0]] * 3)
