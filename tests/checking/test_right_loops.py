"""Right steppers as people write them are right, and what is too thin or too rare is said so."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest

from ropeode.checking import Examination, Finding, convergence_problems, generic
from ropeode.checking import check_stepper as with_time_limit
from ropeode.checking.richardson import limit_of
from ropeode.render import format_check
from ropeode.simulation import method_of
from ropeode.steppers import Stepper
from tests.checking import right_loops
from tests.checking.no_time_limit import check_stepper
from tests.checking.right_loops import RIGHT_LOOPS

# Checks of a few steps, which take little time in Python too.
FEW_STEPS = [
    "free-flight", "momentum", "translation", "boost", "rotation", "mirror", "node-order", "units",
    "float32", "zero-length",
]  # fmt: skip


# NumPy and SciPy warn of what loops compute from states as large as the checks hand them.
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.slow
@pytest.mark.parametrize("name", RIGHT_LOOPS)
def test_right_loops_are_right(name):
    step, claims = RIGHT_LOOPS[name]
    report = check_stepper(step, diagnose=False, **claims)
    assert report.verdict == "right", [*report.failed, *report.undetermined]


def test_a_right_loop_keeps_what_a_motion_keeps():
    """It is implicit, and cuts its iteration off."""
    step, claims = RIGHT_LOOPS["one sweep"]
    report = check_stepper(step, diagnose=False, only=FEW_STEPS, **claims)
    assert report.verdict == "right", report.failed


def test_the_order_of_a_sweep_matters_to_a_method_that_is_claimed_by_name():
    report = check_stepper(
        right_loops.pairs_in_turn, method="semi-implicit-euler", only=["node-order"], diagnose=False
    )
    assert report.verdict == "wrong"
    assert check_stepper(right_loops.pairs_in_turn, 1, only=["node-order"]).passed


@pytest.mark.parametrize(
    "symplectic",
    [None, pytest.param(True, marks=pytest.mark.slow), pytest.param(False, marks=pytest.mark.slow)],
)
def test_a_class_claims_what_it_says_and_no_more(symplectic):
    class Claiming(right_loops.Undeclared):
        pass

    if symplectic is not None:
        Claiming.symplectic = symplectic
    (finding,) = check_stepper(Claiming, only=["symplectic"], diagnose=False).findings
    assert finding.status == {None: "note", True: "pass", False: "fail"}[symplectic]
    assert Stepper.symplectic is None


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


def test_the_uncertainty_of_a_limit_is_no_accident():
    """The error's terms are such that at the first sample one run fewer changes nothing."""
    dts = np.array([0.4, 0.2, 0.1])
    # Per unit of the cubic term, the extrapolation of all three is off by 0.008; that of the last
    # two by -0.006, and by -0.02 per unit of the quadratic term.
    quadratic, cubic = np.array([-0.7, 1.0]), np.ones(2)
    runs = [1.0 + 3.0 * dt + quadratic * dt**2 + cubic * dt**3 for dt in dts]
    limit = limit_of(list(dts), [run[:, None, None] for run in runs])
    assert limit is not None
    assert np.allclose(limit.values[:, 0, 0] - 1.0, 0.008)
    assert np.all(limit.uncertainty > 0.008)
