"""Numbers in whatever form they come: lists, tuples, arrays; and not those that JAX traces.

Pyright checks this file, so that what runs here is also what type checkers let pass.
"""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Iterator
from typing import Any, get_type_hints

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import ArrayLike

import ropeode
from ropeode import Ensemble, Problem, Rope, observed_order, simulate
from ropeode.errors import InputError
from ropeode.references import Asked, More
from ropeode.simulation.jax_stepper import jax_stepper


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


@pytest.fixture(scope="module")
def truth():
    """A reference that nobody need compute."""
    return ropeode.load("pendulum")


def test_steps_and_times_in_any_form(truth):
    forms = ((16, 32), np.array([16, 32]), jnp.array([16, 32]))
    for steps in forms:
        rows = ropeode.accuracy_table(truth, ["rk4"], steps).rows
        assert [row.steps_per_frame for row in rows] == [16, 32]
        assert len(ropeode.error_curves(truth, ("rk4",), steps).curves) == 2
    assert len(ropeode.energy_curves(truth, ["rk4"], np.array([16])).curves) == 1
    run = simulate(truth.problem, "rk4", 16)
    first = truth.times[1:3]
    for times in (first, first.tolist(), tuple(first), jnp.asarray(first)):
        series = ropeode.error_series(run.states[1:3].tolist(), truth, times=times)
        np.testing.assert_array_equal(series.values, ropeode.error_series(run, truth).values[:2])


ROPE = Rope(num_nodes=4).problem(frames=3)
ROPES = Rope(num_nodes=4).ensemble(frames=3, damping=[0.0, 0.1])
# What takes numbers by its annotation; Any takes steppers and forms of numbers.
TAKES_NUMBERS = re.compile(r"\b(float|int|SupportsIndex|ArrayLike)\b|^Any$")
OPTIONS = {"Unpack[Asked]": Asked, "Unpack[More]": More}
PUBLIC = {name: getattr(ropeode, name) for name in vars(ropeode)["__all__"]}


@pytest.fixture(scope="module")
def given(truth, tmp_path_factory) -> dict[str, Any]:
    """Values of the parameters that must be given, in calls of public functions."""
    path = tmp_path_factory.mktemp("kept") / "pendulum.nc"
    ropeode.save_reference(truth, path)
    return {
        **dict.fromkeys(("problem", "given"), ROPE),
        **dict.fromkeys(("stepper", "step"), "rk4"),
        **dict.fromkeys(("dts", "errors"), (1.0, 2.0, 3.0)),
        # The numbers are looked at before these.
        **dict.fromkeys(("files", "paths", "explanation")),
        "folder": "out",
        "spec": {},
        "path": str(path),
        "ensemble": ROPES,
        "reference": truth,
        "trajectory": truth.states,
        "steppers": ["rk4"],
        "steps_per_frame": 4,
        "what": force,
    }


def needed(function: Callable) -> list[str]:
    """The parameters of a function that must be given."""
    parameters = inspect.signature(function).parameters.values()
    return [
        each.name
        for each in parameters
        if each.default is each.empty and each.kind is not each.VAR_KEYWORD
    ]


def numbers_of(function: Callable) -> dict[str, str]:
    """The parameters of a function that take numbers, and their annotations."""
    found = {}
    for each in inspect.signature(function).parameters.values():
        annotation = str(each.annotation)
        if each.kind is not each.VAR_KEYWORD:
            found[each.name] = annotation
        elif annotation in OPTIONS:
            hints = get_type_hints(OPTIONS[annotation])
            found |= {name: str(hint) for name, hint in hints.items()}
    return {name: each for name, each in found.items() if TAKES_NUMBERS.search(each)}


FUNCTIONS = {
    name: found
    for name, each in PUBLIC.items()
    if inspect.isfunction(each) and (found := numbers_of(each))
}
# Calls with a number, and with an array of a few, that JAX traces, where the signature does not
# tell what they mean.
TRACED: dict[str, list[Callable[[Any, Any], Any]]] = {
    "Problem": [
        lambda x, _: Problem(decay, [x], [0, 1], 0.1),
        lambda x, _: Problem(decay, [1.0], [0, x], 0.1),
        lambda x, _: Problem(decay, [1.0], [0, 1], {"rate": x}),
        lambda x, _: Problem(decay, [1.0], [0, 2], 0.1, jump_times=[x]),
        lambda x, xs: Problem.second_order(force, xs, xs, [0, 1]),
        lambda x, _: Problem.from_scipy(decay, (0, x), [1.0], args=(0.1,)),
        lambda x, _: Problem.from_scipy(decay, (0, 1), [1.0], args=(x,)),
    ],
    "Rope": [
        lambda x, _: Rope(stiffness=x),
        lambda x, xs: Rope(num_nodes=4, stiffness=xs),
        lambda x, _: Rope(start=[x, 0.0]),
        lambda x, _: Rope(num_nodes=x),
        lambda x, _: Rope().problem(frames=x),
        lambda x, xs: Rope().ensemble(damping=xs),
    ],
    "Ensemble": [
        lambda x, xs: Ensemble.varying(ROPE, y0=xs),
        lambda x, xs: Ensemble.varying(ROPE, args=ROPE.args._replace(damping=xs)),
    ],
    "Thresholds": [lambda x, _: ropeode.Thresholds(speed=x)],
    "jax_stepper": [lambda x, _: jax_stepper(ROPE, "rk4").states(x)],
    "observed_order": [lambda x, xs: observed_order([1, 2, 3], [x, None, 1.0])],
    "growth_per_frame": [lambda x, _: ropeode.growth_per_frame(ROPE, "rk4", 4, ROPE.y0 * x)],
    "stability_limit": [lambda x, _: ropeode.stability_limit(ROPE, "rk4", ROPE.y0 * x)],
    "rope_report": [lambda x, _: ropeode.rope_report([1], x)],
}


def calls_of(name: str, given: dict[str, Any]) -> Iterator[Callable[[Any, Any], Any]]:
    """Each call with a number, a list or an array of numbers that JAX traces."""
    yield from TRACED.get(name, ())
    for number, annotation in FUNCTIONS.get(name, {}).items():
        others = {each: given[each] for each in needed(PUBLIC[name])}
        forms = [lambda x, _: x]
        if "ArrayLike" in annotation:
            forms += [lambda x, _: [x, 2.0], lambda _, xs: xs]
        for form in forms:
            yield lambda *traced, number=number, form=form, others=others: PUBLIC[name](
                **{**others, number: form(*traced)}
            )


@pytest.mark.parametrize("name", sorted({*FUNCTIONS, *TRACED}))
def test_what_jax_traces_is_met_with_what_to_do(name, given):
    """Functions are found by their signatures; of a new parameter `given` must tell a value."""
    assert {"reference", "simulate", "accuracy_table", "observed_order"} <= set(FUNCTIONS)
    calls = [*calls_of(name, given)]

    def traced(x: Any, xs: Any) -> Any:
        for call in calls:
            with pytest.raises(InputError, match="a value that JAX traces given.*jax_stepper"):
                call(x, xs)
        return x + xs[0]

    for transformation in (jax.jit, functools.partial(jax.grad, argnums=(0, 1))):
        transformation(traced)(1.0, jnp.array([1.0, 2.0, 3.0]))


def test_states_that_jax_traces(truth):
    run = simulate(truth.problem, "rk4", 16)
    with pytest.raises(InputError, match="jax_stepper"):
        jax.jit(lambda states: ropeode.error_series(states, truth).max)(run.states)


def result_of(value: Any) -> Any:
    return list(value) if inspect.isgenerator(value) else value


@pytest.mark.parametrize("value", [object(), 3], ids=["object", "number"])
@pytest.mark.parametrize(
    "name", [name for name, each in PUBLIC.items() if inspect.isfunction(each) and needed(each)]
)
def test_what_is_of_no_use_is_refused_by_name(name, value):
    """One sentence, and no error of what would be done with it; Python itself tells of paths."""
    given = dict.fromkeys(needed(PUBLIC[name]), value)
    with pytest.raises((InputError, TypeError), match=r"given.*; allowed|os\.PathLike"):
        result_of(PUBLIC[name](**given))
