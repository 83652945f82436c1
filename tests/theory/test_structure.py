"""Properties of one step and the orders of their defects, against what is proved of the methods.

And the leading correction of the energy, against formulas and along runs.
"""

from __future__ import annotations

import numpy as np
import pytest

from ropeode.problems import PROBLEMS, InextensibleRope, Problem, Rope
from ropeode.simulation import simulate
from ropeode.theory import modified_energy_of, structure_of
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
        assert (found[name].defect > 1e-6) != (name in kept)


def test_momenta_may_depend_on_the_positions():
    """The double pendulum's mass matrix does: kicks of its velocities are not symplectic."""
    found = structure_of(PROBLEMS["double-pendulum"](), "semi-implicit-euler", ["symplectic"])
    assert (found["symplectic"].holds, found["symplectic"].power) == (False, 2)


def moving(acceleration):
    return Problem.second_order(acceleration, [[1.0]], [[0.0]], np.arange(3.0))


GROWS, DRIVEN = (
    moving(lambda t, x, v, args: -x + 0.1 * v),
    moving(lambda t, x, v, args: 0.8 * t - x),
)
OSCILLATOR = PROBLEMS["oscillator"](damping=0.0)


@pytest.mark.parametrize(
    ("problem", "stepper", "name", "expected", "words"),
    [
        (KEPLER, "velocity-verlet", "angular momentum", True, ""),
        (KEPLER, "velocity-verlet", "momentum", None, "no component of it"),
        # What a problem does not keep no step is asked for.
        *((GROWS, "explicit-euler", name, None, "") for name in ALL),
        *((DRIVEN, "explicit-euler", name, None, "") for name in ("reversible", "volume")),
        # It is no map.
        (OSCILLATOR, RemembersThreeStates(), "symplectic", None, "remembers more"),
    ],
)
def test_other_problems(problem, stepper, name, expected, words):
    found = structure_of(problem, stepper, [name])[name]
    assert found.holds is expected
    assert words in found.note


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


# --- the modified energy


# Of the pendulum with mass, length and gravity 1: H = p^2/2 - cos q. Hairer, Lubich, Wanner,
# Geometric Numerical Integration, examples IX.3.1 and IX.3.2: H_1 = -p V'/2 with kicks first, and
# H_2 = V'' p^2/12 - V'^2/24 of velocity Verlet.
@pytest.mark.parametrize(
    ("stepper", "formula"),
    [
        ("velocity-verlet", lambda q, p: np.cos(q) * p**2 / 12 - np.sin(q) ** 2 / 24),
        pytest.param("semi-implicit-euler", lambda q, p: -p * np.sin(q) / 2, marks=SLOW),
    ],
)
def test_the_correction_is_that_of_the_formula(stepper, formula):
    problem = PROBLEMS["pendulum"](frames=6)
    found = modified_energy_of(problem, stepper, 64)
    expected = formula(*simulate(problem, stepper, 64).states[:, :, 0, 0].T)
    np.testing.assert_allclose(found.correction, expected - expected[0], atol=1e-7)


@SLOW
@pytest.mark.parametrize(("stepper", "order"), [("semi-implicit-euler", 1), ("velocity-verlet", 2)])
def test_it_is_kept_to_twice_the_order(stepper, order):
    problem = PROBLEMS["pendulum"](frames=6)
    energies = [modified_energy_of(problem, stepper, steps) for steps in (12, 24)]
    assert {each.order for each in energies} == {order}
    drifts = [[np.ptp(each.energy), np.ptp(each.modified)] for each in energies]
    # Both expansions go on in such steps: of Verlet in dt^2.
    assert np.log2(np.divide(*drifts)) == pytest.approx([order, 2 * order], abs=0.1)


@SLOW
def test_the_way_to_a_sample_leads_around_what_is_singular():
    # Half a turn from the start, the sun is on the straight line.
    found = modified_energy_of(PROBLEMS["kepler"](frames=20), "velocity-verlet", 64)
    predicted, measured, left = found.swings
    assert predicted == pytest.approx(measured, rel=1e-3)
    assert left < 1e-3 * measured
