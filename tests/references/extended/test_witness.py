"""A run beyond float64 as a witness of float64 runs."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.problems import Problem, Rope
from ropeode.progress import silent
from ropeode.references.compute import reference
from ropeode.references.extended import witness as module
from ropeode.references.extended.taylor import HARDWARE, in_hardware
from ropeode.references.ladder import short_steps
from ropeode.references.solvers.solution import Solution
from ropeode.references.solvers.solver import DOPRI8, taylor

pytest.importorskip("heyoka", reason="heyoka is an extra")
if not in_hardware():
    pytest.skip("the processor has no numbers of 64 bits", allow_module_level=True)


def test_it_sees_what_rounding_in_the_right_hand_side_hides():
    """1 - cos x cancels nearly all digits, in all float64 runs alike: here it is 0 at first."""

    def rhs(t, y, args):
        return (1 - jnp.cos(1e-8 * t)) * 1e16 + 0 * y

    ts = np.linspace(0.0, 8.0, 9)
    known = reference(Problem(rhs, [0.0], ts), accuracy=10.0)
    (beyond,) = (w for w in known.certificate.witnesses if w.role == "more digits")
    assert beyond.solver == taylor(HARDWARE)
    assert known.certificate.versions["heyoka"]
    # t^3 / 6, as far as float64 can tell.
    error = np.abs(known.states[:, 0] - ts**3 / 6)
    assert error[-1] > 0.05
    assert np.all(error[: known.trusted] <= known.bound())
    # Eleven bits more than float64 leave three digits.
    np.testing.assert_allclose(beyond.differences["state"], error, rtol=2e-3)


def beyond(problem, steps=100):
    like = Solution(
        DOPRI8, 1e-13, 1e-13, np.zeros((len(problem.ts), *problem.y0.shape)), steps, 0.0
    )
    # Not in float64 mode, as the caller may not be.
    return module.run_beyond_float64(problem, like, short_steps(problem, problem.ts), silent)


def test_its_steps_are_short_and_end_on_the_samples():
    problem = Problem(lambda t, y, args: args * y, [1.0], [0.0, 0.5, 4.0], -0.5)
    run = beyond(problem)
    assert run.failure is None
    assert run.steps >= 1000
    np.testing.assert_allclose(run.states[:, 0], np.exp(-0.5 * problem.ts), rtol=2e-16)


@pytest.mark.parametrize(
    "problem",
    [
        Problem(lambda t, y, a: jax.lax.digamma(y), [1.0], [0.0, 1.0]),
        Problem(lambda t, y, a: jnp.where(t < 0.7, y, -y), [1.0], [0.0, 1.0]),
        Problem(lambda t, y, a: y * y, [1.0], [0.0, 0.5, 1.5]),
        # Twice as many operations as are cheap, and twice as many in all steps.
        Problem(lambda t, y, a: jnp.sin(y), np.ones(2 * module.MOST_OPERATIONS), [0.0, 1.0]),
        Problem(lambda t, y, a: jnp.sin(y), np.ones(400), np.linspace(0, 1, 2000)),
    ],
    ids=["no counterpart", "a switch", "a pole", "many operations", "many steps"],
)
def test_it_does_without(problem):
    assert beyond(problem) is None


def test_operations_are_counted():
    def rhs(t, y, args):
        twice = jax.lax.fori_loop(0, 5, lambda i, z: z * y, y)
        return jnp.ones((3, 3)) @ y + jnp.sin(y)[::-1] + twice

    # Nine products for the matrix, three numbers each for the sine and two sums, five products.
    counted = module.operations(Problem(rhs, [1.0, 2.0, 3.0], [0.0, 1.0]))
    assert 9 + 3 + 6 + 15 <= counted <= 45
    assert module.operations(Rope(num_nodes=16).problem()) < module.MOST_OPERATIONS
    assert module.operations(Rope(num_nodes=64).problem()) > module.MOST_OPERATIONS
