"""Right steppers as people write them pass the checks for thresholds, whatever their style."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode.checking import CHECKS
from tests.checking.no_time_limit import check_stepper
from tests.checking.steps import forces

FAR = ["purity", "pins", "time-shift", "scales", "sizes", "far-states"]


def guarded(guard):
    """Own forces, guarded against springs of length zero."""

    def step(acceleration, t, x, v, dt, args):
        d = x[1:] - x[:-1]
        length = guard(np.sqrt((d**2).sum(1)))
        pull = (args.stiffness * (length - args.rest_length) / length)[:, None] * d
        force = args.mass[:, None] * args.gravity - args.damping[:, None] * v
        force[:-1] += pull
        force[1:] -= pull
        v = v + dt * force * (args.free / args.mass)[:, None]
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


def in_its_own_arrays():
    """Results are computed in place, and handed out as copies."""
    own = {}

    def step(acceleration, t, x, v, dt, args):
        new = own.setdefault(np.shape(x), np.empty((2, *np.shape(x))))
        np.multiply(acceleration(t, x, v, args), dt, out=new[1])
        new[1] += v
        np.multiply(new[1], dt, out=new[0])
        new[0] += x
        return new[0].copy(), new[1].copy()

    return step


def for_three_dimensions(acceleration, t, x, v, dt, args):
    along_x, along_y, along_z = np.asarray(acceleration(t, x, v, args)).T
    v = v + dt * np.stack([along_x, along_y, along_z], axis=1)
    return x + dt * v, v


def in_substeps(acceleration, t, x, v, dt, args):
    x, v = np.array(x), np.array(v)
    count = 1 + int(float(dt) * np.sqrt(4 * args.stiffness.max() / args.mass.min()))
    for _ in range(count):
        v += dt / count * forces(x, v, args)
        x += dt / count * v
    return x, v


RIGHT = {
    "length + 1e-12": guarded(lambda length: length + 1e-12),
    "length of 1e-6 at least": guarded(lambda length: np.maximum(length, 1e-6)),
    "iterated to 1e-6": iterated(1e-6),
    "iterated to 1e-12, or raises": iterated(1e-12, 200),
    "in its own arrays": in_its_own_arrays(),
    "for three dimensions": for_three_dimensions,
    "in substeps": in_substeps,
}
FEW = ("length of 1e-6 at least",)


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[] if name in FEW else pytest.mark.slow) for name in RIGHT],
)
def test_right_steppers_pass_the_checks_for_thresholds(name):
    report = check_stepper(RIGHT[name], only=FAR, diagnose=False)
    assert set(FAR) <= set(CHECKS)
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
