"""The fitted parameters are those that were changed."""

import jax
import numpy as np
import pytest

from ropeode import reference
from ropeode.checking import check_rope, diagnose_trajectories, generic
from ropeode.simulation import simulate, step_size

STEPS = (8, 12, 16, 24, 32, 48, 64, 96)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
@jax.enable_x64(True)
def test_numbers_are_right_to_their_spread(seed):
    """Changes drawn at random, of one to three parameters, of a rope on which all of them show."""
    draw = np.random.default_rng(seed)
    uniform = {"mass": 1.3, "stiffness": 3.7, "rest_length": 0.8, "damping": 0.45, "pinned": (1,)}
    v0 = np.random.default_rng(6).normal(size=(5, 3))
    problem = check_rope(
        "uniform", generic().y0[0], 0.4 * np.arange(4), v0=v0, gravity=(0.3, -0.8, 0.2), **uniform
    )
    free = ["damping", "stiffness", "rest_length", "gravity"]
    names = draw.choice(free, draw.integers(1, 4), replace=False)
    factor = {name: float(draw.uniform(0.5, 1.6)) for name in names}
    changed = {name: by * getattr(problem.args, name) for name, by in factor.items()}
    other = problem.changed(args=problem.args._replace(**changed))
    runs = [(step_size(problem, n), simulate(other, "rk4", n).states) for n in STEPS]
    (found,) = diagnose_trajectories(problem, reference(problem), runs, problem.quantities)
    numbers = found.evidence["parameters"]
    # Damping and stiffness together have the same effect as a mass and one of them.
    assert {*numbers} == {*names}
    for name, number in numbers.items():
        claimed = np.ravel(getattr(problem.args, name))
        claimed = claimed if name == "gravity" else claimed[:1]
        off = np.abs(np.ravel(number["found"]) - factor[name] * claimed)
        assert np.all(off <= number["spread"])
        assert np.all(np.asarray(number["spread"]) < 1e-6)
