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


@pytest.fixture
def kept(finished, folder, tmp_path):
    """A copy of the folder with the finished runs."""
    return Path(shutil.copytree(folder, tmp_path / "kept"))


def same(one, other) -> bool:
    return all(
        np.array_equal(a.states, b.states, equal_nan=True)
        and (a.status, a.diverged_at, a.steps_per_frame, a.stepper)
        == (b.status, b.diverged_at, b.steps_per_frame, b.stepper)
        and a.problem.parameters == b.problem.parameters
        for a, b in zip(one, other, strict=True)
    )


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


@pytest.mark.parametrize("damage", ["cut", "flipped", "gone"])
def test_runs_are_kept_and_a_damaged_file_is_computed_again(damage, kept, wanted, finished):
    assert len(list(kept.iterdir())) == len(wanted)
    victim = sorted(kept.iterdir())[0]
    whole = bytearray(victim.read_bytes())
    if damage == "gone":
        victim.unlink()
    else:
        whole[len(whole) // 2] ^= 0x10
        victim.write_bytes({"cut": whole[:500], "flipped": bytes(whole)}[damage])
    again = run_all(wanted, kept)
    assert all(same(again[run], finished[run]) for run in wanted)


def test_a_folder_that_cannot_be_written_only_keeps_nothing(tmp_path, wanted, finished):
    (tmp_path / "file").write_text("")
    parts = []
    again = run_all(wanted, tmp_path / "file/runs", lambda text, part: parts.append(part))
    assert all(same(again[run], finished[run]) for run in wanted)
    assert parts == sorted(parts)
    assert parts[-1] == pytest.approx(1.0)


@pytest.mark.parametrize("number", [12, 26])
def test_frames_suffice_for_what_theory_predicts(number):
    figure = all_figures()[number]
    settings = [figure.setting(meaning) for meaning in figure.meanings]
    growths = [
        growth_per_frame(each.problem((-400.0, 200.0), 1), each.stepper, each.steps_per_frame)
        for each in settings
    ]
    frames = frames_for(settings)
    assert 4000 <= frames <= 20_000
    needed = max(
        growth.predicted_blow_up or np.log(1000) / max(-growth.rate, 1e-12) for growth in growths
    )
    longest = frames * figure.steps_per_frame > 0.99 * 4000 * 65536
    assert frames > 1.2 * needed or needed > 1e9 or longest or frames == 20_000
