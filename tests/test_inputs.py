"""Numbers in whatever form they come: lists, tuples, arrays; and not those that JAX traces.

Pyright checks this file, so that what runs here is also what type checkers let pass.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import ArrayLike

import ropeode
from ropeode import (
    Ensemble,
    Problem,
    Rope,
    Thresholds,
    accuracy_table,
    energy_curves,
    error_curves,
    error_series,
    growth_per_frame,
    jax_stepper,
    node_paths,
    observed_order,
    reference,
    simulate,
    stability_limit,
)
from ropeode.errors import InputError


def decay(t, y, args):
    return -args * y


def force(t, x, v, args):
    return -x


def numbers(form: Callable[[list], Any]) -> list[Any]:
    """What public functions make of numbers in this form, as arrays."""
    problem = Problem(decay, form([1.0, 2.0]), form([0.0, 1.0, 2.0]), 0.5)
    second = Problem.second_order(force, form([1.0]), form([0.0]), form([0.0, 1.0]))
    rope = Rope(
        start=form([0.0, 2.0]),
        end=form([-4.0, 2.0]),
        num_nodes=4,
        node_mass=form([1.0, 1.0, 1.0, 1.0]),
        pinned=form([0]),
        gravity=form([0.0, -1.0]),
        initial_velocity=form([0.0, 0.5]),
    )
    varied = Ensemble.varying(problem, y0=form([[1.0, 2.0], [2.0, 1.0]]))
    order = observed_order(form([0.5, 0.25, 0.125]), form([0.5, 0.25, 0.125]))
    ropes = rope.ensemble(frames=2, damping=form([0.0, 0.5]))
    run = simulate(problem, "rk4", np.int64(4))
    own = [problem.y0, problem.ts, second.y0, rope.problem(2).y0, run.states]
    return [*own, varied[1].y0, order.observed, ropes[1].args.damping]


FORMS: dict[str, Callable[[list], ArrayLike]] = {
    "tuple": tuple,
    "NumPy": np.asarray,
    "JAX": jnp.asarray,
}


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_numbers_in_any_form(form):
    for one, other in zip(numbers(form), numbers(list), strict=True):
        np.testing.assert_array_equal(one, other)


def test_steps_and_times_in_any_form(small_rope):
    truth = reference(small_rope)
    for steps in ((16, 32), np.array([16, 32]), jnp.array([16, 32])):
        rows = accuracy_table(truth, ["rk4"], steps).rows
        assert [row.steps_per_frame for row in rows] == [16, 32]
        assert len(error_curves(truth, ("rk4",), steps).curves) == 2
    assert len(energy_curves(truth, ["rk4"], np.array([16])).curves) == 1
    run = simulate(small_rope, "rk4", 16)
    for times in ([1.0, 2.0], (1.0, 2.0), np.array([1.0, 2.0]), jnp.array([1.0, 2.0])):
        series = error_series(run.states[1:3].tolist(), truth, times=times)
        np.testing.assert_array_equal(series.values, error_series(run, truth).values[:2])


# Calls with a number, and with an array of a few, that JAX traces: public names, and their calls.
TRACED: dict[str, list[Callable[[Any, Any], Any]]] = {
    "Problem": [
        lambda x, _: Problem(decay, [x], [0, 1], 0.1),
        lambda x, _: Problem(decay, [1.0], [0, x], 0.1),
        lambda x, _: Problem(decay, [1.0], [0, 1], x),
        lambda x, _: Problem(decay, [1.0], [0, 1], {"rate": x}),
        lambda x, _: Problem(decay, [1.0], [0, 2], 0.1, jump_times=[x]),
        lambda x, xs: Problem.second_order(force, xs, xs, [0, 1]),
        lambda x, _: Problem.from_scipy(decay, (0, x), [1.0], args=(0.1,)),
        lambda x, _: Problem.from_scipy(decay, (0, 1), [x], args=(0.1,)),
        lambda x, _: Problem.from_scipy(decay, (0, 1), [1.0], args=(x,)),
    ],
    "Rope": [
        lambda x, _: Rope(stiffness=x),
        lambda x, xs: Rope(num_nodes=4, stiffness=xs),
        lambda x, xs: Rope(start=xs[:2]),
        lambda x, _: Rope(start=[x, 0.0]),
        lambda x, _: Rope(num_nodes=x),
        lambda x, _: Rope().problem(frames=x),
        lambda x, xs: Rope().ensemble(damping=xs),
    ],
    "InextensibleRope": [lambda x, _: ropeode.InextensibleRope(damping=x)],
    "Ensemble": [
        lambda x, xs: Ensemble.varying(rope(), y0=xs),
        lambda x, xs: Ensemble.varying(rope(), args=rope().args._replace(damping=xs)),
    ],
    "Thresholds": [lambda x, _: Thresholds(speed=x)],
    "simulate": [lambda x, _: simulate(rope(), "rk4", x)],
    "simulate_chunks": [lambda x, _: ropeode.simulate_chunks(ropes(), "rk4", x)],
    "jax_stepper": [lambda x, _: jax_stepper(rope(), "rk4").states(x)],
    "reference": [
        lambda x, _: reference(rope(), accuracy=x),
        lambda x, _: reference(rope(), rtol=x),
        lambda x, _: reference(rope(), atol=x),
        lambda x, _: reference(rope(), time_limit=x),
    ],
    "each_reference": [
        lambda x, _: ropeode.each_reference(ropes(), accuracy=x),
        lambda x, _: ropeode.each_reference(ropes(), workers=x),
    ],
    "accuracy_table": [lambda x, xs: accuracy_table(rope(), ["rk4"], xs)],
    "error_curves": [lambda x, xs: error_curves(rope(), ["rk4"], xs)],
    "energy_curves": [lambda x, _: energy_curves(rope(), ["rk4"], [x])],
    "node_paths": [lambda x, _: node_paths(rope(), ["rk4"], x)],
    "observed_order": [
        lambda x, xs: observed_order(xs, [1, 2, 3]),
        lambda x, xs: observed_order([1, 2, 3], xs),
        lambda x, xs: observed_order([1, 2, 3], [x, None, 1.0]),
    ],
    "growth_per_frame": [
        lambda x, _: growth_per_frame(rope(), "rk4", x),
        lambda x, xs: growth_per_frame(rope(), "rk4", 4, rope().y0 * x),
    ],
    "stability_limit": [lambda x, _: stability_limit(rope(), "rk4", rope().y0 * x)],
    "lyapunov_exponent": [
        lambda x, _: ropeode.lyapunov_exponent(rope(), tangents=x),
        lambda x, _: ropeode.lyapunov_exponent(rope(), rtol=x),
    ],
    "horizon": [lambda x, _: ropeode.horizon(rope(), [x])],
    "as_stepper": [lambda x, _: ropeode.as_stepper(force, order=x)],
    "check_stepper": [lambda x, _: ropeode.check_stepper("rk4", x)],
    "explain_stepper": [lambda x, xs: ropeode.explain_stepper("rk4", rope(), steps_per_frame=xs)],
    "rope_report": [lambda x, _: ropeode.rope_report([1], x)],
}
# The others take results, files and words.


def rope() -> Any:
    return Rope(num_nodes=4).problem(frames=3)


def ropes() -> Ensemble:
    return Rope(num_nodes=4).ensemble(frames=3, damping=[0.0, 0.1])


@pytest.mark.parametrize("name", TRACED)
def test_what_jax_traces_is_met_with_what_to_do(name):
    for use in TRACED[name]:

        def traced(x: Any, use: Callable = use) -> Any:
            use(x, jnp.stack([x, 2 * x, 3 * x]))
            return x

        for transformation in (jax.grad, jax.jit):
            with pytest.raises(InputError, match="a value that JAX traces given.*jax_stepper"):
                transformation(traced)(1.0)


def test_states_that_jax_traces(small_rope):
    truth, run = reference(small_rope), simulate(small_rope, "rk4", 16)
    with pytest.raises(InputError, match="jax_stepper"):
        jax.jit(lambda states: error_series(states, truth).max)(run.states)
