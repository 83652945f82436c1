"""What error methods have for what cost: against exact solutions, counts of calls, brute force."""

from __future__ import annotations

import dataclasses
import itertools
import math
import time

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ropeode import Problem, work_precision
from ropeode.errors import InputError
from ropeode.problems import PROBLEMS
from ropeode.simulation import simulate
from ropeode.study import INFINITE, as_method
from ropeode.study.pareto import cost_to_reach, pareto_front
from tests.exact_reference import exact_reference
from tests.results import check_result

STEPS, RTOL = (5, 16, 80), (1e-3, 1e-5, 1e-8)
FRAMES = 4


@pytest.fixture(scope="module")
def swing():
    """Damped, of mass 2, with a velocity at the start."""
    problem = PROBLEMS["oscillator"](
        mass=2.0, stiffness=3.0, damping=0.2, x0=0.7, v0=-0.4, frames=FRAMES
    )
    return exact_reference(problem, problem.exact(problem.ts))


@pytest.fixture(scope="module")
def study(swing):
    methods = ["rk4", "scipy:DOP853", "diffrax:Tsit5"]
    return work_precision(swing, methods, steps_per_frame=STEPS[::-1], rtol=RTOL, rounds=2)


def rows_of(study, method):
    return [row for row in study.rows if row.method == method]


def energies(y):
    return y[:, 1, 0, 0] ** 2 + 1.5 * y[:, 0, 0, 0] ** 2


def test_errors_are_those_of_runs_against_the_exact_solution(study, swing):
    for row, steps in zip(rows_of(study, "rk4"), STEPS, strict=True):
        states = simulate(swing.problem, "rk4", steps).states
        errors = np.abs(states - swing.states)[1:, 0, 0, 0]
        assert (row.effort, row.dt, row.rtol) == (steps, 1 / steps, None)
        assert (row.rhs_evaluations, row.steps) == (4 * FRAMES * steps, FRAMES * steps)
        assert row.error_final == pytest.approx(errors[-1], rel=1e-3)
        assert row.error_max == pytest.approx(errors.max(), rel=1e-3)
        assert row.error_rms == pytest.approx(math.sqrt(np.mean(errors**2)), rel=1e-3)
        of_energy = np.max(np.abs(energies(states) - energies(swing.states)))
        assert row.energy_error == pytest.approx(of_energy, rel=1e-3)
        assert row.error_over_tolerance is None
        assert (row.status, row.resolved) == ("ok", True)


def test_adaptive_methods_have_a_tolerance_and_it_is_not_their_error(study, swing):
    """And the seconds of each row are the median of two rounds."""
    check_result(study)
    for row in study.rows:
        assert 0 < row.seconds_min <= row.seconds <= row.seconds_max
        assert row.seconds == pytest.approx((row.seconds_min + row.seconds_max) / 2)
    for method in ("scipy:DOP853", "diffrax:Tsit5"):
        rows = rows_of(study, method)
        assert [(row.effort, row.dt, row.rtol) for row in rows] == [(r, None, r) for r in RTOL]
        # At the loosest ones the samples cut the steps.
        assert rows[-1].error_max < 0.1 * rows[0].error_max
        for row in rows:
            over = row.error_max / (row.rtol * swing.problem.scale)
            assert row.error_over_tolerance == pytest.approx(over)
            assert row.rhs_evaluations > row.steps


@pytest.mark.parametrize(
    "name",
    [
        *("scipy:DOP853", "scipy:LSODA", "scipy:RK45"),
        *("diffrax:Tsit5", "diffrax:Ralston", "diffrax:Bosh3:constant"),
    ],
)
def test_evaluations_are_those_that_a_right_hand_side_counts(name):
    """Of a pendulum in NumPy; JAX cannot trace `math`.

    The last stage of some methods is the next step's first; where the right-hand side jumps, an
    adaptive solver starts anew.
    """
    calls = 0

    def pendulum(t, y):
        nonlocal calls
        calls += 1
        return np.array([y[1], -math.sin(y[0]) - 0.1 * y[1] + 0.3 * math.cos(2 * t)])

    problem = Problem.from_scipy(pendulum, (0.0, 4.0), [1.0, 0.2], frames=5)
    assert problem.in_python
    constant = name.endswith("constant")
    jump_times = () if constant else (0.7, 2.1)
    run = as_method(name).ready(problem.changed(jump_times=jump_times))
    before = calls
    found = run(28 if constant else 1e-4, np.inf)
    assert found.status == "ok"
    assert not found.jacobian_evaluations
    # A run of constant steps repeats some calls, to see that the function keeps no memory: fewer
    # than the 140 steps have stages.
    repeated = 64 if constant else 0
    assert 0 <= calls - before - found.rhs_evaluations <= repeated


@pytest.mark.slow
def test_implicit_solvers_evaluate_jacobians(swing):
    methods = ["diffrax:Kvaerno3", "scipy:Radau"]
    found = work_precision(swing, methods, rtol=[1e-3, 1e-6], rounds=1)
    assert {row.family for row in found.rows} == {"adaptive implicit"}
    for row in found.rows:
        assert row.status == "ok"
        assert 0 < row.jacobian_evaluations <= row.rhs_evaluations


TOLERANCES = (1e-2, 1e-3, 1e-4)


def of_errors(decay, name, *errors_and_calls):
    """A method with these errors and evaluations, one for each tolerance."""
    known = dict(zip(TOLERANCES, errors_and_calls, strict=False))

    def solve(problem, rtol):
        error, calls = known[rtol]
        # At the start there is no error.
        return decay.states + error * (problem.ts > 0.0)[:, None], calls

    solve.__name__ = name
    return solve


def lost(states):
    states[2:] = np.nan
    return states, None


# What a solve makes of the right states, by words of why the run is not used.
RETURNED = {
    "(states, rhs_evaluations)": lambda states: states[0],
    "returned states of shape (1,)": lambda states: (states[0], 3),
    "-3 evaluations (-3 is below 1)": lambda states: (states, -3),
    "returned states of type complex128": lambda states: (states + 1j, 3),
    "states that are masked": lambda states: (np.ma.masked_less(states, 0.5), 3),
    "states of different lengths": lambda states: ([[1.0], [1.0, 2.0]], 3),
    "it returned [array": lambda states: [states, 3],
    "frame 2": lost,
}


def test_runs_that_return_something_else_or_blow_up_stay_as_rows(decay):
    def solving(name, returned):
        def solve(problem, rtol):
            return returned(decay.states.copy())

        solve.__name__ = name
        return solve

    methods = [solving(f"own{n}", each) for n, each in enumerate(RETURNED.values())]
    methods.append("explicit-euler")
    found = work_precision(decay, methods, steps_per_frame=[3], rtol=[0.1], rounds=1)
    *own, euler = found.rows
    for row, words in zip(own, RETURNED, strict=True):
        assert row.status == ("diverged" if words == "frame 2" else "failed")
        assert words in row.why
        assert "\n" not in row.why
        assert row.error_max is row.rhs_evaluations is None
    assert euler.status == "diverged"
    assert euler.seconds is not None
    assert found.front("seconds") == ()


def test_errors_beyond_the_motion_and_below_the_resolution_are_marked(decay):
    sizes = {"off": (1.0, 10), "far": (2.5, 9), "close": (0.5e-13, 10)}
    methods = [of_errors(decay, name, each) for name, each in sizes.items()]
    found = work_precision(decay, methods, rtol=TOLERANCES[:1], rounds=1)
    _, far, close = found.rows
    assert [row.status for row in found.rows] == ["ok", "unstable", "ok"]
    assert far.error_max == pytest.approx(2.5)
    assert found.resolution == pytest.approx(1e-13)
    assert not close.resolved
    assert close.error_max is close.error_final is close.error_rms is None
    assert close.error_over_tolerance is None
    # What is unstable is on no front and reaches nothing; the other is below the resolution.
    assert found.front("rhs_evaluations") == ()
    _, far, close = found.costs_to_reach(3.0, "rhs_evaluations")
    assert (far.cost, close.cost, close.at_most) == (None, 10.0, True)
    assert found.costs_to_reach(0.99e-13, "rhs_evaluations")[2].cost is None


def test_an_unresolved_run_beats_certified_ones_that_cost_more(decay):
    """Its error is smaller than all that are certified, though nobody knows how small."""
    good = of_errors(decay, "good", (1e-3, 10), (0.5e-13, 100), (0.5e-13, 1000))
    poor = of_errors(decay, "poor", (1e-2, 5), (1e-8, 99), (1e-11, 5000))
    found = work_precision(decay, [good, poor], rtol=TOLERANCES, rounds=1)
    front = [(row.method, row.rhs_evaluations) for row in found.front("rhs_evaluations")]
    assert front == [("poor", 5), ("good", 10), ("poor", 99)]
    best, worse = found.costs_to_reach(1e-10, "rhs_evaluations")
    assert (best.cost, best.at_most) == (100.0, True)
    assert (best.ratio, best.best_of_family) == (1.0, True)
    # Two thirds of the way from 99 to 5000.
    assert worse.ratio == pytest.approx(0.99 * (5000 / 99) ** (2 / 3), rel=1e-3)
    assert not worse.best_of_family
    # Nothing is interpolated towards a run without an error.
    best, _ = found.costs_to_reach(1e-5, "rhs_evaluations")
    assert (best.cost, best.at_most) == (100.0, True)


def test_costs_and_measures_that_do_not_exist(study, decay):
    for asked in (study.front, lambda *named: study.costs_to_reach(1e-3, *named)):
        for axes in (("time",), ("steps", "error"), ("x", "y")):
            with pytest.raises(InputError, match="which does not exist") as caught:
                asked(*axes)
            assert len(caught.value.problems) == 1 + (axes == ("x", "y"))
    # No energy is no unresolved error.
    found = work_precision(decay, "rk4", steps_per_frame=[700], rounds=1)
    assert found.rows[0].energy_error is None
    with pytest.raises(InputError, match="'decay' has no energy"):
        found.front("steps", "energy_error")


def test_an_energy_that_is_not_finite_is_no_small_error():
    """A logarithm of what must stay above zero, and does not in a coarse run."""

    problem = Problem(
        lambda t, y, args: -y,
        [1.0],
        np.arange(3.0),
        energy=lambda t, y, args: jnp.log(y[0]) + t,
    )
    truth = exact_reference(problem, np.exp(-problem.ts)[:, None])

    def below_zero(problem, rtol):
        return truth.states - 0.14 * (problem.ts > 1.0)[:, None], 5

    (row,) = work_precision(truth, below_zero, rtol=[1e-3], rounds=1).rows
    assert row.status == "ok"
    assert row.error_max == pytest.approx(0.14)
    assert row.energy_error == INFINITE


def test_a_run_that_fails_is_kept_as_failed_beside_the_others(decay):
    """The first time, or when it is timed, or when it shows how long a step takes."""
    calls, bad_at = [], {1e-4: 3, 1e-5: 2, 1e-6: 1}

    def later(problem, rtol):
        calls.append(rtol)
        bad = calls.count(rtol) == bad_at.get(rtol)
        if bad and rtol != 1e-5:
            raise OSError("out of\nfiles")
        states = decay.states + rtol * (problem.ts > 0.0)[:, None]
        return (states * np.nan if bad else states), 10

    def picky(rhs, t, y, dt, args):
        if float(dt) > 1.0 / 64.0:
            raise ArithmeticError("dt is too large")
        return y + dt * np.asarray(rhs(t, y, args))

    rtol = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7]
    found = work_precision(decay, [later, picky], rtol=rtol, steps_per_frame=[128])
    first, *lost, last, own_step = found.rows
    assert [row.status for row in lost] == ["failed", "diverged", "failed"]
    reasons = (
        "when it ran again, later: it raised OSError: out of files",
        "when it ran again, its state is not finite at frame 0",
        "later: it raised OSError: out of files",
    )
    for row, why in zip(lost, reasons, strict=True):
        assert row.why.startswith(why)
        assert row.error_max is row.energy_error is None
        assert not row.resolved
    assert lost[0].seconds is lost[2].seconds is None
    for row in (first, last, own_step):
        assert row.status == "ok"
        assert row.seconds is not None


def test_a_right_hand_side_that_raises_fails_single_runs():
    """Outside of its domain, which coarse runs leave."""

    problem = Problem.from_scipy(
        lambda t, y: np.array([-math.sqrt(y[0])]), (0.0, 1.9), [1.0], frames=5
    )
    truth = exact_reference(problem, ((1.0 - problem.ts / 2.0) ** 2)[:, None])
    methods = ["rk4", "diffrax:Tsit5", "scipy:RK45"]
    found = work_precision(truth, methods, steps_per_frame=[1, 16], rtol=[0.1, 1e-8], rounds=1)
    assert [row.status for row in found.rows] == ["failed", "ok"] * 3
    assert all("math domain error" in row.why for row in found.rows if row.why)


def test_runs_above_the_limit_are_marked_and_not_waited_for(decay, swing):
    """A function may call a program of its own, whose time is not this process's."""

    def slow(problem, rtol):
        time.sleep(0.1)
        assert rtol > 1e-6, "not to be run"
        return decay.states + rtol * (problem.ts > 0.0)[:, None], 10

    found = work_precision(decay, slow, rtol=[1e-3, 1e-7, 1e-8], rounds=1, run_limit=0.07)
    assert [row.status for row in found.rows] == ["ok", "time limit", "time limit"]
    assert found.rows[0].seconds_min > 0.09
    assert "would take about" in found.rows[1].why
    assert found.rows[1].seconds is None
    steps = [10**5, 10**13]
    found = work_precision(swing, "explicit-euler", steps_per_frame=steps, rounds=1)
    assert [row.status for row in found.rows] == ["ok", "time limit"]
    # An adaptive solver stops by itself.
    (row,) = work_precision(swing, "scipy:RK45", rtol=[1e-9], run_limit=1e-9, rounds=1).rows
    assert row.status == "time limit"
    assert "its time was up" in row.why


def test_only_what_is_inside_the_trust_horizon_is_solved(swing):
    """Cost and error are of one span."""
    certificate = dataclasses.replace(swing.certificate, trusted=4, horizon=4.0)
    cut = dataclasses.replace(swing, certificate=certificate)
    found = work_precision(cut, ["rk4"], steps_per_frame=[7], rounds=1)
    assert (found.problem.frames, found.rows[0].steps) == (3, 21)


def test_defaults_are_those_that_can_run(decay):
    """The others need a second-order problem."""
    found = work_precision(decay, steps_per_frame=[4], rtol=[0.1], rounds=1)
    assert {"rk4", "scipy:DOP853"} <= set(found.methods)
    assert not {"semi-implicit-euler", "velocity-verlet"} & set(found.methods)


def test_what_names_mean(tmp_path):
    import diffrax

    names = "def solve(problem, rtol): return problem.y0, 1\n"
    names += "def step(rhs, t, y, dt, args): return y + dt * rhs(t, y, args)\n"
    (tmp_path / "mine.py").write_text(names)
    for name, adaptive, family in (
        ("diffrax:Kvaerno5", True, "adaptive implicit"),
        ("diffrax:Tsit5:constant", False, "diffrax"),
        # It has no estimate of its error.
        ("diffrax:Euler", False, "diffrax"),
        ("scipy:RK45", True, "adaptive explicit"),
        ("mine.py:solve", True, "your own"),
        ("mine.py:step", False, "your own"),
    ):
        method = as_method(name, tmp_path)
        assert (method.label, method.adaptive, method.family) == (name, adaptive, family)
    assert as_method(diffrax.Tsit5) == as_method("diffrax:Tsit5")
    # An object has options of its own, which a name does not say.
    assert not as_method(diffrax.Tsit5()).adaptive


# Few different values, so that many points are equal in one of the two.
NUMBERS = st.sampled_from([0.5, 1.0, 2.0, 3.0, 7.0]) | st.floats(1e-12, 1e6)
POINTS = st.lists(st.tuples(NUMBERS, NUMBERS), max_size=12)


def beats(a, b):
    return a[0] <= b[0] and a[1] <= b[1] and a != b


@given(POINTS)
def test_the_front_is_what_no_point_beats(points):
    front = pareto_front(points)
    unbeaten = {point for point in points if not any(beats(other, point) for other in points)}
    assert {points[i] for i in front} == unbeaten
    assert len(front) == len(unbeaten)
    costs = [points[i][0] for i in front]
    assert costs == sorted(costs)
    assert all(points.index(points[i]) == i for i in front)


@given(st.lists(st.none() | st.tuples(NUMBERS, NUMBERS), max_size=8), NUMBERS)
def test_nothing_is_extrapolated(points, error):
    """The least of all costs that one can read from the picture by brute force."""
    known = [point for point in points if point is not None]
    found = cost_to_reach(error, points)
    if not any(each <= error for _, each in known):
        assert found is None
        return
    candidates = [cost for cost, each in known if each <= error]
    for a, b in itertools.pairwise(points):
        if a is None or b is None or not min(a[1], b[1]) < error < max(a[1], b[1]):
            continue
        slope = math.log(b[0] / a[0]) / math.log(b[1] / a[1])
        candidates.append(a[0] * (error / a[1]) ** slope)
    assert found is not None
    assert found.cost == pytest.approx(min(candidates), rel=1e-9)
    assert min(cost for cost, _ in known) * (1 - 1e-9) <= found.cost
