"""Steppers inside a user's own `jit`, `vmap` and `grad`."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.errors import InputError
from ropeode.problems import InextensibleRope, Problem, Rope
from ropeode.simulation import simulate
from ropeode.simulation.jax_stepper import jax_stepper
from ropeode.steppers import as_stepper
from tests.checking import steps
from tests.steppers.every_variant import REPRESENTATIVES, SINGLE_OPTIONS

FRAMES, STEPS, NODES = 3, 32, 4
OTHERS = [as_stepper(steps.rk4), "diffrax:Heun", "diffrax:Kvaerno3", "diffrax:LeapfrogMidpoint"]
# Each way to step, once; with one iteration implicit ones can be differentiated backwards too.
EVERY = [
    *(e for e in SINGLE_OPTIONS if e.label in REPRESENTATIVES or e.label.endswith("newton=1")),
    *OTHERS,
]
FORWARDS, BACKWARDS = jax.jacfwd, jax.grad


def ways_of(stepper):
    """How it can be differentiated."""
    if str(stepper).startswith("diffrax") and "Leapfrog" not in stepper:
        return [BACKWARDS]
    newton, name = getattr(stepper, "newton", "1"), getattr(stepper, "name", "")
    iterates = newton == "converged" or name == "rattle"
    return [FORWARDS] if iterates else [FORWARDS, BACKWARDS]


def problem_for(stepper) -> Problem:
    kind = InextensibleRope if getattr(stepper, "keeps_lengths", False) else Rope
    return kind(num_nodes=NODES, damping=0.1).problem(FRAMES)


@pytest.fixture
def float64():
    with jax.enable_x64(True):
        yield


@pytest.mark.slow
@pytest.mark.usefixtures("float64")
@pytest.mark.parametrize("stepper", EVERY, ids=lambda each: getattr(each, "label", each))
def test_every_stepper(stepper):
    """The same states as a run; compiled, mapped, and differentiated, against differences."""
    problem = problem_for(stepper)
    own = jax_stepper(problem, stepper)

    def end(mass):
        args = problem.args._replace(mass=mass * jnp.ones(NODES))
        return own.states(STEPS, args=args)[-1, 0, 1, -1]

    whole = jax.jit(lambda y0: own.states(STEPS, y0))(problem.y0)
    run = simulate(problem, stepper, STEPS)
    # XLA may round a step otherwise inside another program.
    np.testing.assert_allclose(whole, run.states, rtol=1e-12, atol=1e-9)
    assert whole.shape == run.states.shape
    h = 1e-4
    either = jax.jit(jax.vmap(end))(jnp.array([1.0, 1.0 - h, 1.0 + h]))
    np.testing.assert_allclose(either[0], run.states[-1, 0, 1, -1], rtol=1e-12)
    slope = float(either[2] - either[1]) / (2 * h)
    for way in ways_of(stepper):
        # The third derivative times h**2, and the rounding of a height over h.
        assert float(jax.jit(way(end))(1.0)) == pytest.approx(slope, rel=1e-5, abs=1e-7)


@pytest.mark.usefixtures("float64")
def test_a_loop_of_ones_own(small_rope):
    """With what a two-step method carries."""
    own = jax_stepper(small_rope, "stormer-verlet")
    args, dt = small_rope.args, 0.25

    @jax.jit
    def after_a_frame(y0):
        carried = own.init(0.0, y0, dt, args)
        for i in range(4):
            carried = own.step(i * dt, carried, dt, args)
        return own.state(1.0, carried, dt, args)

    expected = simulate(small_rope, "stormer-verlet", 4).states[1]
    np.testing.assert_allclose(after_a_frame(small_rope.y0), expected, rtol=1e-12, atol=1e-9)


def test_float32_is_refused(small_rope):
    own = jax_stepper(small_rope, "rk4")
    start = 0.0, small_rope.y0, 0.1, small_rope.args
    for use in (lambda: own.states(4), lambda: jax.jit(own.init)(*start)):
        with pytest.raises(InputError, match="jax_enable_x64: False given"):
            use()


def test_what_jax_cannot_trace_is_refused(small_rope):
    for stepper in (steps.in_loops, "scipy:RK45"):
        with pytest.raises(InputError, match=r"^stepper: .*runs in Python"):
            jax_stepper(small_rope, stepper)
