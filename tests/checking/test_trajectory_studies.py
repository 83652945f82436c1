"""What is drawn of trajectories from files is what would be drawn of the runs themselves."""

from __future__ import annotations

import numpy as np
import pytest
from trajectory_writing import node_values, write_csv, write_netcdf, write_npz

from ropeode import accuracy_table, node_paths
from ropeode.analysis import ROUND_OFF
from ropeode.checking import (
    trajectory_energy_curves,
    trajectory_error_curves,
    trajectory_errors,
    trajectory_paths,
)
from ropeode.errors import InputError
from ropeode.problems import Rope
from ropeode.render import PLOTS, film
from ropeode.simulation import simulate
from ropeode.study import energy_curves, error_curves, sampled_finer

STEPPER, STEPS = "velocity-verlet", (16, 32, 64)
FRAMES = 3


@pytest.fixture(scope="module")
def files(known, tmp_path_factory):
    """In three formats; samples at the frames alone."""
    folder = tmp_path_factory.mktemp("trajectories")
    writers = ((write_csv, "csv"), (write_npz, "npz"), (write_netcdf, "nc"))
    paths = []
    for steps, (write, suffix) in zip(STEPS, writers, strict=True):
        run = simulate(known.problem, STEPPER, steps)
        paths.append(folder / f"{steps}.{suffix}")
        write(paths[-1], run.times, node_values(known.problem, run.states), 1 / steps)
    return paths


def write(folder, problem, steps=STEPS, velocities=True, **how):
    paths = []
    for each in steps:
        run = simulate(problem, STEPPER, each)
        values = node_values(problem, run.states, velocities)
        paths.append(write_csv(folder / f"{each}.csv", run.times, values, 1 / each, **how))
    return paths


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


def test_one_file_has_curves_and_no_order(known, files):
    (curve,) = trajectory_error_curves(files[:1], known).curves
    assert (curve.stepper, curve.label) == ("16.csv", "dt = 0.0625")
    (each,) = trajectory_errors(files[:1], known).orders
    assert each.order.verdict == "undetermined"


def test_a_film_shows_the_samples_between_frames(tmp_path):
    """Of 15 and of 21 steps in each frame, 3 end at the same times."""
    problem = Rope(num_nodes=4).problem(1)
    paths = []
    for steps in (15, 21):
        run = simulate(sampled_finer(problem, steps), STEPPER, 1)
        values = node_values(problem, run.states)
        paths.append(write_csv(tmp_path / f"{steps}.csv", run.times, values, 1 / steps))
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


def test_a_film_with_a_stored_reference_shows_its_samples(known, files):
    nodes = trajectory_paths(files, known)
    assert nodes.samples_per_frame == 1
    for path, steps in zip(nodes.paths, STEPS, strict=True):
        assert np.array_equal(path.positions, simulate(known.problem, STEPPER, steps).positions)
    figure, show = film(nodes)
    show(2)
    assert "steps/frame" not in figure.get_suptitle()
    assert "16.csv, dt = 0.0625" in figure.axes[1].get_title(loc="left")


@pytest.mark.parametrize("kind", PLOTS)
def test_they_are_drawn(kind, known, files):
    figure = PLOTS[kind].draw(PLOTS[kind].of_trajectories(files, known, None, norm=None))
    words = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    words += [axes.get_title(loc="left") for axes in figure.axes]
    assert any("16.csv, 32.npz, 64.nc" in each for each in words)


def test_written_digits_count_as_round_off(known, tmp_path):
    """With 5 digits, half a unit of the last one is 0.005: more than any error here."""
    paths = write(tmp_path, known.problem, digits="%.5g")
    (each,) = trajectory_errors(paths, known).orders
    assert each.order.verdict == "undetermined"
    assert {point.reason for point in each.order.left_out} == {ROUND_OFF}


def test_a_wrong_trajectory_does_not_converge(known, tmp_path):
    """That of another damping, from the same start."""
    other = Rope(num_nodes=4, damping=0.5).problem(FRAMES)
    (each,) = trajectory_errors(write(tmp_path, other), known).orders
    assert each.order.verdict == "does not converge"


def test_without_velocities_there_are_errors_of_positions_alone(known, tmp_path):
    paths = write(tmp_path, known.problem, velocities=False)
    positions = trajectory_errors(paths, known)
    assert positions.orders[0].order.verdict == "converges"
    for study, more in (
        (trajectory_energy_curves, {}),
        (trajectory_error_curves, {"norm": "velocity-max"}),
    ):
        with pytest.raises(InputError, match="velocities: .* allowed: velocities in all files"):
            study(paths, known, **more)


def test_faults_are_those_of_grade(known, tmp_path, files):
    with pytest.raises(InputError, match="file: .*missing.csv"):
        trajectory_paths([tmp_path / "missing.csv"], known)
    with pytest.raises(InputError, match="files: 0 given"):
        trajectory_errors([], known)
    with pytest.raises(InputError, match="dt: 1 given; allowed: one for each of the 3 files"):
        trajectory_errors(files, known, [0.1])
    shifted = Rope(num_nodes=4, start=(0, 201), end=(-400, 201)).problem(FRAMES)
    with pytest.raises(InputError, match="initial state.*positions are shifted"):
        trajectory_errors(write(tmp_path, shifted), known)
    with pytest.raises(InputError, match="norm: 'max' given"):
        trajectory_errors(files, known, norm="max")
