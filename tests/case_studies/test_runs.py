"""Runs side by side, kept on disk, and found again."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from ropeode.case_studies import Run, all_figures, frames_for, run_all
from ropeode.simulation import simulate
from ropeode.theory import growth_per_frame
from tests.case_studies.conftest import FRAMES as REPORTED

CHEAP = (4, 31, 36)


@pytest.fixture(scope="module")
def wanted():
    figures = [all_figures()[number] for number in CHEAP]
    return {Run(each.setting(meaning), REPORTED) for each in figures for meaning in each.meanings}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def finished(wanted, folder):
    return run_all(wanted, folder)


def test_runs_are_those_of_the_figures_and_of_their_mirror_images(finished):
    """And of a rope that differs from the left one in the last digits alone."""
    for run, images in finished.items():
        setting = run.setting
        for image in images:
            alone = simulate(image.problem, setting.stepper, setting.steps_per_frame)
            np.testing.assert_array_equal(image.states, alone.states)
            assert image.diverged_at == alone.diverged_at
        for image, end in ((images.left, -400.0), (images.right, 400.0)):
            assert image.problem.parameters == setting.problem((end, 200.0), REPORTED).parameters
            assert image.states[0, 0, 0, -1] == end
        assert images.mirrored
        assert not images._replace(right=images.nudged).mirrored
        left, nudged = images.left.states[0], images.nudged.states[0]
        np.testing.assert_array_equal(left[..., 0], nudged[..., 0])
        np.testing.assert_array_equal(left[1], nudged[1])
        moved = nudged[0, :, 1:] - left[0, :, 1:]
        assert np.all(moved != 0)
        assert np.all(np.abs(moved) <= np.spacing(np.abs(left[0, :, 1:])))


def test_runs_are_kept_and_a_damaged_file_is_computed_again(tmp_path, folder, wanted, finished):
    kept = Path(shutil.copytree(folder, tmp_path / "kept"))
    cut, flipped, gone, *_ = sorted(kept.iterdir())
    assert len(list(kept.iterdir())) == len(wanted)
    whole = bytearray(flipped.read_bytes())
    whole[len(whole) // 2] ^= 0x10
    flipped.write_bytes(whole)
    cut.write_bytes(cut.read_bytes()[:500])
    gone.unlink()
    assert run_all(wanted, kept) == finished


def test_a_folder_that_cannot_be_written_only_keeps_nothing(tmp_path, wanted, finished):
    (tmp_path / "file").write_text("")
    parts = []
    again = run_all(wanted, tmp_path / "file/runs", lambda text, part: parts.append(part))
    assert again == finished
    assert parts == sorted(parts)
    assert parts[-1] == pytest.approx(1.0)


@pytest.mark.parametrize(("number", "expected"), [(12, 4000), (26, 17_000)])
def test_frames_suffice_for_what_theory_predicts(number, expected):
    setting = all_figures()[number].setting("words")
    problem = setting.problem((-400.0, 200.0), 1)
    growth = growth_per_frame(problem, setting.stepper, setting.steps_per_frame)
    frames = frames_for([setting])
    assert frames == expected > 1.2 * np.log(1000) / -growth.rate
