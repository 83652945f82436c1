"""What one step of a stepper does, and what follows from it."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode import InextensibleRope, Problem, Rope
from ropeode.problems import PROBLEMS
from ropeode.render import FORMATS, format_explanation
from ropeode.steppers import as_stepper
from ropeode.study import explain_stepper
from tests.exact_reference import exact_reference, rope_reference
from tests.results import check_result
from tests.schemas import assert_conforms
from tests.steppers.every_variant import SINGLE_OPTIONS

STEPS = (64, 128, 256)
OSCILLATOR = PROBLEMS["oscillator"](damping=0.2, frames=3)


def damped_per_step(acceleration, t, x, v, dt, args):
    x_new = x + (1 - 5e-5) * v * dt + np.asarray(acceleration(t, x, v, args)) * dt**2
    return x_new, (x_new - x) / dt


def own_euler(rhs, t, y, dt, args):
    return y + dt * np.asarray(rhs(t, y, args))


def test_a_right_step():
    """Of an oscillator, of which all is known that is of a rope but for its equilibrium."""
    method = "semi-implicit-euler"
    known = exact_reference(OSCILLATOR, OSCILLATOR.exact(OSCILLATOR.ts))
    right = explain_stepper(own_euler, known, steps_per_frame=STEPS, method=method)
    check_result(right)
    local = right.local
    assert (local.order, local.one_step) == (1, True)
    assert [each.order for each in local.quantities] == [1, 1]
    assert not any(each.identity.known or each.rate.known for each in local.quantities)
    for table in right.tables:
        (order,) = table.orders
        assert order.constant is not None
        assert order.constant.ratio == pytest.approx(1, abs=0.02)
    for each in right.against_time:
        (curve,) = each.curves
        assert curve.predicted == pytest.approx(curve.values, rel=0.1)
    # What it is, and what it is not.
    assert [each.name for each in right.equal] == ["explicit-euler"]
    # Positions differ by dt^2 a.
    assert right.compared.power == pytest.approx(2, abs=0.01)
    assert not right.compared.same


@pytest.mark.slow
def test_a_wrong_step_and_orders_of_other_classes():
    known = rope_reference(Rope(num_nodes=4).problem(frames=3))
    wrong = explain_stepper(damped_per_step, known, steps_per_frame=STEPS)
    assert wrong.local.order == -1
    position, velocity = wrong.local.quantities
    assert not position.identity.known
    assert velocity.identity.factor == pytest.approx(-5e-5, rel=1e-4)
    text = " ".join(format_explanation(wrong).split())
    assert "Each step multiplies velocities by 0.99995, whatever dt is" in text
    assert "no error is predicted: " in text
    assert wrong.tables[0].orders[0].constant.predicted is None
    found = explain_stepper("stormer-verlet:start=rest", known, steps_per_frame=STEPS)
    orders = {tuple(each.of_class[:2]): (each.local or 0, each.declared) for each in found.orders}
    # Of problems that are damped, and at rest at the start.
    expected = {True: (1, 1), False: (0, 0)}
    assert orders == {(damped, still): expected[still] for damped in (0, 1) for still in (0, 1)}
    assert (found.local.one_step, found.local.order) == (False, 1)
    # Damping at each step shows in problems that start at rest.
    problem = Rope(num_nodes=4, damping=0.05).problem(frames=3)
    found = explain_stepper("stormer-verlet:damping=per-step", problem, steps_per_frame=STEPS)
    assert found.orders[0].local == found.local.order < 1


EXPLAINED_ON = {
    "rope": Rope(num_nodes=3).problem(2),
    "rigid": InextensibleRope(num_nodes=3).problem(2),
    "kepler": PROBLEMS["kepler"](4),
}


def of_its_own(stepper):
    """A problem that a stepper is made for; of implicit steps, one that compiles quickly."""
    if stepper.family == "implicit":
        return "kepler"
    keeps_lengths = stepper.moves_links and not stepper.refusal(EXPLAINED_ON["rigid"])
    return "rigid" if keeps_lengths else "rope"


OF_ITS_OWN = [(of_its_own(each), each.label) for each in SINGLE_OPTIONS]
# Of high order; an implicit step of a rope of each kind; and one that solves another equation.
OTHERS = [
    ("kepler", "dormand-prince8"),
    ("kepler", "gauss4"),
    ("rope", "implicit-euler:newton=1"),
    ("rigid", "gauss4:newton=1"),
    ("rigid", "rk4"),
    ("rope", "rattle"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "stepper"), OF_ITS_OWN + OTHERS)
def test_every_stepper_can_be_explained(name, stepper):
    found = explain_stepper(stepper, EXPLAINED_ON[name], steps_per_frame=(8, 16, 32))
    for each in found.orders:
        known = None not in (each.local, each.declared) and len(found.local.times) > 1
        if known and as_stepper(stepper).solves(each.of_class):
            assert max(each.local, 0) == each.declared
    # Nothing is said against a step that is right.
    assert (found.local.wrong is None) >= (found.local.order is None or found.local.order > 0)
    for form in FORMATS:
        assert format_explanation(found, form)
    assert_conforms(format_explanation(found, "json"))


@pytest.mark.slow
def test_a_first_order_problem():
    problem = Problem(lambda t, y, args: -y, [1.0], [0.0, 1.0, 2.0])
    found = explain_stepper("rk4", problem, steps_per_frame=(4, 8, 16))
    assert found.local.order == 4
    # Of y' = -y the error of a step is dt^5/120, and that of the solution t/120 exp(-t) dt^4.
    assert found.tables[0].orders[0].constant.predicted == pytest.approx(1 / 120 / np.e, rel=1e-3)
    assert "first-order (this one)" in format_explanation(found)
    assert_conforms(format_explanation(found, "json"))
    # A solver of a library that is one of ropeode's; one iteration solves a linear equation.
    found = explain_stepper("diffrax:ImplicitEuler", problem, steps_per_frame=(4, 8, 16))
    assert [each.name for each in found.equal] == ["implicit-euler", "implicit-euler:newton=1"]
