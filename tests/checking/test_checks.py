"""Each check passes what is right and fails what it is there for."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.checking import CHECKS, SLOW, chosen_checks, convergence_problems, hanging
from ropeode.checking.energy_drift import measure_drift
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.render import format_check
from ropeode.steppers import Phase, Stepper
from tests.checking import steps
from tests.checking.no_time_limit import check_stepper

RIGHT = {
    steps.velocity_verlet: {"expected_order": 2},
    steps.rk4: {"expected_order": 4, "symplectic": False},
    steps.euler: {"expected_order": 1, "conserves_energy": False, "reversible": False},
    steps.own_forces: {"expected_order": 1, "symplectic": True},
    steps.in_loops: {"expected_order": 1, "symplectic": True},
}


@functools.cache
def report_on(step):
    return check_stepper(step, **RIGHT[step])


@pytest.mark.parametrize(
    "step",
    [
        pytest.param(step, marks=[] if step is steps.velocity_verlet else pytest.mark.slow)
        for step in RIGHT
    ],
    ids=lambda step: step.__name__,
)
def test_right_steppers_pass_every_check(step):
    report = report_on(step)
    assert report.passed, report.failed
    assert {finding.check for finding in report.findings} == set(CHECKS)


def test_a_right_stepper_with_forces_of_its_own_passes():
    """In loops and in Python, so without what takes long."""
    report = check_stepper(steps.own_forces, **RIGHT[steps.own_forces], quick=True)
    assert report.passed, report.failed
    assert {finding.check for finding in report.findings} == set(CHECKS) - set(SLOW)


def test_the_documentation_counts_the_checks_as_a_report_does():
    report = report_on(steps.velocity_verlet)
    can_fail = sum(finding.status == "pass" for finding in report.findings)
    root, count = Path(__file__).parents[2], len(CHECKS)
    assert f"Right: {can_fail} of {count} checks passed" in format_check(report)
    page = (root / "docs/reference/check.md").read_text()
    assert f"of {count} checks fail" in page
    assert f"There are {count}," in page
    assert f"{can_fail} of them can fail" in page


@dataclasses.dataclass(frozen=True)
class StartsElsewhere(Stepper):
    """A stepper whose samples lag a step behind."""

    name = "starts-elsewhere"
    needs = "any ODE"
    symplectic = False
    source = "none"

    def order(self, problem_class):
        return 1

    def step(self, system, t, carried, dt):
        return carried + dt * system.rhs(t, carried)

    def state(self, system, t, carried, dt):
        return self.step(system, t, carried, dt)


@dataclasses.dataclass(frozen=True)
class InNumPy(Stepper):
    """A stepper that JAX cannot trace, with options of its own."""

    name = "in-numpy"
    needs = "second order"
    symplectic = True
    source = "none"

    def order(self, problem_class):
        return 1

    def step(self, system, t, carried, dt):
        v = np.array(carried.v)
        v += dt * np.array(system.acceleration(t, carried.x, carried.v))
        return Phase(carried.x + dt * v, v)


# For each check a stepper that fails it, and what is claimed of that.
WRONG = {
    "determinism": (steps.draws, {"expected_order": 1}),
    "purity": (steps.writes, {"expected_order": 1}),
    "first-sample": (StartsElsewhere, {}),
    "order-textbook": (steps.euler, {"expected_order": 2}),
    "order-damped": (steps.without_damping, {"expected_order": 2}),
    "order-unequal": (steps.leapfrog, {"expected_order": 2}),
    "order-driven": (steps.at_its_own_time, {"expected_order": 2}),
    "order-uneven": (steps.at_its_own_time, {"expected_order": 2}),
    "order-free": (steps.euler, {"expected_order": 2}),
    "free-flight": (steps.at_most_a_sixtieth, {}),
    "pins": (steps.moves_pins, {}),
    "momentum": (steps.pulls_at_one_end, {}),
    "translation": (steps.drag_by_place, {}),
    "boost": (steps.speed_limit, {}),
    "rotation": (steps.only_two_components, {}),
    "mirror": (steps.handed, {}),
    "node-order": (steps.in_place, {"expected_order": 2}),
    "time-shift": (steps.begins_softly, {}),
    "units": (steps.whole_lengths, {}),
    "scales": (steps.falls_asleep, {}),
    "sizes": (steps.five_nodes, {}),
    "far-states": (steps.breaks, {}),
    "stability": (steps.euler, {"method": "semi-implicit-euler"}),
    "energy": (steps.rk4, {"conserves_energy": True}),
    "symplectic": (steps.rk4, {"symplectic": True}),
    "reversible": (steps.in_loops, {"reversible": True}),
    "float32": (steps.single, {}),
    "zero-length": (steps.divides_by_length, {}),
}


# It says what is predicted and measured, and judges nothing.
REPORTS = {"error-constant"}


def test_every_other_check_has_a_stepper_that_fails_it():
    assert {*WRONG} == {*CHECKS} - REPORTS


def test_the_error_of_runs_is_the_predicted_one():
    (finding,) = check_stepper("semi-implicit-euler", only=["error-constant"]).findings
    assert finding.status == "note"
    for quantity in ("position", "velocity"):
        assert finding.evidence[quantity]["ratio"] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("check", WRONG)
def test_each_check_fails_a_wrong_stepper(check):
    step, claims = WRONG[check]
    report = check_stepper(step, **claims, only=[check], diagnose=False)
    (finding,) = report.findings
    assert (finding.check, finding.status) == (check, "fail"), finding.line
    assert not report.passed


def counting(most):
    """Heun for so many calls, then Euler."""
    calls = 0

    def step(rhs, t, y, dt, args):
        nonlocal calls
        calls += 1
        k = rhs(t, y, args)
        return y + dt / 2 * (k + rhs(t + dt, y + dt * k, args)) if calls <= most else y + dt * k

    return step


@pytest.mark.parametrize("most", [1000, 9000])
def test_a_step_that_changes_after_many_calls_is_not_deterministic(most):
    report = check_stepper(counting(most), 2, only=["determinism", "units"])
    assert [finding.check for finding in report.failed] == ["determinism"]
    assert report.findings[1].status == "skip"


@pytest.mark.parametrize("nodes", [3, 5 + 12, 100, 257])
def test_another_formula_for_one_number_of_nodes_is_found(nodes):
    def step(rhs, t, y, dt, args):
        k = rhs(t, y, args)
        if y.shape[1] == nodes:
            return y + dt * k
        return y + dt / 2 * (k + rhs(t + dt, y + dt * k, args))

    (finding,) = check_stepper(step, 2, only=["sizes"]).failed
    assert f"of {nodes} nodes" in finding.line


@pytest.mark.parametrize("digits", [10, 12, 13])
@pytest.mark.parametrize("which", [0, 1, 2])
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


def in_parts(longest, step):
    """Right: steps are divided into parts."""

    def divided(rhs, t, y, dt, args):
        parts = min(int(np.ceil(dt / longest)), 64)
        for i in range(parts):
            y = step(rhs, t + i * dt / parts, y, dt / parts, args)
        return y

    return divided


def in_compiled_parts(rhs, t, y, dt, args):
    """Right: the same in JAX."""
    parts = jnp.clip(jnp.ceil(dt / 0.02), 1, 8).astype(int)
    h = dt / parts
    return jax.lax.fori_loop(0, parts, lambda i, y: steps.rk4(rhs, t + i * h, y, h, args), y)


def in_parts_of_its_own(rhs, t, y, dt, args):
    """Right: Heun's method, in parts whose error is at most 1e-5."""
    end, part = t + dt, dt
    while t < end:
        part = min(part, end - t)
        k = rhs(t, y, args)
        change = part / 2 * (rhs(t + part, y + part * k, args) - k)
        if np.max(np.abs(change)) <= 1e-5 or part <= dt / 64:
            t, y = (end if part == end - t else t + part), y + part * k + change
            part *= 2
        else:
            part /= 2
    return y


@pytest.mark.parametrize(
    ("step", "order"),
    [
        (in_compiled_parts, 4),
        pytest.param(in_parts(0.02, steps.rk4), 4, marks=pytest.mark.slow),
        pytest.param(in_parts(0.05, steps.euler), 1, marks=pytest.mark.slow),
        pytest.param(in_parts(0.001, steps.rk4), None, marks=pytest.mark.slow),
        pytest.param(in_parts_of_its_own, None, marks=pytest.mark.slow),
    ],
)
def test_steps_in_parts_are_right_in_all_units(step, order):
    assert not check_stepper(step, order, only=["scales"], time_limit=600.0).failed


@pytest.mark.parametrize(
    "wrong",
    [
        lambda dt, v: dt < 1e-5,
        lambda dt, v: 3e-4 < dt < 6e-4,
        lambda dt, v: dt > 5.0 and np.max(np.abs(v)) < 0.1,
    ],
)
def test_another_formula_is_not_a_part_of_a_step(wrong):
    def step(rhs, t, y, dt, args):
        return (steps.euler if wrong(dt, y[1]) else steps.rk4)(rhs, t, y, dt, args)

    assert check_stepper(step, 4, only=["scales"]).failed


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


def nowhere_far_away(acceleration, t, x, v, dt, args):
    v = v + dt * acceleration(t, x, v, args)
    return np.where(np.abs(x) < 100.0, x + dt * v, np.nan), v


def test_a_transformed_run_that_is_not_finite_fails():
    assert not check_stepper(nowhere_far_away, only=["translation"]).passed


def test_rotation_passes_a_force_that_only_mirror_fails():
    """So that mirror and rotation are not the same check twice."""
    assert check_stepper(steps.handed, only=["rotation"]).passed


@pytest.mark.parametrize("step", [steps.remembers, steps.counts], ids=lambda step: step.__name__)
def test_a_step_with_hidden_state_is_checked_no_further(step):
    steps.BEFORE = None
    report = check_stepper(step, 1, diagnose=False)
    assert [finding.check for finding in report.failed] == ["determinism"]
    assert {f.status for f in report.findings[1:]} == {"skip"}


def test_a_stepper_class_in_numpy_must_have_the_properties_that_it_declares():
    properties = ["order-damped", "energy", "symplectic"]
    report = check_stepper(InNumPy, only=properties)
    assert {finding.check: finding.status for finding in report.findings} == dict.fromkeys(
        properties, "pass"
    )
    wrong = check_stepper(InNumPy, 2, only=["order-damped"], diagnose=False)
    assert not wrong.passed


class SaysSymplectic(Stepper):
    """Explicit Euler."""

    symplectic = True

    def step(self, system, t, y, dt):
        return y + dt * system.rhs(t, y)

    def order(self, problem_class):
        return 1


@pytest.mark.parametrize("order", [None, 1])
def test_a_class_is_held_to_what_it_declares_beside_what_is_claimed(order):
    report = check_stepper(SaysSymplectic, order, only=["symplectic"], diagnose=False)
    assert not report.passed
    # A property that nobody claims would be a note.
    assert [finding.check for finding in report.failed] == ["symplectic"]


# Where the stability functions leave the unit disc on the imaginary axis: Hairer, Wanner, Solving
# Ordinary Differential Equations II, section IV.2; Hairer, Lubich, Wanner, Geometric Numerical
# Integration, section I.5.
LIMITS = {
    "explicit-euler": 0.0,
    "semi-implicit-euler": 2.0,
    "stormer-verlet": 2.0,
    "velocity-verlet": 2.0,
    "rk4": 2.0 * 2.0**0.5,
}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[] if name == "rk4" else pytest.mark.slow) for name in LIMITS],
)
def test_limits_of_stability_are_those_of_theory(name):
    (finding,) = check_stepper(name, only=["stability"]).findings
    assert finding.status == "pass"
    for each in ("limit", "theory"):
        assert finding.evidence[each] == pytest.approx(LIMITS[name], rel=1e-3)


def test_quick_leaves_out_what_takes_long():
    assert chosen_checks(None, (), True) == [name for name in CHECKS if name not in SLOW]
    # What is asked for by name is not left out.
    assert chosen_checks(["energy"], (), True) == ["energy"]


def test_the_hanging_rope_hangs_still():
    problem = hanging()
    assert problem.mechanics is not None
    x, v = problem.y0
    a = in_float64(lambda: np.asarray(problem.mechanics.acceleration(0.0, x, v, problem.args)))()
    # Weights and pulls are of size 5 and cancel to rounding.
    assert np.max(np.abs(a)) < 1e-14


def test_the_ropes_differ_in_every_feature():
    """What the names promise: each feature is there, and each is missing somewhere."""
    args = [problem.args for problem in convergence_problems().values()]
    for name in ("damping", "drive", "gravity"):
        present = {bool(np.any(getattr(each, name))) for each in args}
        assert present == {True, False}, name
    masses = [each.mass for each in args]
    assert any(np.ptp(mass) == 0 and mass[0] == 1 for mass in masses)
    assert any(np.ptp(mass) == 0 and mass[0] != 1 for mass in masses)
    assert any(np.ptp(mass) > 0 for mass in masses)
    problems = list(convergence_problems().values())
    assert {problem.equal_frames for problem in problems} == {True, False}
    assert {bool(np.any(problem.y0[1])) for problem in problems} == {True, False}
    assert {tuple(np.flatnonzero(each.free == 0)) for each in args} == {(), (0,), (1,)}
    assert any(np.any(each.rest_length % 1 != 0) for each in args)
    assert any(problem.ts[0] not in (0.0,) for problem in problems)


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
        [[0.0]],
        [[1.0]],
        ts,
        energy=lambda t, y, args: 0.5 * y[1, 0, 0] ** 2 + 0.5 * y[0, 0, 0] ** 2,
    )
    whole = 1.0 + energy(ts / 400.0)
    angle = 0.9 * ts
    states = np.stack([np.sin(angle), np.cos(angle)], axis=1) * np.sqrt(2.0 * whole)[:, None]
    drift = measure_drift(problem, states.reshape(-1, 2, 1, 1))
    assert drift.verdict == verdict, drift.line
    assert words in drift.line
