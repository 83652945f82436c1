"""What is drawn of trajectories from files is what would be drawn of the runs themselves."""

from __future__ import annotations

import numpy as np
import pytest
from trajectory_writing import write_runs

from ropeode import accuracy_table, node_paths
from ropeode.checking import (
    trajectory_energy_curves,
    trajectory_error_curves,
    trajectory_errors,
    trajectory_paths,
)
from ropeode.errors import InputError
from ropeode.problems import Rope
from ropeode.render import film
from ropeode.simulation import simulate
from ropeode.study import energy_curves, error_curves, sampled_finer

STEPPER, STEPS = "velocity-verlet", (16, 32, 64)
FRAMES = 3


@pytest.fixture(scope="module")
def files(known, tmp_path_factory):
    """In three formats; samples at the frames alone."""
    folder = tmp_path_factory.mktemp("trajectories")
    pairs = zip(STEPS, (".csv", ".npz", ".nc"), strict=True)
    return [write_runs(folder, known.problem, STEPPER, [n], suffix)[0] for n, suffix in pairs]


@pytest.mark.parametrize("norm", [None, "velocity-rms"])
def test_errors_are_those_of_the_table(norm, known, files):
    table = accuracy_table(known, [STEPPER], STEPS, norm=norm)
    errors = trajectory_errors(reversed(files), known, norm=norm)
    assert [row.dt for row in errors.rows] == [row.dt for row in table.rows]
    assert [row.error_max for row in errors.rows] == [row.error_max for row in table.rows]
    assert errors.rows[0].resolution == table.rows[0].resolution
    (own,), (tables,) = errors.orders, table.orders
    assert own.order.verdict == "converges"
    assert own.order.observed == pytest.approx(tables.order.observed, rel=1e-12)


def test_curves_are_those_of_the_runs(known, files):
    for own, direct in (
        (trajectory_error_curves(files, known), error_curves(known, [STEPPER], STEPS)),
        (trajectory_energy_curves(files, known), energy_curves(known, [STEPPER], STEPS)),
    ):
        assert np.array_equal(own.times, direct.times)
        for one, other in zip(own.curves, direct.curves, strict=True):
            assert one.dt == other.dt
            assert np.array_equal(one.times, other.times)
            assert np.array_equal(one.values, other.values)
        assert [curve.label for curve in own.curves] == [
            "16.csv, dt = 0.0625", "32.npz, dt = 0.03125", "64.nc, dt = 0.015625",
        ]  # fmt: skip
    # A film with a stored reference shows its samples.
    nodes = trajectory_paths(files, known)
    assert nodes.samples_per_frame == 1
    for path, steps in zip(nodes.paths, STEPS, strict=True):
        assert np.array_equal(path.positions, simulate(known.problem, STEPPER, steps).positions)
    figure, show = film(nodes)
    show(2)
    assert "16.csv, dt = 0.0625" in figure.axes[1].get_title(loc="left")
    # That of one file needs no name beside it.
    (curve,) = trajectory_error_curves(files[:1], known).curves
    assert (curve.stepper, curve.label) == ("16.csv", "dt = 0.0625")


def test_a_film_shows_the_samples_between_frames(tmp_path):
    """Of 15 and of 21 steps in each frame, 3 end at the same times."""
    problem = Rope(num_nodes=4).problem(1)
    paths = []
    for steps in (15, 21):
        (path,) = write_runs(tmp_path, sampled_finer(problem, steps), STEPPER, [1])
        paths.append(path.rename(tmp_path / f"{steps}.npz"))
    nodes = trajectory_paths(paths, problem)
    assert nodes.samples_per_frame == 3
    assert nodes.times == pytest.approx([0.0, 1 / 3, 2 / 3, 1.0], abs=1e-15)
    # With the samples of that reference, so that it is made once.
    direct = node_paths(nodes.reference, [STEPPER], 5)
    assert np.array_equal(nodes.times, direct.times)
    assert nodes.paths[0].positions == pytest.approx(direct.paths[0].positions, rel=1e-12)
    errors = direct.paths[0].errors
    assert nodes.paths[0].errors == pytest.approx(errors, abs=float(nodes.resolution[-1]))
    assert np.max(errors) > 100 * nodes.resolution[-1]


def test_bad_input(known, tmp_path, files):
    """As of `grade`, and what a study needs."""
    shifted = Rope(num_nodes=4, start=(0, 201), end=(-400, 201)).problem(FRAMES)
    beside = write_runs(tmp_path, shifted, STEPPER, STEPS)
    without = write_runs(tmp_path, known.problem, STEPPER, STEPS, ".csv", velocities=False)
    velocities = "velocities: .* allowed: velocities in all files"
    for study, made, more, words in (
        (trajectory_paths, [tmp_path / "missing.csv"], {}, "file: .*missing.csv"),
        (trajectory_errors, [], {}, "files: 0 given"),
        (trajectory_errors, files, {"dts": [0.1]}, "dt: 1 given; allowed: one for each of the 3"),
        (trajectory_errors, files, {"norm": "max"}, "norm: 'max' given"),
        (trajectory_errors, beside, {}, "initial state.*positions are shifted"),
        (trajectory_energy_curves, without, {}, velocities),
        (trajectory_error_curves, without, {"norm": "velocity-max"}, velocities),
    ):
        with pytest.raises(InputError, match=words):
            study(made, known, **more)
