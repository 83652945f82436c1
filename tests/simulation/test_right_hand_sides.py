"""Right-hand sides of many kinds, against the same steps in NumPy.

The loop around a right-hand side is compiled into one function where XLA can do that, which
depends on what the right-hand side calls and how large the state is.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import Problem, simulate
from tests.checking import steps

# As a function of NumPy, or of `jax.numpy`, which has the same.
CASES = {
    "small": (lambda xp, y: xp.sin(y), 100),
    "large": (lambda xp, y: xp.sin(y), 2**17 + 1),
    "long sum": (lambda xp, y: y / xp.sum(y), 3000),
    "product": (lambda xp, y: y @ xp.full((100, 100), 0.01), 100),
    "sort": (lambda xp, y: xp.sort(-y), 100),
    "transform": (lambda xp, y: xp.fft.ifft(1j * xp.fft.fft(y)).imag, 100),
    "factors": (lambda xp, y: xp.diag(xp.linalg.cholesky(xp.diag(y))), 100),
}


@pytest.mark.parametrize(("function", "size"), CASES.values(), ids=CASES)
def test_whatever_it_calls(function, size):
    start = np.linspace(1, 2, size)
    run = simulate(Problem(lambda t, y, args: function(jnp, y), start, [0.0, 1.0, 2.0]), "rk4", 2)
    expected = start
    for _ in range(4):
        expected = steps.rk4(lambda t, y, args: function(np, y), 0.0, expected, 0.5, None)
    np.testing.assert_allclose(run.states[-1], expected, rtol=1e-13)


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
