"""What a user's function reads is what it was when the problem was made, and never float32."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import error_series, reference
from ropeode.errors import InputError
from ropeode.problems import Ensemble, Problem, Rope
from ropeode.simulation import simulate

TS = [0.0, 1.0, 2.5]


@dataclasses.dataclass
class Decay:
    """A right-hand side that cannot be hashed, and a method that reads its object."""

    rate: float = 1.0

    def __call__(self, t, y, args):
        return -self.rate * y

    slope = __call__


READERS = {
    "in a closure": lambda read: lambda t, y, args: -read.rate * y,
    "as a method": lambda read: read.slope,
    "as an object": lambda read: read,
    "inside jit": lambda read: lambda t, y, args: jax.jit(lambda y: -read.rate * y)(y),
}
FAST = ("in a closure", "as a method")


@pytest.mark.parametrize(
    "where", [pytest.param(e, marks=[] if e in FAST else pytest.mark.slow) for e in READERS]
)
def test_a_problem_keeps_the_equation_with_which_it_was_made(where):
    read = Decay()
    rhs = READERS[where](read)
    problem = Problem(rhs, [1.5], TS, energy=lambda t, y, args: read.rate * y[0])
    exact = 1.5 * np.exp(-np.array(TS))
    for rate in (1.0, 2.0):
        read.rate = rate
        members = Ensemble.varying(problem, y0=np.array([[1.5], [-3.0]]))
        certified, run = reference(problem), simulate(problem, "rk4", 64)
        assert np.all(np.abs(certified.states[:, 0] - exact) <= certified.bound())
        assert error_series(run, certified).final < 1e-6
        runs = simulate(members, "rk4", 64)
        np.testing.assert_allclose(runs.states[:, 0], np.outer(exact, [1.0, -2.0]), rtol=1e-6)
        assert problem.energies(problem.y0[None]) == 1.5
    new = simulate(Problem(rhs, [1.5], TS), "rk4", 64)
    np.testing.assert_allclose(new.states[:, 0], 1.5 * np.exp(-2.0 * np.array(TS)), rtol=1e-6)
    with pytest.raises(InputError, match="another problem .* has changed"):
        error_series(new, certified)


def rhs_of(function):
    """The right-hand side as a problem has it, by which programs are found again."""
    return Problem(function, np.ones(2), [0.0, 1.0]).rhs


def with_slope(slope):
    @jax.custom_jvp
    def double(y):
        return 2.0 * y

    double.defjvp(lambda inputs, moved: (double(*inputs), slope * moved[0]))
    return lambda t, y, args: double(y)


def with_seed(seed):
    key = jax.random.key(seed)
    return lambda t, y, args: y * jax.random.normal(key)


@pytest.mark.parametrize(
    "of",
    [
        lambda which: lambda t, y, args: (jnp.sin, jnp.cos)[which](y),
        lambda which: lambda t, y, args: (t - y, y - t)[which],
        lambda which: lambda t, y, args: y ** (3, 5)[which],
        lambda which: (
            lambda t, y, args: jax.lax.cond(t > 0, *[jnp.sin, jnp.tan][:: (1, -1)[which]], y)
        ),
        lambda rate: lambda t, y, args: -rate * y,
        with_slope,
        with_seed,
    ],
)
def test_functions_are_equal_if_they_compute_the_same(of):
    """Their operations, the order and parameters of these, and what is inside of them.

    With the numbers that they read, a derivative of its own, and keys of random numbers.
    """
    one, same, other = (rhs_of(of(number)) for number in (0, 0, 1))
    assert one == same != other
    assert hash(one) == hash(same)


def test_an_array_that_is_written_to_makes_another_function():
    rates = np.array([1.0, 2.0])
    before = rhs_of(lambda t, y, args: -(rates * y))
    rates[:] = 3.0
    assert rhs_of(lambda t, y, args: -(rates * y)) != before
    assert before(0.0, np.ones(2), None).tolist() == [-1.0, -2.0]


@jax.custom_vjp
def _reverse_only(y):
    return -jnp.sin(y)


_reverse_only.defvjp(lambda y: (_reverse_only(y), y), lambda y, by: (-by * jnp.cos(y),))


def test_functions_for_reverse_mode_only():
    """Implicit steppers and solvers need derivatives in forward mode.

    Beside others: an index has named parameters, and a product in place no derivative.
    """

    def rhs(t, y, args):
        twice = jax.lax.scan(lambda c, _: (0.5 * _reverse_only(c), None), y, None, length=2)[0]
        others = y[np.array([0])] + jax.nn.relu(y).at[0].multiply(2.0)
        return _reverse_only(y) + 0.0 * (twice + others)

    problem = Problem(rhs, [1.0], [0.0, 1.0])
    found = simulate(problem, "gauss4", 64).states[-1, 0]
    assert found == pytest.approx(2 * np.arctan(np.tan(0.5) * np.exp(-1.0)), rel=1e-8)


COARSE = np.float32(0.1)
with jax.enable_x64(False):
    OUTSIDE, ONE = jnp.array([0.1]), jnp.array(0.1)


@pytest.mark.parametrize(
    "rhs",
    [
        lambda t, y, args: COARSE * y,
        lambda t, y, args: OUTSIDE * y,
        lambda t, y, args: (2 * y.astype(jnp.float32)).astype(float),
        lambda t, y, args: y.astype(jnp.bfloat16).astype(float),
        lambda t, y, args: jax.lax.fori_loop(0, 3, lambda i, c: c * ONE, y),
        lambda t, y, args: jax.lax.cond(t > 1, lambda y: y * jnp.float32(0.3), jnp.sin, y),
        lambda t, y, args: jnp.real(y * jnp.array([1j], jnp.complex64)),
        # Widened already.
        lambda t, y, args: jnp.minimum(y, float(np.float32(-2.7))),
    ],
)
def test_float32_in_the_function_is_refused(rhs):
    with pytest.raises(InputError, match=r"rhs: .* allowed: numbers in float64\. Fix: .*"):
        Problem(rhs, [1.0], TS)


def decay(t, y, args):
    return -y


@pytest.mark.parametrize("coarse", [np.float32([0.1]), OUTSIDE])
def test_float32_in_the_input_is_refused(coarse):
    fine = Problem(decay, [1.0], TS)
    for make, where in (
        (lambda: Problem(decay, coarse, TS), "y0: .*float64"),
        (lambda: Problem(decay, [1.0, coarse[0]], TS), r"y0\[1\]: .*float64"),
        (lambda: Problem(decay, [1.0], [0, *coarse, *coarse + 1]), r"ts\[1\]: .*float64"),
        (lambda: Problem(decay, [1.0], TS, {"a": [1.0, coarse]}), r"args\['a'\]\[1\]: .*float64"),
        (lambda: Problem.second_order(springs, [1.0], coarse, TS), "v0: .*float64"),
        (lambda: Rope(stiffness=coarse[0]), "stiffness: .*float"),
        (lambda: Rope(gravity=np.full(3, coarse[0])), "gravity: .*float"),
        (lambda: Ensemble.varying(fine, y0=np.asarray(coarse)[None]), "y0: .*float64"),
    ):
        with pytest.raises(InputError, match=where):
            make()


def springs(t, x, v, args):
    return -x


def test_numbers_of_float64_are_not_taken_for_float32():
    def rhs(t, y, args):
        for value in (0.1, 1.0, 3.0, 0.375, 1e-3, 2.0**-20, 12345.0, 1e300, np.inf):
            y = jnp.minimum(y, value)
        return y

    assert Problem(rhs, [1.0], TS).frames == 2
