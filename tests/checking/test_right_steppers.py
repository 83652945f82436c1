"""Right steppers are right, however they are written; what is too thin or rare is said so."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest

from ropeode.checking import Examination, Finding, convergence_problems, generic
from ropeode.checking import check_stepper as with_time_limit
from ropeode.render import format_check
from ropeode.simulation import method_of
from tests.checking import right_loops
from tests.checking.no_time_limit import check_stepper
from tests.checking.random_ropes import findings, ropes
from tests.checking.right_loops import RIGHT_LOOPS


# NumPy and SciPy warn of what loops compute from states as large as the checks hand them.
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.slow
@pytest.mark.parametrize("name", RIGHT_LOOPS)
def test_right_loops_are_right(name):
    step, claims = RIGHT_LOOPS[name]
    report = check_stepper(step, diagnose=False, **claims)
    assert report.verdict == "right", [*report.failed, *report.undetermined]


def test_what_a_sweep_breaks_is_no_fault_unless_a_method_is_claimed_by_name():
    in_turn = right_loops.pairs_in_turn
    for step, check in ((in_turn, "node-order"), (RIGHT_LOOPS["one sweep"][0], "rotation")):
        (finding,) = check_stepper(step, 1, only=[check], diagnose=False).findings
        assert finding.status == "pass"
        assert "less at smaller dt, as where an iteration is cut off" in finding.line
    named = check_stepper(
        in_turn, method="semi-implicit-euler", only=["node-order"], diagnose=False
    )
    assert named.verdict == "wrong"


def test_what_fails_in_a_rare_state_alone_is_otherwise_right():
    def dividing(acceleration, t, x, v, dt, args):
        lengths = [float(np.linalg.norm(d)) for d in np.diff(x, axis=0)]
        assert all(1.0 / length > 0.0 for length in lengths)
        return right_loops.damping_first(acceleration, t, x, v, dt, args)

    report = check_stepper(dividing, 1, only=["pins", "zero-length"], diagnose=False)
    assert (report.verdict, report.exit_code) == ("wrong", 1)
    assert report.otherwise_right
    assert "the step raises ZeroDivisionError" in report.failed[0].line
    assert "edge case, otherwise right: 1 of 2 checks" in " ".join(format_check(report).split())
    another = Finding("pins", "fail", "a pinned node moves")
    report = dataclasses.replace(report, findings=(*report.findings, another))
    assert not report.otherwise_right


def test_a_step_that_hangs_in_a_rare_state_alone_is_undetermined():
    def hanging(acceleration, t, x, v, dt, args):
        while np.any(np.all(np.asarray(x)[1:] == np.asarray(x)[:-1], axis=1)):
            pass
        return right_loops.damping_first(acceleration, t, x, v, dt, args)

    report = with_time_limit(
        hanging, 1, only=["pins", "zero-length"], diagnose=False, time_limit=0.3
    )
    assert (report.verdict, report.exit_code) == ("undetermined", 2)
    assert "Undetermined: the evidence of 1 of 2 checks is too thin" in format_check(report)


def test_a_run_whose_numbers_overflow_has_diverged():
    examination = Examination(right_loops.overflowing)
    problem = generic().changed(ts=1e4 * np.arange(4.0))
    states = examination.run(problem, 100)
    assert np.isfinite(states[0]).all()
    assert np.isnan(states[-1]).all()


@pytest.mark.slow
def test_a_program_that_takes_minutes_to_compile_runs_in_python():
    def unrolled(count, rhs, t, y, dt, args):
        new = y
        for _ in range(count):
            new = y + dt * rhs(t + dt, new, args)
        return new

    for count, compiled in ((1, True), (120, False)):
        method = method_of(functools.partial(unrolled, count), convergence_problems()["driven"])
        assert method.trial.compiled is compiled


@pytest.mark.slow
def test_what_a_right_step_refuses_is_said_and_fails_nothing():
    def said(step, check):
        (finding,) = check_stepper(step, only=[check]).findings
        return finding.status, finding.line

    status, line = said(right_loops.for_three_dimensions, "thresholds")
    assert status == "pass"
    assert "in 2 dimensions it raised ValueError" in line
    status, line = said(right_loops.midpoint_to(1e-13, 200), "thresholds")
    assert status == "note"
    assert "it raised RuntimeError: no convergence" in line


# Of each kind one, with other ropes than benchmarks/false_alarms.py draws by default.
STEPPERS = (
    "velocity_verlet",
    "yoshida4",
    "dormand-prince5",
    "ropeode stormer-verlet:damping=lagged",
)


@pytest.mark.slow
@pytest.mark.parametrize("name", STEPPERS)
def test_right_steppers_are_not_rejected_on_random_ropes(name):
    drawn, _ = ropes(2, 0)
    found = findings(name, drawn)
    assert [f"{check}: {each.line}" for check, each in found.items() if each.status == "fail"] == []
    assert sum(each.status == "pass" for each in found.values()) >= 12
