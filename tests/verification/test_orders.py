"""Every stepper, with every option, has the order that it declares, on every fitting problem.

The problems are chosen to tell mistakes apart: damped and not, masses other than 1 and
unequal, moving at the start, pinned inside, three dimensions, forces that depend on time,
frames that are not of length 1, and step sizes whose ratio is 1.5.
"""

from __future__ import annotations

import functools

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.problems.library import PROBLEMS
from ropeode.problems.problem import LinearDamping, Problem
from ropeode.problems.rope import Rope
from ropeode.render.stepper_list import variants
from ropeode.steppers import STEPPERS
from ropeode.study.accuracy_table import accuracy_table, problem_class

VARIANTS = {each.label: each for cls in STEPPERS.values() for each in variants(cls)}
STEPS = (40, 60, 90, 135, 202, 303)


def moving_rope() -> Problem:
    return Rope(
        start=(0, 0, 1),
        end=(3, -1, 0.5),
        num_nodes=5,
        node_mass=(1, 2, 0.5, 1.5, 0.7),
        stiffness=(3, 2, 4.5, 1),
        pinned=(1,),
        gravity=(0.3, -1, 0.2),
        damping=(0.1, 0.2, 0.3, 0.4, 0.5),
        initial_velocity=((0.1, 0.2, 0.3), (0, 0, 0), (1, -1, 0), (0.5, 0, 0.2), (0, 0.7, -0.4)),
    ).problem(frames=3)


def resting_rope(damping: float) -> Problem:
    return Rope(
        start=(0, 0), end=(4, 1), num_nodes=6, node_mass=1.7, stiffness=12.0, damping=damping
    ).problem(frames=3)


def driven_acceleration(t, x, v, args):
    return -jnp.sin(x) + jnp.cos(1.3 * t) * jnp.array([[0.3, 0.1]]) - args["rate"] * v


def driven() -> Problem:
    return Problem.second_order(
        driven_acceleration,
        [[0.4, 0.1]],
        [[1.1, -0.3]],
        2.0 + 0.7 * np.arange(4),
        {"rate": 0.8},
        damping=lambda args: LinearDamping(args["rate"], 0.3 * args["rate"]),
    )


def riccati() -> Problem:
    # Nonlinear, non-autonomous, of first order, with a matrix for its state.
    return Problem(
        lambda t, y, args: y @ y * jnp.sin(t) - y + jnp.eye(2) * t,
        [[0.3, -0.2], [0.1, 0.4]],
        [0.5, 0.9, 1.7, 2.0],
    )


CASES = {
    "moving rope": moving_rope,
    "resting rope": functools.partial(resting_rope, 0.15),
    "undamped rope": functools.partial(resting_rope, 0.0),
    "driven": driven,
    "riccati": riccati,
    **{
        f"library {name}": functools.partial(make, frames=4)
        for name, make in PROBLEMS.items()
        if name != "rope"
    },
}


@functools.cache
def table_of(case: str):
    problem = CASES[case]()
    fitting = [each for each in VARIANTS.values() if each.refusal(problem) is None]
    return accuracy_table(problem, fitting, STEPS)


@pytest.mark.parametrize("case", CASES)
def test_declared_orders(case):
    table = table_of(case)
    found_wrong = []
    for each in table.orders:
        declared = VARIANTS[each.stepper].order(problem_class(table.problem))
        assert each.expected == declared
        order = each.order
        if declared == 0:
            right = order.verdict != "converges"
        else:
            low, high = order.ci95 or (np.inf, -np.inf)
            right = order.verdict == "converges" and low - 0.02 <= declared <= high + 0.02
        if not right:
            found_wrong.append((each.stepper, declared, order))
    assert not found_wrong


@pytest.mark.parametrize("case", CASES)
def test_velocities_have_the_order_of_positions(case):
    problem = CASES[case]()
    if problem.mechanics is None:
        pytest.skip("has no velocities")
    fitting = [each for each in VARIANTS.values() if each.refusal(problem) is None]
    wanted = [each for each in fitting if each.order(problem_class(problem)) >= 2]
    for each in accuracy_table(problem, wanted, STEPS, norm="velocity-max").orders:
        assert each.order.verdict == "converges"
        assert each.order.observed == pytest.approx(each.expected, abs=0.25), each


def test_every_stepper_is_judged_on_several_problems():
    for each in VARIANTS.values():
        judged = [case for case in CASES if each.refusal(CASES[case]()) is None]
        assert len(judged) >= 4, each.label


def test_right_wrong_limits_are_told_apart():
    """The cases hold a problem on which each wrong variant shows its fault."""
    for each in VARIANTS.values():
        orders = {each.order(problem_class(CASES[case]())) for case in CASES}
        best = each.order(problem_class(CASES["undamped rope"]()))
        assert best == max(orders)
