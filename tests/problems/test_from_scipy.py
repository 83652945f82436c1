"""Problems written for SciPy's solvers, in NumPy; and problems as these solvers take them."""

from __future__ import annotations

import functools
import inspect
import math
import os
import pickle
import random
import sys
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ropeode import Ensemble, Problem, Rope, error_series, reference, simulate
from ropeode.errors import InputError, UserCodeError
from ropeode.precision import in_float64
from ropeode.problems import PROBLEMS
from tests.references.covered import assert_covered

SLOW = pytest.mark.slow


def pendulum(t, y, strength):
    """A pendulum in NumPy, which JAX cannot trace."""
    return [y[1], -strength * math.sin(y[0])]


def pendulum_in_jax(t, y, strength):
    return jnp.stack([y[1], -strength * jnp.sin(y[0])])


def heun(rhs, t, y, dt, args):
    # `float` is what JAX cannot trace.
    k = rhs(t, y, args)
    return y + float(dt) / 2 * (k + rhs(t + dt, y + dt * k, args))


START, STRENGTH = [1.0, 0.0], 1.3
PLAIN = Problem(pendulum_in_jax, START, [0.0, 2.0], STRENGTH)
IN_PYTHON = Problem.from_scipy(pendulum, (0.0, 2.0), START, args=(STRENGTH,), frames=4)


def exact(times):
    return PROBLEMS["pendulum"](angle=START[0], gravity=STRENGTH).exact(times)[:, :, 0, 0]


def test_a_function_that_jax_cannot_trace_has_a_reference():
    assert (IN_PYTHON.in_python, IN_PYTHON.name) == (True, "pendulum")
    truth = reference(IN_PYTHON)
    assert truth.bound()[-1] < 1e-12
    assert_covered(truth, exact(IN_PYTHON.ts))


@SLOW
def test_it_has_states_between_the_samples():
    known, times = reference(IN_PYTHON, rtol=1e-9), np.linspace(0.0, 2.0, 50)
    off = np.max(np.abs(known.at(times) - exact(times)), axis=1)
    assert np.all(off <= known.bound_at(times))


def test_compiled_steps_and_steps_in_python_agree_with_jax():
    same = Problem.from_scipy(pendulum_in_jax, IN_PYTHON.ts, START, args=(STRENGTH,))
    assert not same.in_python
    for stepper in ("rk4", heun, "scipy:Radau"):
        runs = [simulate(each, stepper, 8) for each in (IN_PYTHON, same)]
        assert np.max(np.abs(runs[0].states - runs[1].states)) < 1e-13
        assert runs[0].rhs_evaluations == runs[1].rhs_evaluations


def test_members_of_an_ensemble_are_called_one_by_one():
    strengths = np.array([0.5, 1.5])
    members = Ensemble.varying(IN_PYTHON, args=(strengths,))
    for each, strength in zip(simulate(members, "rk4", 8), strengths, strict=True):
        alone = Problem.from_scipy(pendulum, IN_PYTHON.ts, START, args=(strength,))
        assert np.array_equal(each.states, simulate(alone, "rk4", 8).states)


@in_float64
def test_one_derivative_is_known():
    def rhs(t, y):
        return IN_PYTHON.rhs(t, y, IN_PYTHON.args)

    y = np.array([0.4, -2.0])
    slopes = np.asarray(jax.jit(jax.jacfwd(rhs, argnums=1))(0.0, y))
    exact = np.array([[0.0, 1.0], [-STRENGTH * np.cos(0.4), 0.0]])
    assert np.max(np.abs(slopes - exact)) < 1e-9
    driven = Problem.from_scipy(lambda t, y: y * math.sin(t), (0.0, 1.0), y)
    rate = jax.jvp(lambda t: driven.rhs(t, y, driven.args), (0.3,), (2.0,))[1]
    assert np.max(np.abs(rate - 2.0 * y * np.cos(0.3))) < 1e-9
    with pytest.raises(InputError, match="one derivative by time or state"):
        jax.jacfwd(jax.jacfwd(rhs, argnums=1), argnums=1)(0.0, y)
    with pytest.raises(InputError, match="level: 'extended' given; .* runs in Python"):
        reference(IN_PYTHON, level="extended")


def added_to(y):
    y += 1.0
    return y


def writes_to_the_state(t, y):
    y[0] = max(y[0], 1.1)
    return y


OUT = np.zeros(2)


def writes_to_its_own(t, y):
    OUT[:] = y[1], -math.sin(y[0])
    return OUT


# With arguments, and whether JAX can trace it.
KINDS = [
    (lambda t, y: np.where(y > t, np.roll(y, 1), 0.0) / np.linalg.norm(y), (), True),
    (lambda t, y: [1, 0], (), True),
    (lambda t, y: np.array([y[1], -np.sin(y[0])]), (), True),
    (lambda t, y: (np.reshape(y, (1, 2)).T * t)[:, 0], (), True),
    (lambda t, y: added_to(y), (), True),
    (lambda t, y: y if t < 0.5 else -y, (), False),
    (lambda t, y, table: np.interp(t, *table) * y, (np.array([[0, 9], [1, 3]]),), True),
    (writes_to_the_state, (), False),
    (writes_to_its_own, (), False),
    (lambda t, y, a, word: y[::-1] * a if word == "x" else y, (2.0, "x"), True),
]


@pytest.mark.parametrize(("function", "args", "traced"), KINDS)
def test_functions_of_many_kinds(function, args, traced):
    """In compiled steps, and in a step in Python, where no program copies what it returns."""
    problem = Problem.from_scipy(function, (0.0, 1.0), [1.0, 0.5], args=args, frames=2)
    assert problem.in_python != traced
    y = np.array([1.0, 0.5])
    assert np.array_equal(problem.y0, y)

    def copied(t, y, args):
        return np.array(function(t, y.copy(), *args), dtype=float)

    for i in range(8):
        y = heun(copied, i / 8, y, 1 / 8, args)
    for stepper in ("heun", heun):
        assert np.max(np.abs(simulate(problem, stepper, 4).states[-1] - y)) < 1e-13


@pytest.mark.parametrize("function", [lambda t, y: -y[0], lambda t, y: -math.exp(y[0])])
@in_float64
def test_the_derivative_of_one_number_may_be_a_number(function):
    problem = Problem.from_scipy(function, (0.0, 1.0), [0.5])
    slope = problem.rhs(0.0, problem.y0, None)
    assert np.asarray(slope).tolist() == [function(0.0, problem.y0)]


def test_jax_inside_a_function_in_python_computes_in_float64():
    """In threads of XLA too, which know nothing of the mode of the caller's; nor does this one."""
    assert not jax.config.jax_enable_x64  # type: ignore[attr-defined]
    problem = Problem.from_scipy(
        lambda t, y: [float(jnp.sin(1 / 3.0 + 0.0 * y[0]))], (0, 1), [1.0], frames=1
    )
    for stepper in ("explicit-euler", heun):
        assert abs(simulate(problem, stepper, 1).states[1, 0] - 1.0 - math.sin(1.0 / 3.0)) < 1e-15


class Device:
    """What it does is set later, so that one compiled function serves many."""

    acts: Any = None

    def __call__(self, t, y):
        return self.acts(t, y)


device = Device()


def acts(function):
    """A problem that runs in Python; its solution rises from 1 to above 2, and comes down again."""
    device.acts = function
    return Problem.from_scipy(device, (0.0, 2.0), [1.0], frames=2)


def rising(t):
    return 1.5 * math.cos(2.0 * t)


class FuseOfAnObject:
    __slots__ = ("tripped",)

    def __init__(self):
        self.tripped = False

    def rhs(self, t, y):
        self.tripped = self.tripped or bool(y[0] > 1.5)
        return [-y[0] if self.tripped else rising(t)]


def fuse_that_acts_later():
    """Where it acts it has always tripped before: on the way every run sees the same."""
    tripped = False

    def rhs(t, y):
        nonlocal tripped
        tripped = tripped or bool(y[0] > 1.5)
        return [-1.0 if tripped and t > 1.4 else rising(t)]

    return rhs


def fuse_of_a_default():
    def rhs(t, y, tripped=np.zeros(1)):  # noqa: B008
        tripped[:] = np.maximum(tripped, y > 1.5)
        return [-y[0] if tripped[0] else rising(t)]

    return rhs


def fuse_outside_of_python(t, y):
    if y[0] > 1.5:
        os.environ["TRIPPED"] = "1"
    return [-y[0] if "TRIPPED" in os.environ else rising(t)]


def solved(problem):
    """Without the digits that a user gets: whether it can be solved is all that is asked."""
    return reference(problem, rtol=1e-7, atol=1e-7)


def run_of_rk4(problem):
    return simulate(problem, "rk4", 64)


@pytest.mark.parametrize(
    ("words", "make"),
    [
        ("closure variable `tripped`: False -> True", fuse_that_acts_later),
        ("attribute `self.tripped", lambda: FuseOfAnObject().rhs),
        ("default value `tripped`: array", fuse_of_a_default),
    ],
)
def test_a_memory_between_calls_has_no_reference(words, make):
    """Not even when asked again, or after a run that has tripped it."""
    problem = acts(make())
    for solve in (run_of_rk4, solved):
        with pytest.raises(UserCodeError, match=f"not deterministic: .*{words}"):
            solve(problem)


@SLOW
def test_a_memory_outside_of_python_has_no_reference(monkeypatch):
    monkeypatch.delenv("TRIPPED", raising=False)
    with pytest.raises(UserCodeError, match="not deterministic: .* or reads what changes"):
        solved(Problem.from_scipy(fuse_outside_of_python, (0.0, 2.0), [1.0], frames=2))


def remembers():
    """It counts, logs and caches, has a table that it makes once, and an array for results."""
    calls, log, kept, table, out = 0, [], {}, None, np.zeros(1)

    @functools.cache
    def slow(t):
        return rising(t)

    def rhs(t, y):
        nonlocal calls, table
        calls += 1
        log.append((t, y.copy()))
        table = np.linspace(0.0, 1.0, 5) if table is None else table
        kept.setdefault(t, slow(t))
        out[0] = kept[t] + math.sin(y[0]) + 0.0 * table[-1]
        return out

    return rhs


@SLOW
def test_a_memory_that_changes_nothing_is_right():
    """Nor what the user changes between calls."""
    plain = acts(lambda t, y: [rising(t) + math.sin(y[0])])
    states = solved(plain).states
    problem = acts(remembers())
    assert np.array_equal(solved(problem).states, states)
    run_of_rk4(problem)
    device.acts = lambda t, y: [0.0 * math.sin(y[0])]
    assert solved(plain).states[-1] == 1.0


def keeps(t, y):
    return y


def solves(problem, **asked):
    return lambda: reference(problem, **asked)


TIMES, TABLE = [0.0, 1.0], np.float32([0.1, 0.2])


def ivp(function, span=(0.0, 1.0), y0=(1.0, 0.0), **more):
    return lambda: Problem.from_scipy(function, span, y0, **more)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (ivp(lambda t, y: random.random() * y), "not deterministic: at the same t and y"),
        (ivp(lambda t, y: 1 / 0), "ZeroDivisionError: division by zero at t = 0, y ="),
        (ivp(lambda t, y: sys.exit(3)), "it raised SystemExit: 3"),
        (ivp(lambda t, y: y[:1]), r"shape \(1,\) at t = 0, .*; allowed: .* \(2,\)"),
        (ivp(lambda t, y: None), "it returned None .* with `return`"),
        (ivp(lambda t, y: y.astype(np.float32)), "type float32 at t = 0, .*; allowed: float64"),
        (
            ivp(lambda t, y: np.interp(t, TIMES, TABLE) - y),
            "rhs: .*global variable `TABLE`.* float64",
        ),
        (ivp(lambda t, y: y / 0.0 if t == 0 else y), "finite numbers at the initial state"),
        (ivp(lambda y, t: y), r"order of odeint; .* `lambda t, y, \*args: fun\(y, t, \*args\)`"),
        (ivp(lambda t, y, k: y), r"a function of \(t, y, k\) given; .* \(k\): args=\(\.\.\.,\)"),
        (ivp(keeps, args=(1,)), r"one of \(t, y, a0\).* no more than it takes in args"),
        (ivp(lambda t, y, *, k: y), r"of \(t, y, \*, k\) given; .* `functools.partial\(fun, k="),
        (ivp(lambda t, y, k: y, args=1), r"write args=\(value,\), with the comma"),
        (ivp(keeps, span=(1, 0)), "begins at its smaller time. Fix: solve for -t"),
        (ivp(keeps, span=(-1e308, 1e308)), "ts: .* a span that is a number in float64"),
        (ivp(keeps, span=(1e9, 1e9 + 1e-6)), "frames: 20 .* a resolution of 1.2e-07"),
        (ivp(keeps, span=(0, 1, 2), frames=3), "frames: 3 given; allowed: none with samp"),
        (ivp(keeps, y0={"x": 1.0}), r"y0: .* Problem\(rhs, y0, ts"),
        (ivp(keeps, y0=np.ma.array([1.0, 2.0], mask=[0, 1])), "y0: .* fill the masked entries"),
        (ivp(keeps, energy=lambda t, y: 1.0), r"energy: .* `def energy\(t, y, args\):`"),
        # Of a reference, or of what is not even a problem.
        (solves(PLAIN, event=keeps), r"event: .* given; allowed: .* docs/howto/events\.md"),
        (solves(PLAIN, tolerance=1e-9), "keyword: 'tolerance' given, which does not exist"),
        (solves(pendulum), r"or Problem\.from_scipy\(fun"),
        (solves(Rope()), r"rope\.problem\(frames=20\)"),
        (solves(None), r"problem: None given; allowed: a Problem\. Fix: write Problem\("),
    ],
)
def test_what_cannot_be_used_is_met_with_what_to_write(make, words):
    with np.errstate(all="ignore"), pytest.raises(InputError, match=words):
        make()


OF_SCIPY = {*inspect.signature(solve_ivp).parameters} - {"fun", "y0", "args", "options"}
OF_METHODS = {"rtol", "atol", "max_step", "first_step", "jac", "jac_sparsity", "lband", "min_step"}


def test_keywords_of_scipy_are_met_with_what_to_write():
    for keyword in sorted(OF_SCIPY | OF_METHODS | {"event"}):
        given: Any = {keyword: lambda t, y: y[0]}
        words = "docs/howto/events.md" if keyword.startswith("event") else f"{keyword}: .* Fix: "
        for make, *numbers in (
            (Problem.from_scipy, (0.0, 2.0), START),
            (Problem, START, [0.0, 2.0]),
            (Problem.second_order, 1, 0, [0.0, 2.0]),
        ):
            with pytest.raises(InputError, match=words):
                make(pendulum, *numbers, **given)


def test_an_exception_on_the_way_comes_out_as_it_is():
    def ends_with(error):
        def rhs(t, y, strength):
            if t > 0.7:
                raise error
            return pendulum(t, y, strength)

        problem = Problem.from_scipy(rhs, (0.0, 0.5), START, args=(STRENGTH,), frames=2)
        return problem.changed(ts=IN_PYTHON.ts)

    for stepper in ("rk4", "scipy:RK45"):
        with pytest.raises(UserCodeError, match=r"no data behind 0.7 at t = 0\.7") as caught:
            simulate(ends_with(LookupError("no data behind 0.7")), stepper, 16)
        assert isinstance(caught.value.__cause__, LookupError)
    with pytest.raises(KeyboardInterrupt):
        simulate(ends_with(KeyboardInterrupt()), "rk4", 16)
    # What was raised once is over.
    assert simulate(IN_PYTHON, "rk4", 8).status == "ok"


def test_a_program_that_computes_something_else_is_not_used():
    """For a thirtieth of the span: what tells JAX that it cannot trace this is caught."""

    def rhs(t, y):
        try:
            if 0.4 < t < 0.435:
                return 2.0 * y
        except TypeError:
            pass
        return y

    def of_arrays(t, y):
        return y if isinstance(y, np.ndarray) else [y[0], y[1], y[0]]

    for function in (rhs, of_arrays):
        assert Problem.from_scipy(function, (0.0, 1.0), START).in_python


# As SciPy's solvers take them; and right-hand sides outside of JAX's float64 mode.


@SLOW
def test_a_rope_of_unequal_masses():
    """Nonlinear and damped; the states are held against its reference as they are."""
    problem = Rope(num_nodes=4, node_mass=(1, 2, 1, 0.3), damping=0.1).problem(3)
    ivp = problem.to_scipy()
    series = error_series(solve_ivp(**ivp, rtol=1e-8, atol=1e-7), truth := reference(problem))
    assert 1e-8 < series.max < 1e-3
    closer = error_series(solve_ivp(**ivp, rtol=1e-10, atol=1e-9), truth)
    # In float32 it would get no closer than 1e-4.
    assert closer.values[-1] < 0.1 * series.values[-1]
    t, y = 0.3, ivp["y0"] + np.cos(np.arange(16))
    by_differences = np.stack(
        [(ivp["fun"](t, y + h) - ivp["fun"](t, y - h)) / 2e-3 for h in 1e-3 * np.eye(16)],
        axis=1,
    )
    np.testing.assert_allclose(ivp["fun"].jac(t, y), by_differences, atol=1e-6)
    # In another process of a pool.
    again = pickle.loads(pickle.dumps(ivp))
    np.testing.assert_array_equal(again["fun"](t, y), ivp["fun"](t, y))
    # Other parameters than the problem's; and nothing that the caller could spoil.
    still = problem.args._replace(damping=0.0 * problem.args.damping)
    y[8:] = 1.0
    assert np.max(np.abs(ivp["fun"](t, y, still) - ivp["fun"](t, y))) > 0.09
    ivp["y0"][:] = ivp["t_eval"][:] = 0.0
    assert (problem.y0[0, 0, -1], problem.ts[-1]) == (-400.0, 3.0)


def test_a_function_in_python_goes_back_and_forth():
    fun = IN_PYTHON.to_scipy()["fun"]
    assert fun(0.0, [1.0, 0.5]).tolist() == pendulum(0.0, [1.0, 0.5], 1.3)
    assert fun.jac(0.0, [1.0, 0.5])[1, 0] == pytest.approx(-1.3 * np.cos(1.0), abs=1e-8)


def a_tree(t, y, args):
    return {"a": y["b"] / 3.0, "b": -y["a"]}


@pytest.mark.parametrize(
    "make",
    [
        lambda: Rope(num_nodes=4).problem(3),
        lambda: Problem(lambda t, y, args: -args * y / 3.0, [1.0, 2.0], range(3), 0.1),
        lambda: Problem(a_tree, {"a": 1.0, "b": 0.1}, range(3)),
        lambda: IN_PYTHON,
    ],
)
def test_a_right_hand_side_is_in_float64_whoever_calls_it(make):
    problem = make()
    assert not jax.config.jax_enable_x64
    given = problem.ts[0] + 0.1, problem.y0 + 0.1, problem.args
    rate = problem.rhs(*given)
    assert (type(rate), rate.dtype) == (np.ndarray, np.float64)
    np.testing.assert_allclose(rate, in_float64(problem.rhs)(*given), rtol=1e-15)
    with pytest.warns(UserWarning, match="float32.*to_scipy"):
        coarse = jax.jit(problem.rhs)(*given)
    assert coarse.dtype == jnp.float32
