"""Well-known problems against their own invariants.

What others have published of them is held against the stored library of references.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.problems import PROBLEMS, ROPES


@pytest.mark.slow
def test_double_pendulum_obeys_lagranges_equations():
    """The mass matrix and the forces by differentiating the Lagrangian of two points."""
    problem = PROBLEMS["double-pendulum"](masses=[1.3, 0.7], lengths=[0.8, 1.9], gravity=1.4)
    args = problem.args

    def lagrangian(angles, spins):
        def places(angles):
            x = jnp.cumsum(args.lengths * jnp.sin(angles))
            y = jnp.cumsum(-args.lengths * jnp.cos(angles))
            return jnp.stack([x, y])

        points, velocities = jax.jvp(places, (angles,), (spins,))
        kinetic = 0.5 * jnp.sum(args.masses * velocities**2)
        return kinetic - args.gravity * jnp.sum(args.masses * points[1])

    random = np.random.default_rng(0)
    with jax.enable_x64(True):
        for angles, spins in random.normal(size=(5, 2, 2)) * 2:
            mass = jax.hessian(lagrangian, 1)(angles, spins)
            mixed = jax.jacfwd(jax.grad(lagrangian, 1), 0)(angles, spins)
            forces = jax.grad(lagrangian, 0)(angles, spins) - mixed @ spins
            expected = np.linalg.solve(mass, forces)
            y = np.stack([angles, spins])[..., None]
            found = np.asarray(problem.rhs(0.0, y, args))[1, :, 0]
            np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


CONSERVING = (
    *("oscillator", "linear-chain", "kepler", "pendulum"),
    *("double-pendulum", "henon-heiles", "arenstorf", "pleiades"),
)


@pytest.mark.parametrize("name", CONSERVING)
def test_the_energy_is_constant_along_every_motion(name):
    """Its slope has no part along the right-hand side, at any state."""
    problem = PROBLEMS[name](**({"damping": 0.0} if name == "oscillator" else {}))

    @jax.jit
    def rates(y):
        return jax.grad(problem.energy, 1)(0.0, y, problem.args) * problem.rhs(0.0, y, problem.args)

    random = np.random.default_rng(1)
    with jax.enable_x64(True):
        for _ in range(5):
            parts = np.asarray(rates(problem.y0 + random.normal(size=problem.y0.shape)))
            assert abs(np.sum(parts)) <= 1e-12 * np.sum(np.abs(parts))


def test_every_energy_is_looked_at():
    have_one = {name for name, make in PROBLEMS.items() if make().energy is not None}
    assert have_one == {*CONSERVING, *ROPES}


def test_a_pendulum_released_near_the_top_lingers():
    # One half period is ln(16/k'^2) to the leading order, k' = cos(angle/2).
    angle = np.pi - 1e-6
    near = PROBLEMS["pendulum"](angle=angle)
    half = float(np.log(16.0 / np.cos(angle / 2) ** 2))
    np.testing.assert_allclose(near.exact(np.array([half]))[0, 0, 0, 0], -angle, rtol=1e-12)
