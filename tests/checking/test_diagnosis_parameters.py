"""The fitted parameters are those that were changed."""

import jax
import numpy as np
import pytest

from ropeode.checking.check_ropes import CROOKED, MOVING, check_rope
from ropeode.checking.diagnosis.fitted_numbers import numbers_of
from ropeode.checking.diagnosis.limits import observe_limit
from ropeode.checking.diagnosis.parameter_fit import smallest_fits
from ropeode.simulation import simulate, step_size

STEPS = (8, 12, 16, 24, 32, 48, 64, 96)


@pytest.fixture(scope="module", autouse=True)
def _float64():
    with jax.enable_x64(True):
        yield


def uniform_rope():
    """A rope whose parameters all show in its motion."""
    return check_rope(
        "uniform",
        CROOKED,
        (0.0, 0.4, 0.8, 1.2),
        v0=MOVING,
        mass=1.3,
        stiffness=3.7,
        rest_length=0.8,
        damping=0.45,
        gravity=(0.3, -0.8, 0.2),
        pinned=(1,),
    )


def limit_of_runs(problem, changed):
    """What RK4 tends to on a problem, if it is handed other numbers."""
    other = problem.changed(args=problem.args._replace(**changed))
    runs = [(step_size(problem, n), simulate(other, "rk4", n).states) for n in STEPS]
    return observe_limit(problem, runs, problem.quantities)


@pytest.mark.parametrize("seed", [4, *(pytest.param(s, marks=pytest.mark.slow) for s in range(4))])
def test_numbers_are_right_to_their_spread(seed):
    """Changes drawn at random, of one to three parameters."""
    draw = np.random.default_rng(seed)
    problem = uniform_rope()
    names = draw.choice(
        ["damping", "stiffness", "rest_length", "gravity"], draw.integers(1, 4), replace=False
    )
    factor = {name: float(draw.uniform(0.5, 1.6)) for name in names}
    changed = {name: by * getattr(problem.args, name) for name, by in factor.items()}
    limit = limit_of_runs(problem, changed)
    assert limit is not None
    # Damping and stiffness together have the same effect as a mass and one of them.
    fit = next(each for each in smallest_fits(limit) if {*each.names} == {*names})
    for number in numbers_of(problem, fit):
        off = np.abs(number.fitted - factor[number.name] * number.claimed)
        assert np.all(off <= number.spread)
        assert np.all(number.spread < 1e-6)


def test_ropes_that_move_the_same_are_found_together():
    """Masses of 1 and no damping: the same motion as with other stiffness and no damping."""
    problem = uniform_rope()
    changed = {"mass": np.ones(5), "damping": np.zeros(5)}
    limit = limit_of_runs(problem, changed)
    assert limit is not None
    both = {tuple(sorted(fit.names)): numbers_of(problem, fit) for fit in smallest_fits(limit)}
    assert {*both} == {("damping", "stiffness"), ("damping", "mass")}
    fitted = {number.name: number.fitted for numbers in both.values() for number in numbers}
    assert fitted["mass"] == pytest.approx(1.0, rel=1e-6)
