"""Each check passes what is right and fails what it is there for."""

from __future__ import annotations

import functools
import itertools
from pathlib import Path

import numpy as np
import pytest

from ropeode.checking import CHECKS, SLOW
from ropeode.checking.energy_drift import measure_drift
from ropeode.errors import InputError
from ropeode.problems import Problem
from ropeode.render import format_check
from tests.checking import steps
from tests.checking.mutants.all import MUTANTS
from tests.checking.no_time_limit import check_stepper
from tests.checking.right_loops import Undeclared

PAGE = Path(__file__).parents[2] / "docs/reference/check.md"
NOT_KEPT = {"conserves_energy": False, "reversible": False}


@pytest.mark.parametrize(
    ("step", "order", "claims"),
    [
        (steps.velocity_verlet, 2, {"quick": True}),
        pytest.param(steps.velocity_verlet, 2, {}, marks=pytest.mark.slow),
        pytest.param(steps.own_forces, 1, {"quick": True}, marks=pytest.mark.slow),
        pytest.param(steps.in_loops, 1, {"symplectic": True}, marks=pytest.mark.slow),
        pytest.param(steps.rk4, 4, {"symplectic": False}, marks=pytest.mark.slow),
        pytest.param(steps.euler, 1, NOT_KEPT, marks=pytest.mark.slow),
    ],
)
def test_right_steppers_pass_every_check(step, order, claims):
    report = check_stepper(step, order, **claims)
    assert report.passed, report.failed
    made = {finding.check for finding in report.findings}
    assert made == set(CHECKS) - set(SLOW if "quick" in claims else ())
    if step is steps.velocity_verlet and not claims:
        # The documentation counts them as the report does.
        can_fail, count = sum(each.status == "pass" for each in report.findings), len(CHECKS)
        assert f"Right: {can_fail} of {count} checks passed" in format_check(report)
        page = PAGE.read_text()
        for words in ("of {} checks fail", "There are {},", "{1} of them can fail"):
            assert words.format(count, can_fail) in page


def test_every_check_is_described():
    text = PAGE.read_text()
    for name in CHECKS:
        assert f"`{name}`" in text, name
        assert (f"`{name}`*" in text) == (name in SLOW), name


# Wrong steppers, and checks that they fail: names of mutants, whose originals say what is claimed
# of them, or steps with claims of their own.
WRONG = [
    ("own_verlet: written over its input", ["purity"]),
    ("StormerVerlet: samples one step behind", ["first-sample", "order-textbook", "order-damped"]),
    ("own_euler: mass of the first node", ["order-unequal", "momentum", "node-order"]),
    ("velocity_verlet: Euler for t > 1", ["order-driven", "order-uneven", "time-shift"]),
    ("rk4: growth of 1e-9", ["order-free", "free-flight", "pins", "translation", "boost"]),
    ("own_euler: length in the plane", ["rotation"]),
    ((steps.handed, {}), ["mirror"]),
    ("own_euler: integer rest length", ["units"]),
    ("velocity_verlet: put to rest below 0.001", ["thresholds"]),
    ("own_verlet: springs cut beyond 5 rest lengths", ["thresholds"]),
    ((steps.euler, {"method": "semi-implicit-euler"}), ["stability"]),
    ((steps.rk4, {"conserves_energy": True, "symplectic": True}), ["energy", "symplectic"]),
    ((steps.in_loops, {"reversible": True}), ["reversible"]),
    ((steps.single, {}), ["float32"]),
    ("own_euler: division by a length of zero", ["zero-length"]),
]
RARELY_WRONG = [
    ("own_verlet: no more than four springs", ["thresholds"]),
    ("heun: first slope only", ["order-textbook"]),
    ("leapfrog: no damping", ["order-damped"]),
    ("velocity_verlet: old time", ["order-driven"]),
    ("velocity_verlet: speed limit of 100", ["boost"]),
    # Another formula is no part of a step.
    ("rk4: Euler for dt from 3e-4 to 6e-4", ["thresholds"]),
    ("velocity_verlet: Euler where it is slow and dt > 5", ["thresholds"]),
]

# Thresholds that a finding names.
NAMED = {
    "velocity_verlet: put to rest below 0.001": "of a node's velocity is below 0.001",
    "own_verlet: springs cut beyond 5 rest lengths": "over its rest length is above 5",
    "rk4: Euler for dt from 3e-4 to 6e-4": "where dt is below 0.0006",
}


def test_every_check_that_judges_has_a_stepper_that_fails_it():
    # One says what is predicted and measured; one has the steps below, with hidden state.
    failed = {check for _, checks in WRONG for check in checks}
    assert failed == {*CHECKS} - {"error-constant", "determinism"}


@pytest.mark.parametrize(
    ("wrong", "checks"),
    [*WRONG, *(pytest.param(*it, marks=pytest.mark.slow) for it in RARELY_WRONG)],
)
def test_each_check_fails_wrong_steppers(wrong, checks):
    words = NAMED.get(wrong, "") if isinstance(wrong, str) else ""
    if isinstance(wrong, str):
        wrong = MUTANTS[wrong].make(), MUTANTS[wrong].claims
    report = check_stepper(wrong[0], **wrong[1], only=checks, diagnose=False)
    assert {*checks} == {finding.check for finding in report.failed}
    assert words in report.failed[0].line


def now_and_then(calls):
    """A step that errs once in so many calls."""
    made = itertools.count(1)

    def step(rhs, t, y, dt, args):
        factor = 1.01 if next(made) % calls == 0 else 1.0
        return y + factor * dt * np.asarray(rhs(t, y, args))

    return step


def unseen(rhs, t, y, dt, args):
    """A step that errs once in 700 calls, which it counts in a variable that it does not name."""
    own = globals()
    own["MADE"] = own.get("MADE", 0) + 1
    return y + (1.01 if own["MADE"] % 700 == 0 else 1.0) * dt * np.asarray(rhs(t, y, args))


@pytest.mark.parametrize(
    "make",
    [
        MUTANTS["velocity_verlet: two-step method in a closure"].make,
        MUTANTS["velocity_verlet: every hundredth step left out"].make,
        MUTANTS["velocity_verlet: noise of 1e-9, the same each time"].make,
        functools.partial(now_and_then, 701),
        lambda: unseen,
        pytest.param(functools.partial(now_and_then, 9000), marks=pytest.mark.slow),
    ],
)
def test_a_step_with_hidden_state_is_checked_no_further(make):
    report = check_stepper(make(), only=["determinism", "pins"], diagnose=False)
    assert [finding.status for finding in report.findings] == ["fail", "skip"]


def test_the_error_of_runs_is_the_predicted_one():
    (finding,) = check_stepper("semi-implicit-euler", only=["error-constant"]).findings
    assert finding.status == "note"
    for quantity in ("position", "velocity"):
        assert finding.evidence[quantity]["ratio"] == pytest.approx(1.0, abs=0.02)


@pytest.mark.slow
def test_another_formula_for_one_number_of_nodes_is_found():
    def step(rhs, t, y, dt, args):
        return (steps.euler if y.shape[1] == 257 else steps.rk4)(rhs, t, y, dt, args)

    (finding,) = check_stepper(step, 4, only=["thresholds"]).failed
    assert "of 257 nodes" in finding.line


@pytest.mark.parametrize(
    ("digits", "which"), [(10, 0), pytest.param(12, 1, marks=pytest.mark.slow), (13, 2)]
)
def test_states_of_few_digits_are_found(digits, which):
    def step(acceleration, t, x, v, dt, args):
        x, v = steps.velocity_verlet(acceleration, t, x, v, dt, args)
        return x if which == 0 else np.round(x, digits), v if which == 1 else np.round(v, digits)

    (finding,) = check_stepper(step, 2, only=["float32"], diagnose=False).failed
    assert ("velocities" if which == 0 else "positions") in finding.line


def differences(acceleration, t, x, v, dt, args):
    """Right, of order 1, with the velocity as a difference of positions."""
    new = x + dt * v + dt**2 * acceleration(t, x, v, args)
    return new, (new - x) / dt


@pytest.mark.parametrize(
    "step", [differences, pytest.param("stormer-verlet", marks=pytest.mark.slow)]
)
def test_all_digits_are_not_few(step):
    assert not check_stepper(step, only=["float32"], diagnose=False).failed


@pytest.mark.parametrize(
    ("check", "relative"),
    [("units", False), pytest.param("boost", True, marks=pytest.mark.slow)],
)
def test_a_tolerance_that_is_small_beside_the_error_is_no_fault(check, relative):
    def implicit_midpoint(rhs, t, y, dt, args):
        slope = rhs(t, y, args)
        for _ in range(50):
            slope, last = rhs(t + dt / 2, y + dt / 2 * slope, args), slope
            size = 0.1 * np.linalg.norm(slope) if relative else 1.0
            if np.max(np.abs(slope - last)) < 1e-6 * size:
                break
        return y + dt * slope

    (finding,) = check_stepper(implicit_midpoint, 2, only=[check], diagnose=False).findings
    assert finding.status == "pass"
    assert finding.evidence["difference"] > (1e-8 if relative else 1e-10)


def nan_for_long_steps(acceleration, t, x, v, dt, args):
    x, v = steps.velocity_verlet(acceleration, t, x, v, dt, args)
    return (x, v) if dt < 0.3 else (x + np.nan, v)


def nan_far_away(acceleration, t, x, v, dt, args):
    x, v = steps.velocity_verlet(acceleration, t, x, v, dt, args)
    return np.where(np.abs(x) < 100.0, x, np.nan), v


@pytest.mark.parametrize(
    ("step", "checks"),
    [
        (nan_for_long_steps, ["free-flight", "thresholds"]),
        (nan_far_away, ["translation", "thresholds"]),
    ],
)
def test_a_nan_is_called_by_its_name(step, checks):
    failed = check_stepper(step, only=checks, diagnose=False).failed
    assert [finding.check for finding in failed] == checks
    for finding in failed:
        assert "not finite (nan" in finding.line
        assert "dt = " in finding.line
        assert "by nan" not in finding.line
        assert "by inf" not in finding.line


@pytest.mark.parametrize(
    ("declared", "order", "statuses"),
    [
        pytest.param(True, None, ["pass", "pass"], marks=pytest.mark.slow),
        # Beside an order that is claimed, too; a property that nobody claims would be a note.
        (True, 2, ["fail", "pass"]),
        pytest.param(False, None, ["pass", "fail"], marks=pytest.mark.slow),
        pytest.param(None, None, ["pass", "note"], marks=pytest.mark.slow),
    ],
)
def test_a_class_claims_what_it_says_and_no_more(declared, order, statuses):
    class Declaring(Undeclared):
        symplectic = declared

    report = check_stepper(Declaring, order, only=["order-damped", "symplectic"], diagnose=False)
    assert [finding.status for finding in report.findings] == statuses


@pytest.mark.slow
def test_another_method_than_the_one_that_is_claimed_is_called_by_its_name():
    asked = {"method": "semi-implicit-euler", "only": ["order-driven", "symplectic"]}
    (diagnosis,) = check_stepper(steps.euler, **asked).diagnosis
    assert diagnosis.line.startswith("this is explicit-euler; its order is 1")


def test_an_order_with_damping_may_be_claimed_apart():
    asked = {"only": ["order-damped", "order-driven"], "diagnose": False}
    assert check_stepper("leapfrog:damping=explicit", 2, **asked).verdict == "wrong"
    report = check_stepper("leapfrog:damping=explicit", 2, damped_order=1, **asked)
    assert report.passed
    assert ["expected 1" in each.line for each in report.findings] == [True, False]
    with pytest.raises(InputError, match="damped_order: 1 given; allowed: one beside an order"):
        check_stepper("leapfrog", damped_order=1)


# Where the stability functions leave the unit disc on the imaginary axis: Hairer, Wanner, Solving
# Ordinary Differential Equations II, section IV.2; Hairer, Lubich, Wanner, Geometric Numerical
# Integration, section I.5.
@pytest.mark.parametrize(
    ("name", "limit"),
    [
        ("rk4", 2.0 * 2.0**0.5),
        pytest.param("explicit-euler", 0.0, marks=pytest.mark.slow),
        pytest.param("semi-implicit-euler", 2.0, marks=pytest.mark.slow),
        pytest.param("stormer-verlet", 2.0, marks=pytest.mark.slow),
        pytest.param("velocity-verlet", 2.0, marks=pytest.mark.slow),
    ],
)
def test_limits_of_stability_are_those_of_theory(name, limit):
    (finding,) = check_stepper(name, only=["stability"]).findings
    assert finding.status == "pass"
    for each in ("limit", "theory"):
        assert finding.evidence[each] == pytest.approx(limit, rel=1e-3)


@pytest.mark.parametrize(
    ("energy", "verdict", "words"),
    [
        (lambda s: 0.01 * np.sin(40 * s), "bounded", "stays within"),
        (lambda s: 0.01 * np.sin(40 * s) + 0.1 * s, "drifting", "rises by"),
        (lambda s: -0.05 * s, "drifting", "falls by"),
        (lambda s: -0.9 * (1 - np.exp(-30 * s)), "drifting", "falls by"),
        (lambda s: 1e-3 * np.exp(9 * s), "growing", "grows to"),
        (lambda s: np.where(s < 0.7, 0.0, np.nan), "growing", "diverges at t = 280"),
    ],
)
def test_energies_are_bounded_drifting_or_growing(energy, verdict, words):
    """A mass that moves along a line, whose speed makes its energy what is asked for."""
    ts = np.linspace(0.0, 400.0, 401)
    problem = Problem.second_order(
        lambda t, x, v, args: 0.0 * x,
        *([[0.0]], [[1.0]], ts),
        energy=lambda t, y, args: 0.5 * (y[1, 0, 0] ** 2 + y[0, 0, 0] ** 2),
    )
    size = np.sqrt(2.0 + 2.0 * energy(ts / 400.0))
    states = size[:, None] * np.stack([np.sin(0.9 * ts), np.cos(0.9 * ts)], axis=1)
    drift = measure_drift(problem, states.reshape(-1, 2, 1, 1))
    assert drift.verdict == verdict, drift.line
    assert words in drift.line
