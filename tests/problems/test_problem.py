"""Problems that users bring."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.errors import InputError, UserCodeError
from ropeode.problems import LinearDamping, Problem


def decay(t, y, args):
    return -y


def calls_python(t, y, args):
    return jax.pure_callback(np.sin, jax.ShapeDtypeStruct(y.shape, y.dtype), y)


def undamped(t, x, v, args):
    return -x


def damped(t, x, v, args):
    return -x - 0.3 * v


def first_order(**changed):
    return lambda: Problem(**{"rhs": decay, "y0": [1.0, 2.0], "ts": [0.0, 1.0, 3.0], **changed})


def second_order(acceleration, x0, v0, rate=None):
    damping = None if rate is None else lambda args: LinearDamping(rate, rate)
    return lambda: Problem.second_order(acceleration, x0, v0, [0.0, 1.0], damping=damping)


def test_values_are_kept_as_read_only_copies_in_float64():
    mine = np.array([1, 2])
    problem = Problem(decay, mine, (0, 1, 3), {"rate": 3.0, "n": 2})
    mine[0] = 7
    assert problem.y0.tolist() == [1, 2]
    assert problem.y0.dtype == problem.ts.dtype == problem.args["rate"].dtype == np.float64
    with pytest.raises(ValueError, match="read-only"):
        problem.y0[0] = 5.0


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (first_order(y0=[1.0, np.nan]), r"y0: .* correct entry \[1\], which is not finite"),
        (first_order(y0="state"), "y0: 'state' given; allowed: an array of finite real numbers"),
        (first_order(y0=[1.0 + 2.0j]), "y0: .* real"),
        (first_order(y0=[[1.0], [1.0, 2.0]]), "y0: "),
        (first_order(ts=[0.0, 1.0, 1.0]), r"ts: \[1.0, 1.0\] given; .* entries 1 and 2"),
        (first_order(ts=[0.0]), "ts: .* at least two"),
        (first_order(jump_times=[5.0]), r"jump_times: .* inside \(0.0, 3.0\)"),
        (first_order(exact=3), "exact: 3 given; allowed: a function"),
        (first_order(args={"rate": "fast"}), "args: 'fast' given"),
        (first_order(rhs=3), "rhs: 3 given; allowed: a function rhs"),
        (first_order(rhs=lambda t, y: y), r"`def rhs\(t, y, args\):`, or use Problem.from_scipy"),
        (first_order(rhs=lambda t, y, args: y[:1]), r"rhs result: \(1,\) given; .* \(2,\)"),
        (first_order(rhs=lambda t, y, args: jnp.log(-y)), "rhs result: .* finite numbers at the i"),
        (first_order(rhs=calls_python), "rhs: 'pure_callback' in line .*Problem.from_scipy"),
        (second_order(undamped, [1.0], [1.0, 2.0]), r"v0: \(2,\) given; .* \(1,\)"),
        (second_order(undamped, np.ones((2, 2, 2)), np.ones((2, 2, 2))), "x0: "),
        (second_order(undamped, {"a": 1.0}, {"a": 0.0}), r"x0: .* or use Problem\(rhs, "),
        (second_order(lambda t, x, v, args: jnp.ones(3), 1, 1), "acceleration result: .* shape"),
        (second_order(damped, 1, 1, 0.2), "damping: the acceleration does not change"),
    ],
)
def test_bad_problems(make, words):
    with pytest.raises(InputError, match=words):
        make()


@pytest.mark.parametrize(
    "rhs",
    [
        lambda t, y, args: y["position"],
        lambda t, y, args: np.sin(y),
        lambda t, y, args: -y if y[0] > 0 else y,
    ],
)
def test_users_exception_is_the_cause(rhs):
    words = "rhs: raised .*Error: .* when it was tried.* Problem.from_scipy"
    with pytest.raises(UserCodeError, match=words) as caught:
        Problem(rhs, [1.0, 2.0], [0.0, 1.0])
    assert caught.value.__cause__ is not None


def test_second_order_layouts():
    for x0, nodes, dim in [(1.0, 1, 1), ([1.0, 2.0], 2, 1), (np.ones((3, 2)), 3, 2)]:
        problem = Problem.second_order(lambda t, x, v, args: -x, x0, np.zeros_like(x0), [0, 1, 2])
        assert problem.y0.shape == (2, *np.shape(x0))
        states = np.stack([problem.y0] * 3)
        for shown in (problem.positions(states), problem.velocities(states)):
            assert shown.shape == (3, nodes, dim)
    turned = Problem.second_order(
        lambda t, x, v, args: t - x,
        np.arange(6.0).reshape(2, 3),
        np.full((2, 3), 5.0),
        [1, 2],
        node_axis=1,
    )
    assert turned.positions(turned.y0[None])[0].tolist() == [[0, 3], [1, 4], [2, 5]]


def test_damping_is_found_out():
    assert second_order(undamped, [1.0], [0.5])().mechanics.damping(None).rate == 0
    assert second_order(damped, [1.0], [0.5])().mechanics.damping is None
    # XLA flushes the smallest numbers to zero where NumPy computes on with them.
    for rate in (0.3, 2e-308, 5e-324):
        of_rate = second_order(lambda t, x, v, args, rate=rate: -x - rate * v, [1.0], [0.5], rate)
        assert of_rate().mechanics.damping is not None


@pytest.mark.parametrize(
    ("ts", "equal"),
    [(np.linspace(0, 1, 11), True), (1e6 + 0.1 * np.arange(50), True), ([0, 1, 2.001], False)],
)
def test_equal_frames(ts, equal):
    assert Problem(decay, [1.0], ts).equal_frames == equal
