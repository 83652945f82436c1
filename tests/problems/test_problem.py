"""Problems that users bring."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.errors import InputError, UserCodeError
from ropeode.problems import LinearDamping, Problem


def decay(t, y, args):
    return -y


GOOD = {"rhs": decay, "y0": [1.0, 2.0], "ts": [0.0, 1.0, 3.0]}


def test_values_are_kept_as_read_only_copies_in_float64():
    mine = np.array([1, 2])
    problem = Problem(decay, mine, (0, 1, 3), {"rate": 3.0, "n": 2})
    mine[0] = 7
    assert problem.y0.tolist() == [1, 2]
    assert problem.y0.dtype == problem.ts.dtype == problem.args["rate"].dtype == np.float64
    with pytest.raises(ValueError, match="read-only"):
        problem.y0[0] = 5.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"y0": [1.0, np.nan]}, r"y0: .* correct entry \[1\], which is not finite"),
        ({"y0": "state"}, "y0: 'state' given; allowed: an array of finite real numbers"),
        ({"y0": [1.0 + 2.0j]}, "y0: .* real"),
        ({"y0": [[1.0], [1.0, 2.0]]}, "y0: "),
        ({"ts": [0.0, 1.0, 1.0]}, r"ts: \[1.0, 1.0\] given; .* entries 1 and 2"),
        ({"ts": [0.0]}, "ts: .* at least two"),
        ({"jump_times": [5.0]}, r"jump_times: .* inside \(0.0, 3.0\)"),
        ({"exact": 3}, "exact: 3 given; allowed: a function"),
        ({"args": {"rate": "fast"}}, "args: 'fast' given"),
        ({"rhs": 3}, "rhs: 3 given; allowed: a function rhs"),
        ({"rhs": lambda t, y: y}, r"write `def rhs\(t, y, args\):`, or use Problem.from_scipy"),
        ({"rhs": lambda t, y, args: y[:1]}, r"rhs result: \(1,\) given; .* \(2,\)"),
        ({"rhs": lambda t, y, args: jnp.log(-y)}, "rhs result: .* finite numbers at the initial"),
    ],
)
def test_bad_problems(change, words):
    with pytest.raises(InputError, match=words):
        Problem(**{**GOOD, **change})


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
    # The first-order form: velocities, and accelerations.
    v, a = turned.rhs(1.0, turned.y0, None)
    assert v.tolist() == [[5.0] * 3] * 2
    assert a.tolist() == [[1.0, 0.0, -1.0], [-2.0, -3.0, -4.0]]


def undamped(t, x, v, args):
    return -x


def damped(t, x, v, args):
    return -x - 0.3 * v


def with_damping(acceleration, rate):
    return Problem.second_order(
        acceleration, [1.0], [0.5], [0.0, 1.0], damping=lambda args: LinearDamping(rate, rate)
    )


def test_damping_is_found_out():
    assert (
        Problem.second_order(undamped, [1.0], [0.5], [0.0, 1.0]).mechanics.damping(None).rate == 0
    )
    assert Problem.second_order(damped, [1.0], [0.5], [0.0, 1.0]).mechanics.damping is None
    assert with_damping(damped, 0.3).mechanics.damping is not None
    for acceleration in (damped, undamped):
        with pytest.raises(InputError, match="damping: the acceleration does not change"):
            with_damping(acceleration, 0.2)


@pytest.mark.parametrize(
    ("x0", "v0", "acceleration", "words"),
    [
        ([1.0], [1.0, 2.0], undamped, r"v0: \(2,\) given; .* \(1,\)"),
        (np.ones((2, 2, 2)), np.ones((2, 2, 2)), undamped, "x0: "),
        ([1.0], [1.0], lambda t, x, v, args: jnp.ones(3), "acceleration result: .* state's shape"),
    ],
)
def test_second_order_faults(x0, v0, acceleration, words):
    with pytest.raises(InputError, match=words):
        Problem.second_order(acceleration, x0, v0, [0, 1])


@pytest.mark.parametrize(
    ("ts", "equal"),
    [(np.linspace(0, 1, 11), True), (1e6 + 0.1 * np.arange(50), True), ([0, 1, 2.001], False)],
)
def test_equal_frames(ts, equal):
    assert Problem(decay, [1.0], ts).equal_frames == equal


@pytest.mark.parametrize("rate", [5e-324, 2e-308])
def test_damping_too_small_for_a_normal_number_is_no_fault(rate):
    """XLA flushes such numbers to zero where NumPy computes on with them."""
    assert with_damping(lambda t, x, v, args: -rate * v, rate).mechanics.damping is not None
