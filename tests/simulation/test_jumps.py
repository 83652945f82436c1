"""Fixed steps keep their order where the right-hand side jumps at declared times."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import (
    Ensemble,
    InputError,
    LinearDamping,
    Problem,
    accuracy_table,
    jax_stepper,
    observed_order,
    simulate,
)
from tests.exact_reference import exact_reference

START, TS = np.array([0.7, -0.3]), np.array([0.0, 0.5, 1.0, 1.5])


def pushed(jumps, ts=TS, declared=True):
    """An oscillator that is pushed by another ``t - jump + 1`` from each jump on."""
    times = np.array(jumps)

    def acceleration(t, x, v, args):
        return -args * x + jnp.sum(jnp.where(t >= times, t - times + 1.0, 0.0))

    return Problem.second_order(
        acceleration,
        START[:1, None],
        START[1:, None],
        ts,
        args=1.0,
        damping=lambda args: LinearDamping(0.0 * args, 0.0 * args),
        jump_times=jumps * declared,
    )


def exact(jumps, ts=TS):
    """Its states, in closed form."""
    after = np.maximum(ts[:, None] - np.array(jumps), 0.0)
    x = np.cos(ts) * START[0] + np.sin(ts) * START[1]
    v = np.cos(ts) * START[1] - np.sin(ts) * START[0]
    x += np.sum(1 - np.cos(after) + after - np.sin(after), axis=1)
    v += np.sum(np.sin(after) + 1 - np.cos(after), axis=1)
    return np.stack([x, v], axis=1)[:, :, None, None]


def order_of(stepper, jumps, ts=TS, declared=True):
    """The observed order, and the errors."""
    problem, steps = pushed(jumps, ts, declared), (8, 16, 32, 64)
    runs = [simulate(problem, stepper, each) for each in steps]
    errors = [np.max(np.abs(run.states - exact(jumps, ts))) for run in runs]
    order = observed_order([run.dt for run in runs], errors, resolution=1e-14)
    return order.ci95 or (np.nan, np.nan), errors


def midpoint(rhs, t, y, dt, args):
    """A step that JAX cannot trace."""
    half = y + dt / 2 * rhs(float(t), y, args)
    return y + dt * rhs(t + dt / 2, half, args)


JUMPS = {
    "inside a frame": (0.61,),
    "at a frame's end": (0.5,),
    "at a frame's end but for rounding": (np.nextafter(0.5, 1.0),),
    "near a frame's end": (1e-6, 1.0 - 1e-6),
    "two in one step": (0.61, 0.613),
    "the same one twice but for rounding": (0.61, np.nextafter(0.61, 1.0)),
    "in all frames": (0.2, 0.3, 0.77, 1.0, 1.49),
}


@pytest.mark.parametrize("jumps", JUMPS.values(), ids=JUMPS)
@pytest.mark.parametrize(
    ("stepper", "order"),
    [("rk4", 4), ("stormer-verlet", 2), (midpoint, 2)],
)
def test_the_order_holds_across_jumps(stepper, order, jumps):
    low, high = order_of(stepper, jumps)[0]
    assert order - 0.15 < low < high < order + 0.15


@pytest.mark.parametrize(
    ("stepper", "order"),
    [
        *[(name, 2) for name in ("velocity-verlet", "beeman", "adams-pece4", "bdf2")],
        *[("diffrax:Heun", 2), ("gauss4", 4), ("yoshida4", 4), ("rkn4", 4), ("scipy:RK45", 5)],
    ],
)
def test_all_kinds_of_steppers_start_anew_at_a_jump(stepper, order):
    low, high = order_of(stepper, (0.61, 1.0))[0]
    assert order - 0.25 < low < high < order + 0.5


def test_without_the_declaration_the_order_is_lost():
    assert min(order_of("rk4", (0.61,), declared=False)[1]) > 1e3 * order_of("rk4", (0.61,))[1][-1]


def test_frames_may_differ_in_length_and_tables_expect_the_order():
    jumps, ts = (0.61, 1.2), np.array([0.0, 0.3, 1.0, 1.5])
    assert order_of("rk4", jumps, ts)[0][0] > 3.8
    known = exact_reference(pushed(jumps), exact(jumps))
    one_step, several = accuracy_table(known, ["rk4", "adams-pece4"], [8, 16, 32]).orders
    assert (one_step.expected, one_step.order.verdict) == (4, "converges")
    # It has no earlier slopes of what begins at a jump.
    assert several.expected is None


@pytest.mark.parametrize(
    "stepper",
    ["rk4", "stormer-verlet", pytest.param("implicit-midpoint", marks=pytest.mark.slow)],
)
def test_all_drivers_make_the_same_steps(stepper):
    jumps = (0.2, 0.61, 1.0)
    problem = pushed(jumps)
    run = simulate(problem, stepper, 8)
    members = simulate(Ensemble.varying(problem, args=np.array([2.0, 1.0])), stepper, 8)
    np.testing.assert_allclose(members[1].states, run.states, rtol=1e-13)
    assert members[1].rhs_evaluations == run.rhs_evaluations
    with jax.enable_x64(True):
        own = jax_stepper(problem, stepper)
        np.testing.assert_allclose(own.states(8), run.states, rtol=1e-13)
        # A loop of one's own that ends steps on the jump.
        y, dt = problem.y0, 0.2 / 8
        carried = own.init(0.0, y, dt, problem.args)
        for i in range(8):
            carried = own.step(i * dt, carried, dt, problem.args)
        y = own.state(0.2, carried, dt, problem.args)
        np.testing.assert_allclose(y, exact(jumps, np.array([0.2]))[0], rtol=1e-3)
    if stepper == "rk4":
        # Three frames, of which two are in two parts.
        assert run.rhs_evaluations == 4 * 8 * 5


def test_members_of_an_ensemble_jump_at_the_same_times():
    problem = pushed((0.2,))
    with pytest.raises(InputError, match="differ in their jump times"):
        Ensemble.of([problem, problem.changed(jump_times=[0.3])])


@pytest.mark.parametrize("stepper", ["explicit-euler", "implicit-euler", midpoint])
def test_what_became_of_a_run_outlasts_a_jump(stepper):
    """It is lost in the first part of the second frame."""

    def burst(t, y, args):
        return jnp.where(t < 0.5, 0.0, jnp.where(t < 0.7, 1e200, 0.0)) * y**2

    run = simulate(Problem(burst, [1.0], TS, jump_times=[0.5, 0.7]), stepper, 8)
    assert (run.status, run.diverged_at, len(run.states)) == (
        "unsolved" if stepper == "implicit-euler" else "diverged",
        2,
        2,
    )
