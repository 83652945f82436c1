"""The equation that a step solves, as the problem's own with other parameters."""

from __future__ import annotations

import pytest

from ropeode import explain_stepper, load


def euler_of(change):
    """Explicit Euler with a change of its right-hand side, which takes f and the parameters."""

    def step(rhs, t, y, dt, args):
        return y + dt * change(lambda **others: rhs(t, y, args._replace(**others)), y)

    return step


SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda f, y: f(sigma=9.0, rho=29.0), "sigma = 9 in place of 10, rho = 29 in place of 28"),
        pytest.param(lambda f, y: f() * [1, -1, 1], "component 1 multiplied by -1", marks=SLOW),
        # No change of parameters makes up for it.
        pytest.param(lambda f, y: f() + 0.1 * y**2, None, marks=SLOW),
    ],
)
def test_what_is_changed_is_named(change, words):
    found = explain_stepper(euler_of(change), load("lorenz"), steps_per_frame=(8, 16)).local.wrong
    if words is None:
        assert found is None
    else:
        assert found.line.startswith(f"it is f with {words}")
