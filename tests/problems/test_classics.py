"""Well-known problems against their own invariants.

What others have published of them is held against the stored library of references.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.problems import PROBLEMS, ROPES
from tests.problems.in_jax import in_jax


def test_double_pendulum_obeys_newtons_second_law():
    """What the rods pull does no work in any motion that they allow."""
    problem = PROBLEMS["double-pendulum"](masses=[1.3, 0.7], lengths=[0.8, 1.9], gravity=1.4)
    args = problem.args

    def places(angles):
        sides = jnp.stack([jnp.sin(angles), -jnp.cos(angles)])
        return jnp.cumsum(args.lengths * sides, axis=1)

    def velocities(angles, spins):
        return jax.jvp(places, (angles,), (spins,))[1]

    with jax.enable_x64(True):
        for angles, spins in np.random.default_rng(0).normal(size=(5, 2, 2)) * 2:
            changes = problem.rhs(0.0, np.stack([angles, spins])[..., None], args)[1, :, 0]
            a = jax.jvp(velocities, (angles, spins), (spins, changes))[1]
            pulls = args.masses * (a + np.array([[0.0], [args.gravity]]))
            work = np.tensordot(pulls, jax.jacfwd(places)(angles), 2)
            assert np.max(np.abs(work)) <= 1e-12 * np.max(np.abs(pulls))


def test_energies_are_constant_along_every_motion():
    """Their slopes have no part along the right-hand side, at any state."""
    having = []
    for name in PROBLEMS.keys() - ROPES.keys():
        problem = PROBLEMS[name](**({"damping": 0.0} if name == "oscillator" else {}))
        if problem.energy is None:
            continue
        having.append(name)
        slope = jax.grad(problem.energy, 1)
        for moved in np.random.default_rng(1).normal(size=(5, *problem.y0.shape)):
            y = problem.y0 + moved
            rates = in_jax(slope, 0.0, y, problem.args) * problem.rhs(0.0, y, problem.args)
            assert abs(np.sum(rates)) <= 1e-12 * np.sum(np.abs(rates)), name
    assert len(having) >= 8


def test_a_pendulum_released_near_the_top_lingers():
    # One half period is ln(16/k'^2) to the leading order, k' = cos(angle/2).
    angle = np.pi - 1e-6
    near = PROBLEMS["pendulum"](angle=angle)
    half = float(np.log(16.0 / np.cos(angle / 2) ** 2))
    np.testing.assert_allclose(near.exact(np.array([half]))[0, 0, 0, 0], -angle, rtol=1e-12)
