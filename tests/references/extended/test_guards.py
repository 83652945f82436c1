"""Where a right-hand side begins to make another choice."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.problems import Problem
from ropeode.references.extended.guards import Guards


@pytest.mark.parametrize(
    ("rhs", "states", "first"),
    [
        # Inside the two ends at the start; then at an end's other side.
        (lambda y: jax.lax.clamp(-1.0, y, 1.0), [0.5, 0.9, 1.1], (2, "clamp")),
        (lambda y: jax.lax.clamp(-1.0, y, 1.0), [0.5, -0.9, -1.1], (2, "clamp")),
        (lambda y: jax.lax.clamp(-1.0, y, 1.0), [0.5, -0.9, 0.9], None),
        # Above both ends, and then inside.
        (lambda y: jax.lax.clamp(-1.0, y, 0.0), [0.5, 0.1, -0.5], (2, "clamp")),
        (jnp.abs, [0.5, 0.1, -0.1], (2, "abs")),
    ],
)
def test_the_first_state_with_another_choice(rhs, states, first):
    problem = Problem(lambda t, y, args: rhs(y), [states[0]], [0.0, 1.0, 2.0])
    with jax.enable_x64(True):
        traced = jax.make_jaxpr(problem.rhs)(0.0, problem.y0, problem.args)
        guards = Guards(problem, traced, 0.0, problem.y0)
        found = guards.breaks([0.0, 1.0, 2.0], np.array(states)[:, None])
        assert (found or [None])[0] == first
