"""Nodes at many samples are those of the run that has few."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode import node_paths
from ropeode.analysis import error_series
from ropeode.problems import PROBLEMS
from ropeode.simulation import simulate
from tests.quartic import quartic

ROUNDING = 1e-12


@pytest.mark.slow
def test_a_long_film_has_fewer_samples_in_each_frame():
    found = node_paths(PROBLEMS["kepler"](100), ["rk4"], 8)
    assert found.samples_per_frame == 2


@pytest.mark.parametrize(("steps", "parts"), [(16, 8), (11, 1)])
def test_more_samples_change_no_step(steps, parts, small_rope):
    """The steps are the same; only the times at which they begin are rounded differently.

    A frame is divided into as many parts as its steps can be shared among, 8 at most.
    """
    steppers = ["semi-implicit-euler", "stormer-verlet"]
    found = node_paths(small_rope, steppers, steps)
    assert found.samples_per_frame == parts
    assert len(found.times) == 3 * parts + 1
    assert np.array_equal(found.times[::parts], small_rope.ts)
    for path in found.paths:
        run = simulate(small_rope, path.stepper, steps)
        few = path.positions[::parts]
        assert few.shape == run.positions.shape
        assert np.allclose(few, run.positions, rtol=ROUNDING, atol=ROUNDING * small_rope.scale)
        assert path.diverged_at is None


def test_frames_of_different_lengths_and_a_norm_of_its_own(small_rope):
    uneven = small_rope.changed(ts=np.array([0.0, 0.3, 1.0, 2.5]))
    found = node_paths(uneven, ["rk4"], 8, norm="velocity-rms")
    assert np.array_equal(found.times[::8], uneven.ts)
    assert np.all(np.diff(found.times) > 0)
    finer = found.reference.problem
    run = simulate(finer, "rk4", 1)
    series = error_series(run, found.reference, "velocity-rms")
    assert np.array_equal(found.paths[0].errors[1:], series.values)
    assert np.array_equal(found.resolution[1:], series.resolution)


def test_diverged_at_is_a_frame_of_the_problem():
    run = simulate(quartic(), "explicit-euler", 2)
    (path,) = node_paths(quartic(), ["explicit-euler"], 2).paths
    assert path.diverged_at == run.diverged_at is not None
    assert np.all(np.isfinite(path.positions))
