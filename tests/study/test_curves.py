"""Errors, energies and nodes against time."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import Problem, Rope, accuracy_table, node_paths, reference
from ropeode.analysis import error_series
from ropeode.norms import distance
from ropeode.simulation import simulate
from ropeode.study import energy_curves, error_curves, parts_of
from tests.exact_reference import rope_reference
from tests.quartic import quartic


@pytest.mark.parametrize("norm", [None, "velocity-rms"])
def test_errors_are_those_of_error_series_and_their_largest_is_in_the_table(small_rope, norm):
    known, asked = rope_reference(small_rope), (["rk4", "explicit-euler"], [8, 16])
    curves = error_curves(known, *asked, norm=norm)
    assert np.array_equal(curves.times, known.times[1:])
    assert np.array_equal(10 * curves.bound, curves.resolution)
    table = accuracy_table(known, *asked, norm=norm)
    for curve, row in zip(curves.curves, table.rows, strict=True):
        assert (curve.stepper, curve.steps_per_frame) == (row.stepper, row.steps_per_frame)
        series = error_series(simulate(small_rope, curve.stepper, row.steps_per_frame), known, norm)
        assert np.array_equal(curve.times, series.times)
        assert np.array_equal(curve.values, series.values)
        assert np.array_equal(curves.resolution, series.resolution)
        assert np.max(curve.values) == row.error_max


def test_errors_of_a_diverged_run_end_at_its_last_finite_state(decay):
    curves = error_curves(decay, ["explicit-euler"], [2, 400])
    diverged, fine = curves.curves
    run = simulate(decay.problem, "explicit-euler", 2)
    assert run.status == "diverged"
    assert diverged.diverged_at == decay.times[run.diverged_at]
    assert np.array_equal(diverged.times, decay.times[1 : run.diverged_at])
    apart = distance(decay.problem, curves.norm, run.states, decay.states)
    assert np.array_equal(diverged.values, apart[1 : run.diverged_at])
    assert fine.diverged_at is None
    assert np.array_equal(fine.times, decay.times[1:])


def test_errors_end_at_the_horizon_and_energies_of_runs_do_not():
    """An energy that the equation conserves is known at all times, and needs no reference."""
    rope = Rope(num_nodes=4, damping=0.0).problem(frames=3)
    errors = error_curves(rope, ["explicit-euler"], [40], rtol=1e-6, accuracy=3e-4)
    assert errors.reference.horizon is not None
    (curve,) = errors.curves
    for times in (errors.times, curve.times):
        assert times[-1] < errors.reference.horizon
        assert len(times) == errors.reference.trusted - 1
    (row,) = accuracy_table(errors.reference, ["explicit-euler"], [40]).rows
    assert (row.error_max, row.resolution) == (np.max(curve.values), errors.resolution[-1])
    # Four unit masses at rest 200 above zero have 800. Euler's method gains, RK4 hardly does.
    energies = energy_curves(rope, ["rk4", "explicit-euler"], [32, 64])
    assert energies.conserved
    assert energies.reference is None
    assert np.array_equal(energies.times, rope.ts)
    assert np.max(np.abs(energies.values / 800 - 1)) < 1e-11
    assert np.all(energies.bound >= 800 * np.finfo(float).eps)
    away = {(c.stepper, c.steps_per_frame): abs(c.values[-1] / 800 - 1) for c in energies.curves}
    # The energy error of RK4 falls at least like its order, 4.
    assert away["rk4", 32] / away["rk4", 64] > 2**4 * 0.9
    assert away["explicit-euler", 64] > 1e3 * away["rk4", 64]
    for curve in energies.curves:
        assert np.array_equal(curve.times, rope.ts)
        assert curve.values[0] == pytest.approx(800, rel=1e-14)


def test_a_little_damping_is_no_conservation():
    """The energy falls by what damping takes, and no stepper is blamed for it."""
    rope = Rope(num_nodes=4, damping=1e-6).problem(frames=3)
    energies = energy_curves(rope, ["rk4"], [64])
    assert not energies.conserved
    assert energies.reference is not None
    (curve,) = energies.curves
    lost = energies.values[0] - energies.values[-1]
    assert lost > 100 * energies.bound[-1]
    # RK4's own error is far smaller than that.
    assert np.max(np.abs(energies.errors(curve))) < 0.01 * lost
    assert np.array_equal(energies.values, rope.energies(energies.reference.states))


def test_the_bound_of_an_energy_holds_the_errors_of_the_reference(small_rope):
    """A reference of low accuracy, against one that is a million times better."""
    rough = reference(small_rope, rtol=1e-6, accuracy=1e-2)
    known = energy_curves(rough, ["rk4"], [8])
    away = known.values - small_rope.energies(reference(small_rope).states)
    assert np.all(np.abs(away) <= known.bound)
    assert np.max(np.abs(away)) > 0
    assert known.bound[-1] < 1e-4 * known.values[0]


def stiffening(t, x, v, args):
    return -(1.0 + t) * x


def of_stiffening(t, y, args):
    return 0.5 * jnp.sum(y[1] ** 2 + (1.0 + t) * y[0] ** 2)


@pytest.mark.slow
def test_an_energy_that_changes_with_time_is_not_conserved():
    """A spring that grows stiffer, at rest first: nothing but the time changes its energy."""
    times = np.arange(4.0)
    problem = Problem.second_order(stiffening, [1.0], [0.0], times, energy=of_stiffening)
    assert not energy_curves(problem, ["rk4"], [64]).conserved


def pushed(t, x, v, duration):
    return jnp.exp(-0.5 * ((t - 0.7) / duration) ** 2) / duration - x


def of_oscillator(t, y, duration):
    return 0.5 * jnp.sum(y**2)


@pytest.mark.parametrize(("duration", "met"), [(1e-2, True), (1e-6, False)])
def test_a_push_between_the_samples_is_no_conservation(duration, met):
    """Looking at many times meets a long one. A brief one shows in the solution of a reference."""
    # Samples close to the push, so that no step of the reference's solvers is longer than it.
    times = np.sort(np.append(np.arange(4.0), [0.7 - 10 * duration, 0.7 + 10 * duration]))
    problem = Problem.second_order(pushed, [1.0], [0.0], times, duration, energy=of_oscillator)
    assert energy_curves(problem, ["rk4"], [64]).conserved != met
    energies = energy_curves(reference(problem), ["rk4"], [64])
    assert not energies.conserved
    assert np.ptp(energies.values) > 1.0


@pytest.mark.parametrize(("steps", "parts"), [pytest.param(16, 8, marks=pytest.mark.slow), (11, 1)])
def test_more_samples_change_no_step(steps, parts, small_rope):
    """The steps are the same; only the times at which they begin are rounded differently.

    A frame is divided into as many parts as its steps can be shared among, 8 at most; that of a
    long film into fewer.
    """
    found = node_paths(small_rope, ["semi-implicit-euler", "stormer-verlet"], steps)
    assert (found.samples_per_frame, parts_of(100, steps)) == (parts, min(parts, 2))
    assert np.array_equal(found.times[::parts], small_rope.ts)
    for path in found.paths:
        run = simulate(small_rope, path.stepper, steps)
        few = path.positions[::parts]
        assert len(path.positions) == len(found.times) == 3 * parts + 1
        assert np.allclose(few, run.positions, rtol=1e-12, atol=1e-12 * small_rope.scale)
        assert path.diverged_at is None


def test_frames_of_different_lengths_and_a_norm_of_its_own(small_rope):
    uneven = small_rope.changed(ts=np.array([0.0, 0.3, 1.0, 2.5]))
    found = node_paths(uneven, ["rk4"], 8, norm="velocity-rms")
    assert np.array_equal(found.times[::8], uneven.ts)
    assert np.all(np.diff(found.times) > 0)
    run = simulate(found.reference.problem, "rk4", 1)
    series = error_series(run, found.reference, "velocity-rms")
    assert np.array_equal(found.paths[0].errors[1:], series.values)
    assert np.array_equal(found.resolution[1:], series.resolution)


@pytest.mark.slow
def test_diverged_at_is_a_frame_of_the_problem():
    run = simulate(quartic(), "explicit-euler", 2)
    (path,) = node_paths(quartic(), ["explicit-euler"], 2).paths
    assert path.diverged_at == run.diverged_at is not None
    assert np.all(np.isfinite(path.positions))
