"""Properties of one step and the orders of their defects, against what is proved of the methods."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode.problems import PROBLEMS, InextensibleRope, Problem, Rope
from ropeode.theory import structure_of
from tests.theory.steps import WithMemory, verlet_in_numpy

# With damping, which is left out, pins and gravity.
ROPE = Rope(num_nodes=4, start=(0, 0), end=(-40, 0), stiffness=3.0, damping=0.2).problem(2)
KEPLER = PROBLEMS["kepler"](frames=2)
ALL = ("symplectic", "reversible", "volume", "energy", "momentum", "angular momentum")


class RemembersThreeStates(WithMemory):
    """Explicit, and no map of states."""

    def init(self, system, t, y, dt):
        return y, 0.0 * y, 0.0 * y

    def step(self, system, t, carried, dt):
        y, before, last = carried
        k = system.rhs(t, y)
        return y + dt * (k + 0.1 * (before - last)), k, before


def holds(found):
    return {name for name, each in found.items() if each.holds}


SLOW = pytest.mark.slow
VERLET = ({*ALL} - {"energy"}, {"energy": 3})


@pytest.mark.parametrize(
    ("stepper", "kept", "powers"),
    [
        ("explicit-euler", {"momentum"}, {"symplectic": 2, "reversible": 2, "energy": 2}),
        # How it goes on, not how it starts.
        pytest.param("stormer-verlet:start=rest", *VERLET, marks=SLOW),
        pytest.param("leapfrog:form=staggered", *VERLET, marks=SLOW),
        (verlet_in_numpy, *VERLET),
        # It is not symmetric: back again it differs, if only by its own error.
        ("ruth3", {*ALL} - {"energy", "reversible"}, {"energy": 4, "reversible": 4}),
        pytest.param("yoshida6", {*ALL} - {"energy"}, {"energy": 7}, marks=SLOW),
    ],
)
def test_a_rope(stepper, kept, powers):
    found = structure_of(ROPE, stepper)
    assert holds(found) == kept
    assert {name: found[name].power for name in powers} == powers
    for name in ALL:
        assert found[name].note == ("without pins and gravity" if "momentum" in name else "")
        defect = found[name].defect
        assert defect is not None
        assert (defect > 1e-6) != (name in kept)


def test_a_planet_keeps_its_angular_momentum():
    found = structure_of(KEPLER, "velocity-verlet", ["angular momentum", "momentum"])
    assert (found["angular momentum"].holds, found["angular momentum"].note) == (True, "")
    assert found["momentum"].holds is None
    assert "no component of it" in found["momentum"].note


@SLOW
def test_momenta_may_depend_on_the_positions():
    """The double pendulum's mass matrix does: kicks of its velocities are not symplectic."""
    found = structure_of(PROBLEMS["double-pendulum"](), "semi-implicit-euler", ["symplectic"])
    assert (found["symplectic"].holds, found["symplectic"].power) == (False, 2)


def moving(acceleration):
    return Problem.second_order(acceleration, [[1.0]], [[0.0]], np.arange(3.0))


@pytest.mark.parametrize(
    ("acceleration", "only"),
    [
        (lambda t, x, v, args: -x + 0.1 * v, ALL),
        (lambda t, x, v, args: -x + 0.8 * t, ("reversible", "volume")),
    ],
)
def test_what_a_problem_does_not_keep_no_step_is_asked_for(acceleration, only):
    found = structure_of(moving(acceleration), "explicit-euler", [*only])
    assert {each.holds for each in found.values()} == {None}


def test_what_remembers_more_than_it_shows_is_no_map():
    problem = PROBLEMS["oscillator"](damping=0.0)
    found = structure_of(problem, RemembersThreeStates(), ["symplectic"])["symplectic"]
    assert found.holds is None
    assert "remembers more" in found.note


@pytest.mark.parametrize(
    ("problem", "why"),
    [
        (Problem(lambda t, y, args: -y, np.ones(1), np.arange(2.0)), "not mechanical"),
        (InextensibleRope(num_nodes=4).problem(2), "rigid links"),
    ],
)
def test_where_there_is_nothing_to_say(problem, why):
    assert why in str(structure_of(problem, "explicit-euler"))


@SLOW
def test_a_high_order_is_no_structure():
    """Defects at usual steps are below what differences show."""
    assert not holds(structure_of(KEPLER, "scipy:DOP853"))


def midpoint_by_fixed_point(rhs, t, y, dt, args):
    """As many iterations as suffice for short steps only."""
    k = rhs(t, y, args)
    for _ in range(40):
        k = rhs(t + dt / 2, y + dt / 2 * k, args)
    return y + dt * k


def test_an_iteration_that_ends_too_soon_at_long_steps_breaks_no_symmetry():
    spring = moving(lambda t, x, v, args: -x - x**3)
    found = structure_of(spring, midpoint_by_fixed_point, only=["reversible"])["reversible"]
    assert found.holds
    assert "iteration ends too soon" in found.note
