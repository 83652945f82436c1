"""Right steppers as people write them pass the checks for thresholds, whatever their style."""

from __future__ import annotations

import numpy as np
import pytest

from tests.checking import steps
from tests.checking.no_time_limit import check_stepper

FAR = ["purity", "pins", "time-shift", "scales", "sizes", "far-states"]


def guarded(guard):
    """Own forces, guarded against springs of length zero."""

    def pulls(length, args):
        return args.stiffness * (1.0 - args.rest_length / guard(length))

    def step(acceleration, t, x, v, dt, args):
        v = v + dt * steps.forces(x, v, args, pulls) * (args.free / args.mass)[:, None]
        return x + dt * v, v

    return step


def iterated(tolerance, most=1000):
    """The implicit midpoint rule, up to an absolute tolerance."""

    def step(rhs, t, y, dt, args):
        y = np.array(y)
        new = y + dt * rhs(t, y, args)
        for _ in range(most):
            last, new = new, y + dt * rhs(t + dt / 2, (y + new) / 2, args)
            if np.max(np.abs(new - last)) < tolerance:
                return new
        raise RuntimeError("no convergence")

    return step


def for_three_dimensions(acceleration, t, x, v, dt, args):
    along_x, along_y, along_z = np.asarray(acceleration(t, x, v, args)).T
    v = v + dt * np.stack([along_x, along_y, along_z], axis=1)
    return x + dt * v, v


RIGHT = {
    "length + 1e-12": guarded(lambda length: length + 1e-12),
    "length of 1e-6 at least": guarded(lambda length: np.maximum(length, 1e-6)),
    "iterated to 1e-6": iterated(1e-6),
    "iterated to 1e-12, or raises": iterated(1e-12, 200),
    "for three dimensions": for_three_dimensions,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", RIGHT)
def test_right_steppers_pass_the_checks_for_thresholds(name):
    report = check_stepper(RIGHT[name], only=FAR, diagnose=False)
    assert report.failed == ()


def test_what_a_right_step_refuses_is_said_and_fails_nothing():
    def said(step, check):
        (finding,) = check_stepper(step, only=[check]).findings
        return finding.status, finding.line

    status, line = said(for_three_dimensions, "sizes")
    assert status == "pass"
    assert "in 2 dimensions it raised ValueError" in line
    status, line = said(iterated(1e-13, 200), "scales")
    assert status == "note"
    assert "it raised RuntimeError: no convergence" in line
