"""Each check passes what is right and fails what it is there for."""

from __future__ import annotations

import itertools
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.checking import CHECKS, SLOW
from ropeode.checking.energy_drift import measure_drift
from ropeode.problems import Problem
from ropeode.render import format_check
from ropeode.steppers import Phase, Stepper
from tests.checking import steps
from tests.checking.mutants.all import MUTANTS
from tests.checking.no_time_limit import check_stepper

PAGE = Path(__file__).parents[2] / "docs/reference/check.md"
NOT_KEPT = {"conserves_energy": False, "reversible": False}


@pytest.mark.parametrize(
    ("step", "order", "claims"),
    [
        (steps.velocity_verlet, 2, {}),
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
    if step is steps.velocity_verlet:
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


class InNumPy(Stepper):
    """A stepper that JAX cannot trace, with properties that it declares."""

    needs = "second order"
    symplectic = True

    def order(self, problem_class):
        return 1

    def step(self, system, t, carried, dt):
        v = np.array(carried.v)
        v += dt * np.array(system.acceleration(t, carried.x, carried.v))
        return Phase(carried.x + dt * v, v)


# For each check steppers that fail it, and what is claimed of them; or the names of mutants, whose
# original claims it.
WRONG = {
    "determinism": [(steps.draws, {"expected_order": 1})],
    "purity": ["own_verlet: written over its input"],
    "first-sample": ["StormerVerlet: samples one step behind"],
    "order-textbook": ["heun: first slope only"],
    "order-damped": ["leapfrog: no damping"],
    "order-unequal": ["leapfrog: mean mass"],
    "order-driven": ["velocity_verlet: old time"],
    "order-uneven": ["velocity_verlet: old time"],
    "order-free": ["rk4: weights 1 2 2 2"],
    "free-flight": ["velocity_verlet: longest step 1/60"],
    "pins": ["semi_implicit_euler: pinned nodes fall"],
    "momentum": ["own_euler: one-ended spring"],
    "translation": ["rk4: growth of 1e-9"],
    "boost": ["velocity_verlet: speed limit of 100"],
    "rotation": ["own_euler: length in the plane"],
    "mirror": [(steps.handed, {})],
    "node-order": ["own_euler: mass of the first node"],
    "time-shift": ["velocity_verlet: Euler for t > 1"],
    "units": ["own_euler: integer rest length"],
    "scales": [
        "velocity_verlet: put to rest below 1e-05",
        # Other formulas are no parts of a step.
        "rk4: Euler for dt < 1e-05",
        "rk4: Euler for dt from 3e-4 to 6e-4",
        "velocity_verlet: Euler where it is slow and dt > 5",
    ],
    "sizes": ["own_verlet: no more than four springs"],
    "far-states": ["own_verlet: springs cut beyond 5 rest lengths"],
    "stability": [(steps.euler, {"method": "semi-implicit-euler"})],
    "energy": [(steps.rk4, {"conserves_energy": True})],
    "symplectic": [(steps.rk4, {"symplectic": True})],
    "reversible": [(steps.in_loops, {"reversible": True})],
    "float32": [(steps.single, {})],
    "zero-length": ["own_euler: division by a length of zero"],
}


def test_every_check_that_judges_has_a_stepper_that_fails_it():
    # The other one says what is predicted and measured.
    assert {*WRONG} == {*CHECKS} - {"error-constant"}


@pytest.mark.parametrize(
    ("check", "wrong"), [(name, each) for name in WRONG for each in WRONG[name]]
)
def test_each_check_fails_wrong_steppers(check, wrong):
    if isinstance(wrong, str):
        wrong = MUTANTS[wrong].make(), MUTANTS[wrong].claims
    report = check_stepper(wrong[0], **wrong[1], only=[check], diagnose=False)
    assert [finding.check for finding in report.failed] == [check]
    assert not report.passed


def test_the_error_of_runs_is_the_predicted_one():
    (finding,) = check_stepper("semi-implicit-euler", only=["error-constant"]).findings
    assert finding.status == "note"
    for quantity in ("position", "velocity"):
        assert finding.evidence[quantity]["ratio"] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("most", [1000, pytest.param(9000, marks=pytest.mark.slow)])
def test_a_step_that_changes_after_many_calls_is_not_deterministic(most):
    calls = itertools.count()

    def step(rhs, t, y, dt, args):
        return (steps.rk4 if next(calls) < most else steps.euler)(rhs, t, y, dt, args)

    report = check_stepper(step, 2, only=["determinism", "units"])
    assert [finding.status for finding in report.findings] == ["fail", "skip"]


@pytest.mark.parametrize("nodes", [3, pytest.param(257, marks=pytest.mark.slow)])
def test_another_formula_for_one_number_of_nodes_is_found(nodes):
    def step(rhs, t, y, dt, args):
        return (steps.euler if y.shape[1] == nodes else steps.rk4)(rhs, t, y, dt, args)

    (finding,) = check_stepper(step, 4, only=["sizes"]).failed
    assert f"of {nodes} nodes" in finding.line


@pytest.mark.parametrize(
    ("digits", "which"), [pytest.param(10, 0, marks=pytest.mark.slow), (12, 1), (13, 2)]
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


@pytest.mark.parametrize("step", [steps.velocity_verlet, differences, "stormer-verlet"])
def test_all_digits_are_not_few(step):
    assert not check_stepper(step, only=["float32"], diagnose=False).failed


@pytest.mark.slow
def test_steps_in_parts_are_right_in_all_units():
    """More exact in some than in others."""

    def in_parts(rhs, t, y, dt, args):
        parts = jnp.clip(jnp.ceil(dt / 0.02), 1, 8).astype(int)
        h = dt / parts
        return jax.lax.fori_loop(0, parts, lambda i, y: steps.euler(rhs, t + i * h, y, h, args), y)

    assert not check_stepper(in_parts, 1, only=["scales"], time_limit=600.0).failed


@pytest.mark.parametrize(("check", "relative"), [("units", False), ("boost", True)])
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


def adaptive(rhs, t, y, dt, args):
    """Heun's method with steps of its own, which keep the largest component to a tolerance."""
    end, h, y = t + dt, dt, np.asarray(y)
    while t < end - 1e-12:
        h = min(h, end - t)
        first = np.asarray(rhs(t, y, args))
        second = np.asarray(rhs(t + h, y + h * first, args))
        if np.max(np.abs(h * (second - first))) < 2e-5:
            t, y, h = t + h, y + h * (first + second) / 2, 1.5 * h
        else:
            h /= 2
    return y


@pytest.mark.slow
def test_steps_that_adapt_to_a_tolerance_break_no_symmetry():
    assert not check_stepper(adaptive, only=["rotation", "mirror", "units"], diagnose=False).failed


def nan_for_long_steps(acceleration, t, x, v, dt, args):
    x, v = steps.velocity_verlet(acceleration, t, x, v, dt, args)
    return (x, v) if dt < 0.3 else (x + np.nan, v)


def nan_far_away(acceleration, t, x, v, dt, args):
    x, v = steps.velocity_verlet(acceleration, t, x, v, dt, args)
    return np.where(np.abs(x) < 100.0, x, np.nan), v


@pytest.mark.parametrize(
    ("step", "check"),
    [
        (nan_for_long_steps, "free-flight"),
        (nan_for_long_steps, "scales"),
        (nan_far_away, "translation"),
        (nan_far_away, "far-states"),
    ],
)
def test_a_nan_is_called_by_its_name(step, check):
    (finding,) = check_stepper(step, only=[check]).failed
    assert "not finite (nan" in finding.line
    assert "dt = " in finding.line
    assert "by nan" not in finding.line
    assert "by inf" not in finding.line


@pytest.mark.parametrize("step", [steps.remembers, steps.counts], ids=lambda step: step.__name__)
def test_a_step_with_hidden_state_is_checked_no_further(step):
    steps.BEFORE = None
    report = check_stepper(step, 1, diagnose=False)
    assert [finding.check for finding in report.failed] == ["determinism"]
    assert {f.status for f in report.findings[1:]} == {"skip"}


def test_a_stepper_class_must_have_the_properties_that_it_declares():
    properties = ["order-damped", "energy", "symplectic"]
    report = check_stepper(InNumPy, only=properties)
    assert {finding.status for finding in report.findings} == {"pass"}
    assert not check_stepper(InNumPy, 2, only=["order-damped"], diagnose=False).passed
    # Beside an order that is claimed, too; a property that nobody claims would be a note.
    (finding,) = check_stepper(InNumPy, 1, only=["symplectic"]).findings
    assert finding.status == "pass"


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
