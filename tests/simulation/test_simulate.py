"""The driver; and right-hand sides of many kinds, against the same steps in NumPy."""

from __future__ import annotations

import re
import time

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import reference
from ropeode.errors import InputError
from ropeode.problems import Ensemble, Problem, Rope
from ropeode.simulation import method_of, simulate
from tests.checking.steps import in_loops, rk4
from tests.steppers.ropes import in_space


def test_time_comes_from_the_index():
    # y' = 3 t^2 by rk4 (Simpson's rule) is exact; a sum of rounded steps would drift away.
    problem = Problem(lambda t, y, args: 3 * t**2 * jnp.ones(1), [8.0], 2.0 + 0.1 * np.arange(11))
    run = simulate(problem, "rk4", 1001)
    np.testing.assert_allclose(run.states[:, 0], problem.ts**3, rtol=3e-15)


def test_one_compilation_serves_all_steps_parameters_and_short_spans():
    def decay(t, y, args):
        return -args * y

    compile_seconds = []
    for rate, frames, steps in ((0.01, 2, 4), (0.01, 2, 7), (0.3, 3, 7), (0.3, 16, 100)):
        problem = Problem(decay, [1.0], np.arange(frames + 1.0), rate)
        run = simulate(problem, "rk4", steps)
        np.testing.assert_allclose(run.states[:, 0], np.exp(-rate * problem.ts), rtol=1e-3)
        compile_seconds.append(run.compile_seconds)
    assert compile_seconds[0] > 0.0
    assert not any(compile_seconds[1:])


# In 4 frames of 9 steps: of each step, once at the start, and for each sample.
EVALUATIONS = {
    36: ["explicit-euler"],
    36 + 1: ["velocity-verlet", "leapfrog"],
    36 + 4: ["stormer-verlet:start=rest"],
    36 + 1 + 4: ["stormer-verlet", "leapfrog:form=staggered"],
    36 * 3: ["ruth3", "yoshida4"],
    36 * 4: ["rk4", "pefrl"],
    36 * 7: ["yoshida6"],
}


@pytest.mark.parametrize("calls", EVALUATIONS)
def test_evaluations_are_counted(calls):
    rope = in_space(Rope).problem(frames=4)
    for stepper in EVALUATIONS[calls]:
        assert simulate(rope, stepper, 9).rhs_evaluations == calls, stepper


def test_divergence_stops_the_run_at_its_frame():
    # y' = y^2 from 1 with one Euler step per frame: 1, 2, 6, 42, ... overflows in frame 11.
    problem = Problem(lambda t, y, args: y**2, [1.0], np.arange(1001.0))
    run = simulate(problem, "explicit-euler", 1)
    expected = [1.0]
    while len(expected) < 11:
        expected.append(expected[-1] + expected[-1] ** 2)
    assert (run.status, run.diverged_at, run.rhs_evaluations) == ("diverged", 11, 11)
    assert run.times.tolist() == list(range(11))
    np.testing.assert_allclose(run.states[:, 0], expected)


def test_more_frames_than_a_program_runs_in_one_go():
    """300 frames of a step are 100 of three, which one call of the program computes.

    Two-step methods carry their last positions over the frames where a run is looked at.
    """
    many, few = (
        Problem.second_order(lambda t, x, v, args: -x, [1.0], [0.5], np.arange(n + 1.0) * 30 / n)
        for n in (300, 100)
    )
    exact = np.cos(many.ts) + 0.5 * np.sin(many.ts)
    # The phase of Störmer's method is off by dt^2/24 a unit of time.
    for stepper, late in {"rk4": 1e-4, "stormer-verlet": 1.2 * 30 * 0.1**2 / 24}.items():
        short, long = simulate(many, stepper, 1).states, simulate(few, stepper, 3).states
        np.testing.assert_allclose(short[::3], long, rtol=0, atol=1e-12)
        np.testing.assert_allclose(short[:, 0, 0], exact, rtol=0, atol=late)


def test_unequal_frames():
    """Of a state that is a number."""
    problem = Problem(lambda t, y, args: -y, 1.0, [0.0, 0.1, 1.0, 1.05])
    run = simulate(problem, "explicit-euler", 10)
    factors = (1 - np.diff(problem.ts) / 10) ** 10
    np.testing.assert_allclose(run.states[1:], np.cumprod(factors), rtol=1e-14)
    assert run.dt == pytest.approx(0.09)


NO_STEPS, NO_LIMITS = (0, -3, 2.5, "many", np.nan, np.inf, None, True), (0.0, np.nan, "soon", None)


@pytest.mark.parametrize(
    ("steps", "limit", "words"),
    [
        *((steps, 1.0, "steps_per_frame: .* allowed: a whole number >= 1") for steps in NO_STEPS),
        *((4, limit, "time_limit: .* given") for limit in NO_LIMITS),
        (10**8, 1e-3, "at most 0.001 s"),
        (10**30, np.inf, "steps_per_frame: .* float64 counts"),
    ],
)
def test_bad_steps_and_limits(steps, limit, words, small_rope):
    with pytest.raises(InputError, match=words):
        simulate(small_rope, "rk4", steps, time_limit=limit)


@pytest.mark.parametrize(("stepper", "ensemble"), [("rk4", True), (in_loops, False)])
def test_a_run_without_an_end_is_refused(stepper, ensemble, small_rope):
    ropes = Ensemble.of([small_rope] * 2) if ensemble else small_rope
    with pytest.raises(InputError, match="steps_per_frame: 1000000000000 given") as refused:
        simulate(ropes, stepper, 10**12)
    (fits,) = re.findall(r"(\d+) steps per frame an hour", str(refused.value))
    # Between a hundred nanoseconds and a hundredth of a second for a step.
    assert 3600 / small_rope.frames / 1e-2 < int(fits) < 3600 / small_rope.frames / 1e-8


def test_a_pause_refuses_no_run(small_rope):
    """The first step may compile, and the machine may sleep: that is not what a step takes."""
    pauses = []

    def pausing(acceleration, t, x, v, dt, args):
        time.sleep(pauses.pop() if pauses else 0.0)
        return in_loops(acceleration, t, x, v, dt, args)

    # So that the step has been tried before it pauses.
    method = method_of(pausing, small_rope)
    pauses += [0.1, 0.1]
    # With a pause in each step it would take half a minute.
    assert simulate(small_rope, method, 100, time_limit=10.0).status == "ok"
    assert not pauses
    pauses += 20 * [0.1]
    with pytest.raises(InputError, match="steps_per_frame: 100 given; .* at most 10 s"):
        simulate(small_rope, method, 100, time_limit=10.0)


@pytest.mark.parametrize("solve", [reference, lambda problem: simulate(problem, "rk4", 1)])
def test_states_that_do_not_fit_into_memory_are_refused(solve, monkeypatch):
    long = Rope(num_nodes=4).problem(frames=10_000)
    monkeypatch.setattr("os.sysconf", lambda name: 256)
    with pytest.raises(InputError, match="frames: 10000 given; allowed: as many as fit"):
        solve(long)


def test_jax_without_its_compiler_is_refused_by_name(small_rope):
    with jax.disable_jit(), pytest.raises(InputError, match="JAX_DISABLE_JIT"):
        simulate(small_rope, "rk4", 8)


# --- right-hand sides


# As a function of NumPy, or of `jax.numpy`, which has the same.
CASES = {
    "small": (lambda xp, y: xp.sin(y), 100),
    "large": (lambda xp, y: xp.sin(y), 2**17 + 1),
    "long sum": (lambda xp, y: y / xp.sum(y), 3000),
    "product": (lambda xp, y: y @ xp.full((100, 100), 0.01), 100),
    "sort": (lambda xp, y: xp.sort(-y), 100),
    "transform": (lambda xp, y: xp.fft.ifft(1j * xp.fft.fft(y)).imag, 100),
    "factors": (lambda xp, y: xp.diag(xp.linalg.cholesky(xp.diag(y))), 100),
}


@pytest.mark.parametrize(("function", "size"), CASES.values(), ids=CASES)
def test_whatever_it_calls(function, size):
    start = np.linspace(1, 2, size)
    run = simulate(Problem(lambda t, y, args: function(jnp, y), start, [0.0, 1.0, 2.0]), "rk4", 2)
    expected = start
    for _ in range(4):
        expected = rk4(lambda t, y, args: function(np, y), 0.0, expected, 0.5, None)
    np.testing.assert_allclose(run.states[-1], expected, rtol=1e-13)


def test_arguments_that_nothing_reads():
    """XLA ends the process where a function has a parameter that nothing reads."""
    unread = {"a": np.ones((2, 2)), "b": np.int64(4), "c": True}
    problem = Problem(lambda t, y, args: y, np.ones(3), [0.0, 1.0], unread)
    run = simulate(problem, "explicit-euler", 2)
    np.testing.assert_array_equal(run.states[-1], np.full(3, 2.25))


def test_a_state_that_stands_still():
    problem = Problem(lambda t, y, args: jnp.zeros(3), [1.0, 2.0, 3.0], [0.0, 1.0, 2.0])
    for stepper in ("explicit-euler", "rk4"):
        np.testing.assert_array_equal(simulate(problem, stepper, 3).states, [[1.0, 2.0, 3.0]] * 3)
