"""The equation that a step solves, as the problem's own with other parameters."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ropeode.precision import in_float64
from ropeode.problems import PROBLEMS
from ropeode.theory.changed_parameters import diagnose_parameters
from ropeode.theory.step_samples import rates_of

PROBLEM = PROBLEMS["lorenz"](frames=2)
CHANGES: dict[str, tuple[Any, Any]] = {
    "f with sigma = 10.1 in place of 10": (
        lambda f, with_args: with_args(sigma=10.1),
        "parameters",
    ),
    "f with sigma = 9 in place of 10, rho = 29 in place of 28": (
        lambda f, with_args: with_args(sigma=9.0, rho=29.0),
        "parameters",
    ),
    "f with component 1 multiplied by -1": (lambda f, with_args: f * [1, -1, 1], "components"),
    "1.5 f, as if time ran": (lambda f, with_args: 1.5 * f, "pace"),
}


@in_float64
def found(change):
    t = np.zeros(6)
    y = PROBLEM.y0 * (1.0 + 0.3 * np.random.default_rng(0).normal(size=(6, 3)))
    right = rates_of(PROBLEM)(t, y)
    other = change(
        right, lambda **changed: rates_of(PROBLEM, PROBLEM.args._replace(**changed))(t, y)
    )
    rate = SimpleNamespace(value=other - right)
    expansion: Any = SimpleNamespace(problem=PROBLEM, t=t, y=y, slopes=right, rate=lambda _: rate)
    return diagnose_parameters(expansion)


@pytest.mark.parametrize("words", CHANGES)
def test_what_is_changed_is_named(words):
    change, cause = CHANGES[words]
    diagnosis = found(change)
    assert diagnosis is not None
    assert diagnosis.cause == cause
    assert diagnosis.line.startswith(f"it is {words}")


def test_what_is_no_change_of_parameters_is_not_said_to_be_one():
    assert found(lambda f, with_args: f + np.sin(f)) is None
