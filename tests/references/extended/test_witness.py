"""A run beyond float64 as a witness of float64 runs."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import Problem, Rope, reference
from ropeode.references import witness_runs
from tests.references.scalar_problems import scalar

pytest.importorskip("heyoka", reason="heyoka is an extra")
if np.finfo(np.longdouble).nmant < 63:
    pytest.skip("the processor has no numbers of 64 bits", allow_module_level=True)


def more_digits(known):
    return [each for each in known.certificate.witnesses if each.role == "more digits"]


def test_it_sees_what_rounding_in_the_right_hand_side_hides():
    """1 - cos x cancels nearly all digits, in all float64 runs alike: here it is 0 at first."""

    def rhs(t, y, args):
        return (1 - jnp.cos(1e-8 * t)) * 1e16 + 0 * y

    ts = np.linspace(0.0, 8.0, 9)
    known = reference(Problem(rhs, [0.0], ts), accuracy=10.0)
    (beyond,) = more_digits(known)
    assert str(beyond.solver) == "heyoka Taylor, 64 bits"
    assert known.certificate.versions["heyoka"]
    # t^3 / 6, as far as float64 can tell.
    error = np.abs(known.states[:, 0] - ts**3 / 6)
    assert error[-1] > 0.05
    assert np.all(error[: known.trusted] <= known.bound())
    # Eleven bits more than float64 leave three digits.
    np.testing.assert_allclose(beyond.differences["state"], error, rtol=2e-3)


def test_its_steps_are_short_and_end_on_the_samples():
    problem = scalar("decay", 1.0, [0.0, 0.5, 1.0, 1.5, 2.0, 4.0], 0.5)
    ((_, run),) = witness_runs(reference(problem), roles=["more digits"])
    assert run.failure is None
    assert run.steps >= 1000
    np.testing.assert_allclose(run.states[:, 0], np.exp(-0.5 * problem.ts), rtol=2e-16)


@pytest.mark.parametrize(
    ("make", "many"),
    [
        pytest.param(lambda: Rope(num_nodes=4).problem(3), 1, id="few operations"),
        pytest.param(
            lambda: Rope(num_nodes=64).problem(1), 0, id="many operations", marks=pytest.mark.slow
        ),
        pytest.param(
            lambda: Problem(lambda t, y, a: jax.lax.digamma(y), [3.0], [0.0, 1.0]),
            0,
            id="no counterpart",
            marks=pytest.mark.slow,
        ),
        pytest.param(lambda: scalar("saw", 1.0, np.linspace(0, 1, 6)), 0, id="a switch"),
    ],
)
def test_it_is_there_where_it_can_be_and_is_cheap(make, many):
    assert len(more_digits(reference(make()))) == many
