"""What a step carries is handed on as it is, in another order."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.problems.rope import Rope
from ropeode.simulation import driver, program, simulate
from ropeode.simulation.system import positions_last
from ropeode.steppers.phase import Phase


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int64])
def test_same_numbers_of_the_same_kind(dtype):
    with jax.enable_x64(True):
        x, v = np.array([[1, 2]], dtype), np.array([[np.iinfo(np.int32).max, -3]], dtype)
        found = jax.jit(lambda x, v, dt: positions_last(Phase(x, v), dt > 0))(x, v, 0.5)
    for half, given in zip(found, (x, v), strict=True):
        assert half.dtype == dtype
        assert np.array_equal(half, given)


def test_what_is_no_phase_is_handed_on():
    carried = (jnp.ones(3), 2)
    assert positions_last(carried, True) is carried


def test_positions_do_not_depend_on_the_velocity_that_is_read():
    """Not even where it is no number: the choice reads it, and does not follow it."""
    found = positions_last(Phase(jnp.ones((2, 2)), jnp.full((2, 2), jnp.nan)), jnp.asarray(True))
    assert np.array_equal(found.x, np.ones((2, 2)))


def test_no_digit_of_a_run_changes(monkeypatch):
    problem = Rope(num_nodes=5).problem(frames=2)
    found = simulate(problem, "explicit-euler", 7).states
    monkeypatch.setattr(program, "slot", lambda *_: program.Slot())
    monkeypatch.setattr(program, "_description", lambda *_: None)
    monkeypatch.setattr(driver, "positions_last", lambda carried, always: carried)
    assert np.array_equal(simulate(problem, "explicit-euler", 7).states, found)
