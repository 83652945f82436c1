"""Every stepper, with every option, has the order that it declares, on every fitting problem.

The problems are chosen to tell mistakes apart: damped and not, masses other than 1 and
unequal, moving at the start, pinned inside, three dimensions, forces that depend on time,
frames that are not of length 1, and step sizes whose ratio is 1.5.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import reference, simulate
from ropeode.analysis import ObservedOrder, largest_distance, observed_order, resolution
from ropeode.norms import Norm, norm_for
from ropeode.problems import PROBLEMS, ROPES, InextensibleRope, LinearDamping, Problem, Rope
from ropeode.simulation import Trajectory
from ropeode.steppers import BuiltIn
from ropeode.study import problem_class as class_of
from tests.problems.shorter import SHORTER
from tests.steppers.every_variant import EVERY_VARIANT, SINGLE_OPTIONS
from tests.steppers.ropes import in_space
from tests.verification.extrapolation import EPS, integrate, rope_solution

STEPS = (40, 60, 90, 135, 202, 303)
# So close to each other or to the centre that orders only show at finer steps.
FINER: dict[str | tuple[str, str], int] = {
    "library kepler": 4,
    "library pleiades": 2,
    ("moving undamped inextensible rope", "adams-bashforth4"): 2,
    "library double-pendulum": 2,
}
# Their errors reach round-off, or have a second term of about the same size.
OTHER_STEPS = {
    "pefrl": (20, 30, 45, 68, 101, 152),
    "yoshida6": (10, 15, 22, 34, 50, 76),
    "dormand-prince5": (7, 11, 15, 25, 42, 72, 121, 205),
    "dormand-prince8": (4, 5, 7, 9, 11, 15, 19, 25),
    "adams-bashforth3:start=euler": (455, 682, 1024, 1536, 2304),
}


def resting_rope(damping: float) -> Problem:
    return Rope(
        start=(0, 0, 0), end=(4, 1, -0.5), num_nodes=5, node_mass=1.7, stiffness=12.0,
        gravity=(0, -1, 0), damping=damping,
    ).problem(frames=3)  # fmt: skip


def resting_links(**given) -> Problem:
    return in_space(InextensibleRope, initial_velocity=(0.0, 0.0, 0.0), **given).problem(3)


def driven_acceleration(t, x, v, args, xp: Any = jnp):
    return -xp.sin(x) + xp.cos(1.3 * t) * xp.array([[0.3, 0.1]]) - args["rate"] * v


DRIVEN = Problem.second_order(
    driven_acceleration,
    [[0.4, 0.1]],
    [[1.1, -0.3]],
    2.0 + 0.7 * np.arange(4),
    {"rate": 0.8},
    damping=lambda args: LinearDamping(args["rate"], 0.3 * args["rate"]),
)


def driven_in_numpy(t: np.ndarray, y: np.ndarray) -> np.ndarray:
    x, v = y[:, 0], y[:, 1]
    return np.stack([v, driven_acceleration(t[:, 0], x, v, DRIVEN.args, np)], axis=1)


def riccati_rhs(t, y, args, xp: Any = jnp):
    """Nonlinear, non-autonomous, of first order, with a matrix for its state."""
    return y @ y * xp.sin(t) - y + xp.eye(2) * t


RICCATI = Problem(riccati_rhs, [[0.3, -0.2], [0.1, 0.4]], [0.5, 0.9, 1.7, 2.0])


def riccati_in_numpy(t: np.ndarray, y: np.ndarray) -> np.ndarray:
    return riccati_rhs(t, y, None, np)


# Its transient is over so soon that methods of high order are better than the reference knows.
BETTER_THAN_THE_REFERENCE = {("library robertson", 4)}
# From this order on, round-off may come before the leading term of the error outweighs the next
# one. An order that stays undetermined then is right if the errors fall as steeply somewhere. That
# the order conditions hold, tests/steppers/test_tableaus.py says.
HIGH = 5

# One iteration of Newton's method solves their equations.
LINEAR = {"library oscillator", "library linear-chain", "library forced"}

CASES: dict[str, Problem] = {
    # Of unequal masses, in three dimensions; all ropes are of one size, to be compiled only once.
    "moving rope": in_space(Rope, stiffness=(3, 2, 4.5, 1)).problem(3),
    "resting rope": resting_rope(0.15),
    "undamped rope": resting_rope(0.0),
    "moving inextensible rope": in_space(InextensibleRope, (1, 2)).problem(3),
    "moving undamped inextensible rope": in_space(InextensibleRope, damping=0.0).problem(3),
    "resting inextensible rope": resting_links(),
    "undamped inextensible rope": resting_links(damping=0.0),
    "driven": DRIVEN,
    "riccati": RICCATI,
}
LIBRARY = [f"library {name}" for name in PROBLEMS if name not in ROPES]
SLOW = pytest.mark.slow
# They take as long as all the others.
DEAR = ("moving inextensible rope", "moving undamped inextensible rope")


def fast(case: str) -> list[BuiltIn]:
    """On ropes, what moves links or has a say on damping, and is for this rope.

    All others know a right-hand side only, and the one of "riccati" tells most of them. A slope
    from before the start that is taken at another time only shows where the order is high.
    """
    if case in DEAR:
        return []
    if case == "driven":
        own = [e for e in SINGLE_OPTIONS if e.needs != "any ODE" or e.family == "multistep"]
        return [*own, *(e for e in EVERY_VARIANT if e.label == "adams-bashforth4")]
    if "rope" not in case:
        return SINGLE_OPTIONS
    rigid = "inextensible" in case
    return [
        each
        for each in SINGLE_OPTIONS
        if (each.moves_links and (rigid or not each.keeps_lengths)) or hasattr(each, "damping")
    ]


def other(case: str) -> list[BuiltIn]:
    return [each for each in EVERY_VARIANT if each not in fast(case)]


@functools.cache
def problem_of(case: str) -> Problem:
    name = case.removeprefix("library ")
    return CASES[case] if case in CASES else PROBLEMS[name](frames=4, **SHORTER.get(name, {}))


def declared_on(case: str, stepper: BuiltIn) -> int | None:
    if case in LINEAR and stepper.family == "implicit":
        stepper = dataclasses.replace(stepper, newton="converged")
    return stepper.order(class_of(problem_of(case)))


def fitting(case: str, steppers: list[BuiltIn] = EVERY_VARIANT) -> list[BuiltIn]:
    return [each for each in steppers if each.refusal(problem_of(case)) is None]


@functools.cache
def truth_of(case: str) -> tuple[np.ndarray, Callable[[Norm], float]]:
    """States at the sample times, and the smallest error that they resolve.

    Of the library's problems `reference` knows them; of the others the tests' own solver, which
    takes no time to compile.
    """
    problem = problem_of(case)
    if case in LIBRARY or EPS > 2e-19:
        known = reference(problem)
        assert known.horizon is None
        return known.states, lambda norm: float(resolution(known, norm)[-1])
    rhs = {"driven": driven_in_numpy, "riccati": riccati_in_numpy}.get(case)
    states = integrate(rhs, problem.y0, problem.ts) if rhs else rope_solution(problem)
    # What steppers round off is a few hundred times more than this.
    return states.astype(
        np.float64
    ), lambda norm: 16 * float(np.finfo(np.float64).eps) * problem.scale


def steps_of(case: str, stepper: BuiltIn) -> list[int]:
    own = OTHER_STEPS.get(stepper.label, OTHER_STEPS.get(stepper.name, STEPS))
    finer = FINER.get((case, stepper.label), FINER.get(case, 1))
    return [finer * steps for steps in own]


@functools.cache
def runs_of(case: str, stepper: BuiltIn) -> list[Trajectory]:
    return [simulate(problem_of(case), stepper, steps) for steps in steps_of(case, stepper)]


def errors_of(case: str, stepper: BuiltIn, measure: Norm) -> list[float]:
    problem, truth = problem_of(case), truth_of(case)[0]

    def error(run: Trajectory) -> float:
        return largest_distance(problem, measure, run.states, truth)

    return [error(run) if run.status == "ok" else np.inf for run in runs_of(case, stepper)]


def order_of(case: str, stepper: BuiltIn, norm: str | None = None) -> ObservedOrder:
    problem, (truth, resolved) = problem_of(case), truth_of(case)
    measure = norm_for(problem, norm)
    quantity = problem.quantity(measure.quantity, truth - problem.y0)
    return observed_order(
        [run.dt for run in runs_of(case, stepper)],
        errors_of(case, stepper, measure),
        resolution=resolved(measure),
        motion=float(np.max(np.abs(quantity))),
    )


def steepest(case: str, stepper: BuiltIn, norm: str | None = None) -> float:
    """The order between two runs that are next to each other, where it is highest."""
    errors = errors_of(case, stepper, norm_for(problem_of(case), norm))
    log_dts = np.log([run.dt for run in runs_of(case, stepper)])
    return float(np.max(np.diff(np.log(errors)) / np.diff(log_dts)))


def has_its_order(case: str, stepper: BuiltIn) -> bool:
    declared, order = declared_on(case, stepper), order_of(case, stepper)
    problem_class = class_of(problem_of(case))
    if not stepper.solves(problem_class):
        # The limit is another solution, and far enough away for the order to say so; but on what
        # it is for it may be unstable, and here.
        rigid = stepper.order(problem_class._replace(rigid=True))
        wrong = order.verdict == "does not converge" if rigid else order.verdict != "converges"
        return declared == 0 and wrong
    if declared == 0:
        return order.verdict != "converges"
    if (case, declared) in BETTER_THAN_THE_REFERENCE:
        return order.verdict == "undetermined" and "reference" in order.left_out[-1].reason
    if order.verdict == "undetermined" and declared >= HIGH:
        return steepest(case, stepper) > declared - 0.5
    low, high = order.ci95 or (np.inf, -np.inf)
    near = declared >= HIGH and abs(order.observed - declared) <= 0.25
    return order.verdict == "converges" and (near or low - 0.02 <= declared <= high + 0.02)


def velocities_have_its_order(case: str, stepper: BuiltIn) -> bool:
    declared = declared_on(case, stepper)
    if problem_of(case).mechanics is None or declared < 2:
        return True
    order = order_of(case, stepper, "velocity-max")
    if order.verdict == "undetermined" and (declared >= HIGH or case in LIBRARY):
        return steepest(case, stepper, "velocity-max") > declared - 0.5
    # Without damping, what ruth3's error of order 3 leaves after a period is of order 4.
    low, high = order.ci95 or (np.inf, -np.inf)
    return order.verdict == "converges" and any(
        abs(order.observed - known) <= 0.25 or low <= known <= high
        for known in (declared, 4 if stepper.name == "ruth3" else declared)
    )


@pytest.mark.parametrize(
    ("case", "steppers"),
    [
        *(pytest.param(case, fast(case), id=case) for case in CASES if case not in DEAR),
        *(pytest.param(case, other(case), id=f"{case} also", marks=SLOW) for case in CASES),
        *(pytest.param(case, SINGLE_OPTIONS, id=case, marks=SLOW) for case in LIBRARY),
    ],
)
def test_declared_orders(case, steppers):
    """In positions, or in whatever the state is; and in velocities, if it is 2 or more."""
    wrong = [
        (each.label, declared_on(case, each), order_of(case, each))
        for each in fitting(case, steppers)
        if not (has_its_order(case, each) and velocities_have_its_order(case, each))
    ]
    assert not wrong


def test_every_stepper_is_judged_on_several_problems():
    """On 4 of both kinds of rope, or on 3 ropes with springs."""
    for each in EVERY_VARIANT:
        judged = [case for case in CASES if each in fitting(case)]
        least = 3 if each.needs == "springs in a row" else 4
        assert sum(each.solves(class_of(problem_of(case))) for case in judged) >= least, each.label
