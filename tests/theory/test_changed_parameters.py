"""The equation that a step solves, as the problem's own with other parameters."""

from __future__ import annotations

import pytest

from ropeode import explain_stepper, load


def euler_of(change):
    """Explicit Euler with a change of its right-hand side, which takes f and the parameters."""

    def step(rhs, t, y, dt, args):
        return y + dt * change(lambda **others: rhs(t, y, args._replace(**others)), y)

    return step


@pytest.mark.parametrize(
    ("change", "cause", "words"),
    [
        (
            lambda f, y: f(sigma=9.0, rho=29.0),
            "parameters",
            "f with sigma = 9 in place of 10, rho = 29 in place of 28",
        ),
        pytest.param(
            lambda f, y: f() * [1.0, -1.0, 1.0],
            "components",
            "f with component 1 multiplied by -1",
            marks=pytest.mark.slow,
        ),
        # No change of parameters makes up for it.
        pytest.param(lambda f, y: f() + 0.1 * y**2, None, None, marks=pytest.mark.slow),
    ],
)
def test_what_is_changed_is_named(change, cause, words):
    found = explain_stepper(euler_of(change), load("lorenz"), steps_per_frame=(8, 16)).local.wrong
    assert (found and found.cause) == cause
    assert words is None or found.line.startswith(f"it is {words}")
