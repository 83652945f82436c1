"""Problems as SciPy's solvers take them; and right-hand sides outside of JAX's float64 mode."""

from __future__ import annotations

import pickle

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ropeode import error_series, reference
from ropeode.precision import in_float64
from ropeode.problems import Problem, Rope
from tests.problems.test_from_scipy import pendulum


def test_a_rope_of_unequal_masses():
    """Nonlinear and damped; the states are held against its reference as they are."""
    problem = Rope(num_nodes=4, node_mass=(1, 2, 1, 0.3), damping=0.1).problem(3)
    ivp = problem.to_scipy()
    series = error_series(solve_ivp(**ivp, rtol=1e-8, atol=1e-7), truth := reference(problem))
    assert 1e-8 < series.max < 1e-3
    closer = error_series(solve_ivp(**ivp, rtol=1e-10, atol=1e-9), truth)
    # In float32 it would get no closer than 1e-4.
    assert closer.values[-1] < 0.1 * series.values[-1]
    t, y = 0.3, ivp["y0"] + np.cos(np.arange(16))
    by_differences = np.stack(
        [(ivp["fun"](t, y + h) - ivp["fun"](t, y - h)) / 2e-3 for h in 1e-3 * np.eye(16)],
        axis=1,
    )
    np.testing.assert_allclose(ivp["fun"].jac(t, y), by_differences, atol=1e-6)
    # In another process of a pool.
    again = pickle.loads(pickle.dumps(ivp))
    np.testing.assert_array_equal(again["fun"](t, y), ivp["fun"](t, y))
    # Other parameters than the problem's; and nothing that the caller could spoil.
    still = problem.args._replace(damping=0.0 * problem.args.damping)
    y[8:] = 1.0
    assert np.max(np.abs(ivp["fun"](t, y, still) - ivp["fun"](t, y))) > 0.09
    ivp["y0"][:] = ivp["t_eval"][:] = 0.0
    assert (problem.y0[0, 0, -1], problem.ts[-1]) == (-400.0, 3.0)


def in_python():
    return Problem.from_scipy(pendulum, (0.0, 2.0), [1.0, 0.0], args=(1.3,))


def test_a_function_in_python_goes_back_and_forth():
    fun = in_python().to_scipy()["fun"]
    assert fun(0.0, [1.0, 0.5]).tolist() == pendulum(0.0, [1.0, 0.5], 1.3)
    assert fun.jac(0.0, [1.0, 0.5])[1, 0] == pytest.approx(-1.3 * np.cos(1.0), abs=1e-8)


def a_tree(t, y, args):
    return {"a": y["b"] / 3.0, "b": -y["a"]}


@pytest.mark.parametrize(
    "make",
    [
        lambda: Rope(num_nodes=4).problem(3),
        lambda: Problem(lambda t, y, args: -args * y / 3.0, [1.0, 2.0], range(3), 0.1),
        lambda: Problem(a_tree, {"a": 1.0, "b": 0.1}, range(3)),
        in_python,
    ],
)
def test_a_right_hand_side_is_in_float64_whoever_calls_it(make):
    problem = make()
    assert not jax.config.jax_enable_x64
    given = problem.ts[0] + 0.1, problem.y0 + 0.1, problem.args
    rate = problem.rhs(*given)
    assert (type(rate), rate.dtype) == (np.ndarray, np.float64)
    np.testing.assert_allclose(rate, in_float64(problem.rhs)(*given), rtol=1e-15)
    with pytest.warns(UserWarning, match="float32.*to_scipy"):
        coarse = jax.jit(problem.rhs)(*given)
    assert coarse.dtype == jnp.float32
