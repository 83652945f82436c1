"""The report, run again, as far as it is cheap; and its runs, kept on disk."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode.analysis import classify_motion
from ropeode.case_studies import (
    Run,
    all_figures,
    draw_report,
    frames_for,
    plot_contact_sheets,
    plot_report_figure,
    rope_report,
    run_all,
    verdict,
)
from ropeode.progress import silent
from ropeode.simulation import simulate
from ropeode.theory import growth_per_frame
from tests.case_studies.conftest import CHEAP, FRAMES
from tests.render.plots.legible import assert_legible
from tests.results import check_result


def result_of(report, number):
    return next(each for each in report.figures if each.figure.figure == number)


def test_every_figure_is_run_and_judged_by_its_motion(report):
    """That runs are those that `simulate` makes, is told below."""
    check_result(report)
    assert [each.figure.figure for each in report.figures] == [*CHEAP]
    for each in report.figures:
        assert each.measured
        assert each.frames == (FRAMES if each.readings else 0)
        assert len(each.readings) == (len(each.figure.meanings) if each.figure.run_as else 0)
        for reading in each.readings:
            motion = classify_motion(reading.trajectory)
            for name in ("verdict", "diverged_at", "settled_at", "unsettled_at", "swings"):
                assert getattr(motion, name) == getattr(reading.motion, name)
            assert reading.verdict == verdict(each.figure.claim, motion, reading.growth)
            assert reading.verdict_mirrored == reading.verdict
            assert reading.mirrored


def test_what_is_known_of_some_figures(report):
    """Explicit Euler without damping explodes; semi-implicit Euler at 64 does not, whatever
    the report says; a damping factor near one half per frame lets nothing swing; and as listed,
    the force Verlet never rests."""
    verdicts = {number: result_of(report, number).verdict for number in CHEAP}
    assert {number for number, said in verdicts.items() if said == "holds"} >= {1, 4, 36}
    assert result_of(report, 4).motion.diverged_at < 13
    assert verdicts[5] == "does not hold"
    assert result_of(report, 5).readings[0].growth.stable
    assert result_of(report, 36).motion.swings == 0
    words, listing = result_of(report, 31).readings
    assert (words.meaning, words.verdict) == ("words", "holds")
    assert (listing.meaning, listing.verdict) == ("listing", "does not hold")
    assert "listing" in result_of(report, 31).measured
    # A comparison needs all of its figures.
    (compared,) = report.comparisons
    assert (compared.comparison.figures, compared.verdict) == ((36, 37), "holds")


def test_what_thresholds_and_rounding_change_is_listed(report):
    """Figure 8 has grown out of the last digits; figures that rest come out the same."""
    assert {each.figure for each in report.sensitive_to_thresholds} == {31, 36}
    for each in report.sensitive_to_thresholds:
        readings = result_of(report, each.figure).readings
        verdicts = [each.verdict, {it.meaning: it.verdict for it in readings}[each.meaning]]
        assert len({verdict.rstrip("0123456789") for verdict in verdicts}) == 2
    figures = {each.figure for each in report.sensitive_to_rounding}
    assert 8 in figures
    assert not figures & {36, 37}
    for each in report.sensitive_to_rounding:
        motion = result_of(report, each.figure).motion
        assert each.value == getattr(motion, each.measure) != each.nudged


def test_an_interrupted_report_goes_on(tmp_path):
    class Interrupted(Exception):
        pass

    def stop(text, fraction):
        if text.startswith("testing the claim"):
            raise Interrupted

    with pytest.raises(Interrupted):
        rope_report([4, 5], FRAMES, folder=tmp_path, progress=stop)
    # Each has the run of the other one then: they are read, and not made again.
    one, other = tmp_path.glob("*/*.npz")
    first, second = one.read_bytes(), other.read_bytes()
    one.write_bytes(second)
    other.write_bytes(first)
    done = rope_report([4, 5], FRAMES, folder=tmp_path)
    assert [each.figure.figure for each in done.figures] == [4, 5]
    right = rope_report([4, 5], FRAMES)
    ends = [[each.motion.diverged_at for each in of.figures] for of in (done, right)]
    assert ends[0] == ends[1][::-1] != ends[1]
    # Done is done: the next report computes everything again.
    assert not list(tmp_path.glob("*/*.npz"))


@pytest.mark.slow
def test_pictures(report):
    made = draw_report(report, silent)
    assert set(made) == {f"figure-{n:02}.png" for n in CHEAP} | {"contact-sheet-1.png"}
    diverged = result_of(report, 8)
    shapes, speeds, *_ = plot_report_figure(diverged).axes
    before = diverged.motion.diverged_at
    trace = shapes.get_lines()[0].get_xydata()
    np.testing.assert_array_equal(trace, diverged.readings[0].trajectory.positions[:before, -1])
    ends = [line.get_xdata()[0] for line in speeds.get_lines() if line.get_linestyle() == ":"]
    assert ends == [before]
    for each in report.figures:
        figure = plot_report_figure(each)
        # The rope at several times may be in one place.
        assert_legible(figure, [axes for axes in figure.axes if axes.get_yscale() == "log"])
        assert str(each.figure.figure) in figure.get_suptitle()
    (sheet,) = plot_contact_sheets(report)
    assert_legible(sheet, [])
    assert len(sheet.axes) == len(CHEAP)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Runs, and where they are kept."""
    figures = [all_figures()[number] for number in (4, 31, 36)]
    wanted = {Run(each.setting(meaning), FRAMES) for each in figures for meaning in each.meanings}
    kept = tmp_path_factory.mktemp("runs")
    return run_all(wanted, kept), kept


@pytest.mark.slow
def test_runs_are_those_of_the_figures_and_of_their_mirror_images(finished):
    """And of a rope that differs from the left one in the last digits alone."""
    for run, images in finished[0].items():
        setting = run.setting
        for image in images:
            alone = simulate(image.problem, setting.stepper, setting.steps_per_frame)
            np.testing.assert_array_equal(image.states, alone.states)
            assert image.diverged_at == alone.diverged_at
        for image, end in ((images.left, -400.0), (images.right, 400.0)):
            assert image.problem.parameters == setting.problem((end, 200.0), FRAMES).parameters
            assert image.states[0, 0, 0, -1] == end
        assert images.mirrored
        assert not images._replace(right=images.nudged).mirrored
        left, nudged = images.left.states[0], images.nudged.states[0]
        np.testing.assert_array_equal(left[..., 0], nudged[..., 0])
        np.testing.assert_array_equal(left[1], nudged[1])
        moved = nudged[0, :, 1:] - left[0, :, 1:]
        assert np.all(moved != 0)
        assert np.all(np.abs(moved) <= np.spacing(np.abs(left[0, :, 1:])))


def test_runs_are_kept_where_they_can_be_and_a_damaged_file_is_computed_again(finished, tmp_path):
    runs, kept = finished
    cut, flipped, gone, *others = sorted(kept.iterdir())
    assert len([cut, flipped, gone, *others]) == len(runs)
    whole = bytearray(flipped.read_bytes())
    whole[len(whole) // 2] ^= 0x10
    flipped.write_bytes(whole)
    cut.write_bytes(cut.read_bytes()[:500])
    gone.unlink()
    assert run_all(runs, kept) == runs
    parts = []
    (tmp_path / "file").write_text("")
    assert run_all(runs, tmp_path / "file/runs", lambda _, part: parts.append(part)) == runs
    assert parts == sorted(parts)
    assert parts[-1] == pytest.approx(1.0)


@pytest.mark.parametrize(("number", "expected"), [(12, 4000), (26, 17_000)])
def test_frames_suffice_for_what_theory_predicts(number, expected):
    setting = all_figures()[number].setting("words")
    problem = setting.problem((-400.0, 200.0), 1)
    growth = growth_per_frame(problem, setting.stepper, setting.steps_per_frame)
    frames = frames_for([setting])
    assert frames == expected > 1.2 * np.log(1000) / -growth.rate
