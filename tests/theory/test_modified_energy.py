"""The leading correction of the energy, against formulas and along runs."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode.problems import PROBLEMS
from ropeode.simulation import simulate
from ropeode.theory import modified_energy_of

SLOW = pytest.mark.slow


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
