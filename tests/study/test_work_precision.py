"""What error methods have for what cost: against exact solutions, and counts of NumPy's own."""

from __future__ import annotations

import dataclasses
import math
import time

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import optimize

from ropeode import Problem, work_precision
from ropeode.errors import InputError
from ropeode.problems import PROBLEMS
from ropeode.study import INFINITE, as_method
from tests.exact_reference import exact_reference
from tests.results import check_result

STEPS, RTOL = (5, 16, 80), (1e-3, 1e-5, 1e-8)
FRAMES = 4


def exactly(problem):
    return exact_reference(problem, problem.exact(problem.ts))


@pytest.fixture(scope="module")
def swing():
    """Damped, of mass 2, with a velocity at the start."""
    problem = PROBLEMS["oscillator"](
        mass=2.0, stiffness=3.0, damping=0.2, x0=0.7, v0=-0.4, frames=FRAMES
    )
    return exactly(problem)


def exact_rows(states, truth):
    """Final, largest and rms error of the position, and the largest of the energy."""
    problem = truth.problem
    errors = np.abs(states - truth.states)[1:, 0, 0, 0]

    def energy(y):
        return y[:, 1, 0, 0] ** 2 + 1.5 * y[:, 0, 0, 0] ** 2

    of_energy = np.max(np.abs(energy(states) - energy(problem.exact(problem.ts))))
    return errors[-1], errors.max(), math.sqrt(np.mean(errors**2)), of_energy


def rk4_by_hand(truth, steps):
    """States at the samples, and how often the force was evaluated."""
    calls = 0

    def rhs(y):
        nonlocal calls
        calls += 1
        return np.array([y[1], -(3.0 * y[0] + 0.2 * y[1]) / 2.0])

    y, states, dt = np.array([0.7, -0.4]), [], 1.0 / steps
    states.append(y)
    for _ in range(FRAMES):
        for _ in range(steps):
            a = rhs(y)
            b = rhs(y + dt / 2 * a)
            c = rhs(y + dt / 2 * b)
            d = rhs(y + dt * c)
            y = y + dt / 6 * (a + 2 * b + 2 * c + d)
        states.append(y)
    return np.array(states)[..., None, None], calls


@pytest.fixture(scope="module")
def study(swing):
    methods = ["rk4", "scipy:DOP853", "diffrax:Tsit5"]
    return work_precision(swing, methods, steps_per_frame=STEPS[::-1], rtol=RTOL, rounds=2)


def rows_of(study, method):
    return [row for row in study.rows if row.method == method]


def test_errors_and_counts_are_those_of_a_loop_in_numpy(study, swing):
    for row, steps in zip(rows_of(study, "rk4"), STEPS, strict=True):
        states, calls = rk4_by_hand(swing, steps)
        final, largest, rms, energy = exact_rows(states, swing)
        assert (row.effort, row.dt, row.rtol) == (steps, 1 / steps, None)
        assert (row.rhs_evaluations, row.steps) == (calls, FRAMES * steps)
        assert row.error_final == pytest.approx(final, rel=1e-3)
        assert row.error_max == pytest.approx(largest, rel=1e-3)
        assert row.error_rms == pytest.approx(rms, rel=1e-3)
        assert row.energy_error == pytest.approx(energy, rel=1e-3)
        assert row.error_over_tolerance is None
        assert row.status == "ok"
        assert row.resolved


def test_adaptive_methods_have_a_tolerance_and_it_is_not_their_error(study, swing):
    for method in ("scipy:DOP853", "diffrax:Tsit5"):
        rows = rows_of(study, method)
        assert [(row.effort, row.dt, row.rtol) for row in rows] == [(r, None, r) for r in RTOL]
        # At the loosest ones the samples cut the steps.
        assert rows[-1].error_max < 0.1 * rows[0].error_max
        for row in rows:
            over = row.error_max / (row.rtol * swing.problem.scale)
            assert row.error_over_tolerance == pytest.approx(over)
            assert row.rhs_evaluations > row.steps


def test_it_is_a_result_with_the_median_seconds_of_two_rounds(study):
    check_result(study)
    for row in study.rows:
        assert 0 < row.seconds_min <= row.seconds <= row.seconds_max
        assert row.seconds == pytest.approx((row.seconds_min + row.seconds_max) / 2)


@pytest.fixture
def counted():
    """A pendulum in NumPy that counts its calls; JAX cannot trace `math`."""
    calls = [0]

    def pendulum(t, y):
        calls[0] += 1
        return np.array([y[1], -math.sin(y[0]) - 0.1 * y[1] + 0.3 * math.cos(2 * t)])

    problem = Problem.from_scipy(pendulum, (0.0, 4.0), [1.0, 0.2], frames=5)
    assert problem.in_python
    return problem, calls


@pytest.mark.parametrize(
    ("name", "jump_times"),
    [
        ("scipy:DOP853", ()),
        ("scipy:LSODA", ()),
        # The last stage of some is the next step's first; where the right-hand side jumps, a solver
        # starts anew.
        ("scipy:RK45", (0.7, 2.1)),
        ("diffrax:Tsit5", (0.7, 2.1)),
        ("diffrax:Ralston", ()),
        ("diffrax:Bosh3:constant", ()),
    ],
)
def test_evaluations_are_those_that_a_right_hand_side_counts(name, jump_times, counted):
    problem, calls = counted
    run = as_method(name).ready(problem.changed(jump_times=jump_times))
    constant = name.endswith("constant")
    before = calls[0]
    found = run(28 if constant else 1e-4, np.inf)
    assert found.status == "ok"
    assert not found.jacobian_evaluations
    # A run of constant steps repeats some calls, to see that the function keeps no memory: fewer
    # than the 140 steps have stages.
    repeated = 64 if constant else 0
    assert 0 <= calls[0] - before - found.rhs_evaluations <= repeated


@pytest.mark.slow
def test_implicit_solvers_evaluate_jacobians(swing):
    methods = ["diffrax:Kvaerno3", "scipy:Radau"]
    found = work_precision(swing, methods, rtol=[1e-3, 1e-6], rounds=1)
    assert {row.family for row in found.rows} == {"adaptive implicit"}
    for row in found.rows:
        assert row.status == "ok"
        assert 0 < row.jacobian_evaluations <= row.rhs_evaluations


def cubic(t, y, args):
    return -100 * y**3


@pytest.fixture(scope="module")
def decay():
    """y' = -100 y^3; its exact solution is y0/sqrt(1 + 200 y0^2 t)."""
    problem = Problem(cubic, [1.0], np.arange(4.0), name="decay")
    states = 1.0 / np.sqrt(1.0 + 200.0 * problem.ts[:, None])
    return exact_reference(problem, states)


def of_errors(decay, name, errors_and_calls):
    """A method with these errors and evaluations, one for each tolerance."""
    at = iter(errors_and_calls)
    known = {}

    def solve(problem, rtol):
        error, calls = known[rtol] if rtol in known else known.setdefault(rtol, next(at))
        return decay.states + error * (problem.ts > 0.0)[:, None], calls

    solve.__name__ = name
    return solve


def never(problem, rtol):
    raise AssertionError("not to be run")


def fails_once(problem, rtol):
    if rtol == 1e-5:
        raise RuntimeError("no such file")
    exact = 1.0 / np.sqrt(1.0 + 200.0 * problem.ts[:, None])
    # At the start there is no error.
    return exact * (1.0 + rtol * (problem.ts > 0.0)[:, None]), round(1 / rtol)


def test_a_method_that_fails_at_one_effort_is_kept_at_the_others(decay):
    found = work_precision(decay, [fails_once], rtol=[1e-3, 1e-5, 1e-7], rounds=1)
    first, second, third = found.rows
    assert [row.status for row in found.rows] == ["ok", "failed", "ok"]
    assert "RuntimeError: no such file" in second.why
    assert second.error_max is None
    assert second.seconds is None
    assert not second.resolved
    # The error is rtol times the solution, which is largest at the first sample after the start.
    assert first.error_max == pytest.approx(1e-3 / math.sqrt(201), rel=1e-6)
    assert third.rhs_evaluations == 10**7
    assert first.family == "your own"
    assert first.steps is None
    # Nothing is interpolated over the effort that failed.
    (reached,) = found.costs_to_reach(1e-6, "rhs_evaluations")
    assert (reached.cost, reached.at_most) == (1e7, True)


@pytest.mark.parametrize(
    ("returned", "words"),
    [
        (lambda p: p.y0, "(states, rhs_evaluations)"),
        (lambda p: (p.y0, 3), "returned states of shape (1,)"),
        (lambda p: (np.zeros((4, 1)), -3), "-3 evaluations (-3 is below 1)"),
        (lambda p: (np.zeros((4, 1)) + 1j, 3), "returned states of type complex128"),
        (lambda p: (np.ma.masked_less(np.zeros((4, 1)), 1), 3), "states that are masked"),
        (lambda p: ([[1.0], [1.0, 2.0]], 3), "states of different lengths"),
        (lambda p: [p.y0, 3], "it returned [array"),
    ],
)
def test_a_solve_that_returns_something_else_failed(returned, words, decay):
    def mine(problem, rtol):
        return returned(problem)

    (row,) = work_precision(decay, mine, rtol=[1e-3], rounds=1).rows
    assert row.status == "failed"
    assert words in row.why
    assert "\n" not in row.why


def test_runs_that_blow_up_stay_as_rows(decay):
    def lost(problem, rtol):
        states = decay.states.copy()
        states[2:] = np.nan
        return states, None

    found = work_precision(decay, ["explicit-euler", lost], steps_per_frame=[3], rtol=[0.1])
    euler, own = found.rows
    assert euler.status == own.status == "diverged"
    assert "frame 2" in own.why
    assert own.error_max is None
    assert own.rhs_evaluations is None
    assert euler.seconds is not None
    assert found.front("seconds") == ()


def test_errors_larger_than_twice_the_motion_are_unstable(decay):
    off = of_errors(decay, "off", [(1.0, 10)])
    far = of_errors(decay, "far", [(2.5, 9)])
    found = work_precision(decay, [off, far], rtol=[0.1], rounds=1)
    assert [row.status for row in found.rows] == ["ok", "unstable"]
    assert found.rows[1].error_max == pytest.approx(2.5)
    # It is certified to be useless.
    assert found.front("rhs_evaluations") == found.rows[:1]
    assert found.costs_to_reach(3.0, "rhs_evaluations")[1].cost is None


def test_errors_below_the_resolution_are_no_numbers(decay):
    close = of_errors(decay, "close", [(0.5e-13, 10)])
    found = work_precision(decay, close, rtol=[1e-3], rounds=1)
    (row,) = found.rows
    assert found.resolution == pytest.approx(1e-13)
    assert (row.status, row.resolved) == ("ok", False)
    assert row.error_max is row.error_final is row.error_rms is row.error_over_tolerance is None
    assert found.front("rhs_evaluations") == ()
    # It is known to be below the resolution, and no more.
    (coarse,) = found.costs_to_reach(1e-2, "rhs_evaluations")
    assert (coarse.cost, coarse.at_most) == (10.0, True)
    assert found.costs_to_reach(0.99e-13, "rhs_evaluations")[0].cost is None


def test_an_unresolved_run_beats_certified_ones_that_cost_more(decay):
    """Its error is smaller than all that are certified, though nobody knows how small."""

    def certain(error):
        reached = found.costs_to_reach(error, "rhs_evaluations")
        return {each.method: each for each in reached}

    good = of_errors(decay, "good", [(1e-3, 10), (0.5e-13, 100), (0.5e-13, 1000)])
    poor = of_errors(decay, "poor", [(1e-2, 5), (1e-8, 99), (1e-11, 5000)])
    found = work_precision(decay, [good, poor], rtol=[1e-2, 1e-3, 1e-4], rounds=1)
    front = [(row.method, row.rhs_evaluations) for row in found.front("rhs_evaluations")]
    assert front == [("poor", 5), ("good", 10), ("poor", 99)]
    by_name = certain(1e-10)
    assert (by_name["good"].cost, by_name["good"].at_most) == (100.0, True)
    assert (by_name["good"].ratio, by_name["good"].best_of_family) == (1.0, True)
    # Two thirds of the way from 99 to 5000.
    assert by_name["poor"].ratio == pytest.approx(0.99 * (5000 / 99) ** (2 / 3), rel=1e-3)
    assert not by_name["poor"].best_of_family
    # Nothing is interpolated towards a run without an error.
    good = certain(1e-5)["good"]
    assert (good.cost, good.at_most) == (100.0, True)


def test_costs_and_measures_that_do_not_exist(study):
    for asked in (study.front, lambda *named: study.costs_to_reach(1e-3, *named)):
        for axes, faults in ((("time",), 1), (("steps", "error"), 1), (("x", "y"), 2)):
            with pytest.raises(InputError) as caught:
                asked(*axes)
            assert len(caught.value.problems) == faults


def test_no_energy_is_no_unresolved_error(decay):
    found = work_precision(decay, "rk4", steps_per_frame=[700], rounds=1)
    assert found.rows[0].energy_error is None
    with pytest.raises(InputError, match="'decay' has no energy"):
        found.front("steps", "energy_error")


def test_an_energy_that_is_not_finite_is_no_small_error():
    """A logarithm of what must stay above zero, and does not in a coarse run."""

    def rhs(t, y, args):
        return -y

    def energy(t, y, args):
        return jnp.log(y[0]) + t

    problem = Problem(rhs, [1.0], np.arange(3.0), energy=energy)
    truth = exact_reference(problem, np.exp(-problem.ts)[:, None])

    def below_zero(problem, rtol):
        return truth.states - 0.14 * (problem.ts > 1.0)[:, None], 5

    (row,) = work_precision(truth, below_zero, rtol=[1e-3], rounds=1).rows
    assert row.status == "ok"
    assert row.error_max == pytest.approx(0.14)
    assert row.energy_error == INFINITE


def test_a_run_that_fails_when_it_is_timed_is_kept_as_failed(decay):
    calls = []

    def later(problem, rtol):
        calls.append(rtol)
        if calls.count(rtol) == 3 and rtol == 1e-4:
            raise OSError("out of\nfiles")
        states = decay.states + rtol * (problem.ts > 0.0)[:, None]
        return (states * np.nan if calls.count(rtol) == 2 and rtol == 1e-5 else states), 10

    found = work_precision(decay, [later, "rk4"], rtol=[1e-3, 1e-4, 1e-5], steps_per_frame=[700])
    first, second, third, rk4 = found.rows
    assert [row.status for row in found.rows] == ["ok", "failed", "diverged", "ok"]
    assert "when it ran again, later: it raised OSError: out of files" in second.why
    assert "when it ran again, its state is not finite at frame 0" in third.why
    for row in (second, third):
        assert row.error_max is row.energy_error is None
        assert not row.resolved
    assert second.seconds is None
    assert first.seconds is not None
    assert rk4.seconds is not None


def test_a_step_that_cannot_be_so_long_is_kept_at_the_others(decay):
    def picky(rhs, t, y, dt, args):
        if float(dt) > 1.0 / 64.0:
            raise ArithmeticError("dt is too large")
        return y + dt * np.asarray(rhs(t, y, args))

    found = work_precision(decay, [picky], steps_per_frame=[128, 4, 700], rounds=1)
    assert [row.status for row in found.rows] == ["failed", "ok", "ok"]
    assert "dt is too large" in found.rows[0].why
    # The run that shows how long a step takes is one that fails.
    (row,) = work_precision(decay, [picky], steps_per_frame=[128], rounds=1).rows
    assert row.status == "ok"


def test_a_right_hand_side_that_raises_fails_single_runs():
    """Outside of its domain, which coarse runs leave."""

    def root(t, y):
        return np.array([-math.sqrt(y[0])])

    problem = Problem.from_scipy(root, (0.0, 1.9), [1.0], frames=5)
    truth = exact_reference(problem, ((1.0 - problem.ts / 2.0) ** 2)[:, None])
    methods = ["rk4", "diffrax:Tsit5", "scipy:RK45"]
    found = work_precision(truth, methods, steps_per_frame=[1, 16], rtol=[0.1, 1e-8], rounds=1)
    assert [row.status for row in found.rows] == ["failed", "ok"] * 3
    assert all("math domain error" in row.why for row in found.rows if row.why)


def test_a_jacobian_that_is_not_finite_fails_one_method():
    """SciPy raises where it is inverted."""

    def rhs(t, y, args):
        return jnp.sqrt(y) + 1.0

    problem = Problem(rhs, [0.0], np.arange(3.0), name="tank")
    # In u = sqrt(y): t = 2 u - 2 log(1 + u).
    u = [optimize.brentq(lambda u, t=t: 2 * u - 2 * math.log1p(u) - t, 0, 9) for t in problem.ts]
    truth = exact_reference(problem, np.square(u)[:, None])
    found = work_precision(truth, ["scipy:Radau", "scipy:RK45"], rtol=[1e-6], rounds=1)
    radau, rk45 = found.rows
    assert (radau.status, rk45.status) == ("failed", "ok")
    assert "array must not contain infs or NaNs" in radau.why


def test_runs_above_the_limit_are_marked_and_not_waited_for(decay):
    """A function may call a program of its own, whose time is not this process's."""

    def slow(problem, rtol):
        time.sleep(0.1)
        if rtol < 1e-6:
            never(problem, rtol)
        return decay.states + rtol * (problem.ts > 0.0)[:, None], 10

    found = work_precision(decay, slow, rtol=[1e-3, 1e-7, 1e-8], rounds=1, run_limit=0.07)
    assert [row.status for row in found.rows] == ["ok", "time limit", "time limit"]
    assert found.rows[0].seconds_min > 0.09
    assert "would take about" in found.rows[1].why
    assert found.rows[1].seconds is None


def test_what_would_take_for_ever_is_not_run_and_adaptive_solvers_stop(swing):
    steps = [10**5, 10**13]
    found = work_precision(swing, "explicit-euler", steps_per_frame=steps, rounds=1)
    assert [row.status for row in found.rows] == ["ok", "time limit"]
    (row,) = work_precision(swing, "scipy:RK45", rtol=[1e-9], run_limit=1e-9, rounds=1).rows
    assert row.status == "time limit"
    assert "its time was up" in row.why


def test_only_what_is_inside_the_trust_horizon_is_solved():
    """Cost and error are of one span."""
    problem = PROBLEMS["oscillator"](frames=6)
    truth = exactly(problem)
    certificate = dataclasses.replace(truth.certificate, trusted=4, horizon=4.0)
    cut = dataclasses.replace(truth, certificate=certificate)
    found = work_precision(cut, ["rk4"], steps_per_frame=[7], rounds=1)
    assert found.problem.frames == 3
    assert found.rows[0].steps == 21


def test_defaults_are_those_that_can_run(decay):
    """The others need a second-order problem."""
    found = work_precision(decay, steps_per_frame=[4], rtol=[0.1], rounds=1)
    assert {"rk4", "scipy:DOP853"} <= set(found.methods)
    assert not {"semi-implicit-euler", "velocity-verlet"} & set(found.methods)


def test_what_names_mean(tmp_path):
    import diffrax
    import scipy.integrate

    names = "def solve(problem, rtol): return problem.y0, 1\n"
    names += "def step(rhs, t, y, dt, args): return y + dt * rhs(t, y, args)\n"
    (tmp_path / "mine.py").write_text(names)
    meant = {
        "diffrax:Kvaerno5": (True, "adaptive implicit"),
        "diffrax:Tsit5:constant": (False, "diffrax"),
        # It has no estimate of its error.
        "diffrax:Euler": (False, "diffrax"),
        "scipy:RK45": (True, "adaptive explicit"),
        "scipy:RK45:constant": (False, "SciPy"),
        "mine.py:solve": (True, "your own"),
        "mine.py:step": (False, "your own"),
    }
    for name, (adaptive, family) in meant.items():
        method = as_method(name, tmp_path)
        assert (method.label, method.adaptive, method.family) == (name, adaptive, family)
    assert as_method(diffrax.Tsit5) == as_method("diffrax:Tsit5")
    assert as_method(scipy.integrate.RK45) == as_method("scipy:RK45")
    # An object has options of its own, which a name does not say.
    assert not as_method(diffrax.Tsit5()).adaptive
