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

from ropeode.problems.inextensible_rope import InextensibleRope
from ropeode.problems.library import PROBLEMS, ROPES
from ropeode.problems.links import LinearDamping
from ropeode.problems.problem import Problem
from ropeode.problems.rope import Rope
from ropeode.study.accuracy_table import accuracy_table, problem_class
from tests.problems.shorter import SHORTER
from tests.steppers.every_variant import EVERY_VARIANT

VARIANTS = {each.label: each for each in EVERY_VARIANT}
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


def inextensible_rope(moving: bool, **given) -> Problem:
    """In three dimensions with unequal masses; always of one size, to be compiled only once."""
    rope = {
        "start": (0, 0, 1),
        "end": (3, -1, 0.5),
        "num_nodes": 6,
        "node_mass": (1, 2, 0.5, 1.5, 0.7, 1.2),
        "pinned": (1,),
        "gravity": (0.3, -1, 0.2),
        "damping": (0.1, 0.2, 0.3, 0.4, 0.5, 0.15),
        **given,
    }
    if moving:
        # Across the rope, so that no link is stretched.
        along = np.subtract(rope["end"], rope["start"])
        across = np.cross(along, [(0.1, 0.2, 0.3), (1, -1, 0.4)])
        free = [node not in rope["pinned"] for node in range(6)]
        rows = np.outer((0.5, 0, -0.2, 0.1, 0.4, -0.5), across[0])
        rows += np.outer((-0.3, 0, 0.2, 0, 0.25, 0.1), across[1])
        rope["initial_velocity"] = rows * np.reshape(free, (6, 1))
    return InextensibleRope(**rope).problem(frames=3)


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


# Its transient is over so soon that methods of high order are better than the reference knows.
BETTER_THAN_THE_REFERENCE = {("library robertson", 4)}

CASES = {
    "moving rope": moving_rope,
    "resting rope": functools.partial(resting_rope, 0.15),
    "undamped rope": functools.partial(resting_rope, 0.0),
    "moving inextensible rope": functools.partial(inextensible_rope, True, pinned=(1, 2)),
    "moving undamped inextensible rope": functools.partial(inextensible_rope, True, damping=0.0),
    "resting inextensible rope": functools.partial(inextensible_rope, False),
    "undamped inextensible rope": functools.partial(inextensible_rope, False, damping=0.0),
    "driven": driven,
    "riccati": riccati,
    **{
        f"library {name}": functools.partial(make, frames=4, **SHORTER.get(name, {}))
        for name, make in PROBLEMS.items()
        if name not in ROPES
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
        if not each.solves:
            # The limit is another solution, and far enough away for the table to say so.
            right = declared == 0 and order.verdict == "does not converge"
        elif declared == 0:
            right = order.verdict != "converges"
        else:
            low, high = order.ci95 or (np.inf, -np.inf)
            right = order.verdict == "converges" and low - 0.02 <= declared <= high + 0.02
            if (case, declared) in BETTER_THAN_THE_REFERENCE:
                right = order.verdict == "undetermined" and "reference" in order.left_out[-1].reason
        if not right:
            found_wrong.append((each.stepper, declared, order))
    assert not found_wrong


@pytest.mark.parametrize("case", CASES)
def test_velocities_have_the_order_of_positions(case):
    known = table_of(case).reference
    problem = known.problem
    if problem.mechanics is None:
        pytest.skip("has no velocities")
    fitting = [each for each in VARIANTS.values() if each.refusal(problem) is None]
    wanted = [each for each in fitting if each.order(problem_class(problem)) >= 2]
    for each in accuracy_table(known, wanted, STEPS, norm="velocity-max").orders:
        assert each.order.verdict == "converges"
        assert each.order.observed == pytest.approx(each.expected, abs=0.25), each


def test_every_stepper_is_judged_on_several_problems():
    for each in VARIANTS.values():
        judged = [CASES[case]() for case in CASES if each.refusal(CASES[case]()) is None]
        assert len(judged) >= 4, each.label
        assert sum(each.solves(problem_class(problem)) for problem in judged) >= 4, each.label


def test_right_wrong_limits_are_told_apart():
    """The cases hold a problem on which each wrong variant shows its fault."""
    for each in VARIANTS.values():
        fitting = [case for case in CASES if each.refusal(CASES[case]()) is None]
        orders = {case: each.order(problem_class(CASES[case]())) for case in fitting}
        kind = "inextensible rope" if each.needs == "nodes in a row" else "rope"
        assert orders[f"undamped {kind}"] == max(orders.values())
