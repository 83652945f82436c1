"""Loops in one function compute what they compute without."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.problems.problem import Problem
from ropeode.problems.rope import Rope
from ropeode.simulation import kernel_fusion, simulate
from ropeode.simulation.kernel_fusion import in_one_kernel
from tests.steppers.every_variant import every_name


@pytest.fixture(autouse=True)
def in_float64():
    with jax.enable_x64(True):
        yield


def lowered(loop, *inputs):
    return jax.jit(lambda *inputs: in_one_kernel(loop, *inputs)).lower(*inputs)


def is_marked(program):
    """Here, and not by XLA, which comes after this text."""
    return "xla_cpu_small_call" in program.as_text()


def counting(function):
    return lambda y, n: jax.lax.fori_loop(0, n, lambda i, y: function(y), y)


def test_small_loops_are_marked_and_large_ones_are_not():
    loop = counting(lambda y: y + 0.5 * jnp.sin(y))
    for size, marked in ((100, True), (kernel_fusion._LARGEST // 8, False)):
        program = lowered(loop, np.ones(size), np.int64(3))
        assert is_marked(program) == marked
        expected = np.ones(size)
        for _ in range(3):
            expected = expected + 0.5 * np.sin(expected)
        np.testing.assert_allclose(
            program.compile()(np.ones(size), np.int64(3)), expected, rtol=1e-15
        )


@pytest.mark.parametrize(
    "function",
    [
        lambda y: y @ np.ones((100, 100)) / 100,
        lambda y: jnp.sort(y) * 1.5,
        lambda y: jnp.cumsum(y) / 100,
        lambda y: jnp.fft.ifft(jnp.fft.fft(y)).real,
        lambda y: jax.lax.linalg.cholesky(jnp.diag(y))[0],
        # In float32: it converts arrays in threads where float64 may be off.
        lambda y: y + jax.pure_callback(np.asarray, jnp.float32(y), jnp.float32(y)),
    ],
    ids=["product", "sort", "sum", "transform", "factors", "callback"],
)
def test_what_calls_into_libraries_stays_outside(function):
    program = lowered(counting(function), np.linspace(1, 2, 100), np.int64(1))
    assert not is_marked(program)
    assert np.all(np.isfinite(program.compile()(np.linspace(1, 2, 100), np.int64(1))))


def test_inputs_that_nothing_reads():
    """XLA ends the process on a parameter of the function that nothing reads."""
    program = lowered(
        lambda y, unused, n: counting(lambda y: y * 1.5)(y, n),
        np.ones(3),
        {"a": np.ones((2, 2)), "b": np.int64(4), "c": True},
        np.int64(2),
    )
    assert is_marked(program)
    found = program.compile()(
        np.ones(3), {"a": np.ones((2, 2)), "b": np.int64(4), "c": True}, np.int64(2)
    )
    np.testing.assert_array_equal(found, np.full(3, 2.25))


def test_a_state_that_stands_still():
    problem = Problem(lambda t, y, args: jnp.zeros(3), [1.0, 2.0, 3.0], [0.0, 1.0, 2.0])
    for stepper in ("explicit-euler", "rk4"):
        np.testing.assert_array_equal(simulate(problem, stepper, 3).states, [[1.0, 2.0, 3.0]] * 3)


# Whether a step does what it should inside such a loop, tests/steppers/test_formulas.py says.
@pytest.mark.parametrize("stepper", every_name("rk4"))
def test_the_same_with_and_without(stepper, monkeypatch):
    rope = Rope(
        num_nodes=5, start=(0, 200, 0), end=(-400, 200, 0), gravity=(0, -1, 0),
        node_mass=2.0, damping=0.3, pinned=(2,), initial_velocity=(1.0, 2.0, 0.5),
    ).problem(frames=3)  # fmt: skip
    with_it = simulate(rope, stepper, 12)
    monkeypatch.setattr(kernel_fusion, "_LARGEST", -1)
    # Equal, and not the same, so that it is compiled anew.
    without = simulate(rope.changed(rhs=lambda *given: rope.rhs(*given)), stepper, 12)
    assert with_it.status == without.status == "ok"
    # The same operations, but a product and a sum may be rounded together in one and not in
    # the other.
    allowed = 200 * np.finfo(float).eps * np.max(np.abs(without.states))
    assert np.max(np.abs(with_it.states - without.states)) <= allowed
