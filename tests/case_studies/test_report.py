"""The report, run again, as far as it is cheap."""

from __future__ import annotations

import pytest

from ropeode.analysis import classify_motion
from ropeode.case_studies import all_comparisons, rope_report, verdict
from ropeode.errors import InputError
from ropeode.simulation import simulate
from tests.case_studies.conftest import CHEAP, FRAMES
from tests.results import check_result


def result_of(report, number):
    return next(each for each in report.figures if each.figure.figure == number)


def reading_of(report, effect):
    readings = result_of(report, effect.figure).readings
    return next(reading for reading in readings if reading.meaning == effect.meaning)


def test_it_is_a_result(report):
    check_result(report)


def test_every_figure_that_was_asked_for(report):
    assert [each.figure.figure for each in report.figures] == [*CHEAP]
    for each in report.figures:
        assert each.measured
        whole = ("holds", "does not hold", "not watched long enough")
        assert each.verdict in whole or each.verdict.startswith("holds until frame ")
        assert each.frames == (FRAMES if each.readings else 0)
        assert len(each.readings) == (len(each.figure.meanings) if each.figure.run_as else 0)


def test_verdicts_are_those_of_runs_made_here(report):
    for each in report.figures:
        for reading in each.readings:
            problem = each.figure.setting(reading.meaning).problem((-400.0, 200.0), FRAMES)
            motion = classify_motion(
                simulate(problem, each.figure.run_as, each.figure.steps_per_frame)
            )
            for name in ("verdict", "diverged_at", "settled_at", "unsettled_at", "swings"):
                assert getattr(motion, name) == getattr(reading.motion, name)
            assert reading.verdict == verdict(each.figure.claim, motion, reading.growth)
            assert reading.verdict_mirrored == reading.verdict
            assert reading.mirrored


def test_what_is_known_of_some_figures(report):
    """Explicit Euler without damping explodes; semi-implicit Euler at 64 does not, whatever
    the report says; a damping factor near one half per frame lets nothing swing."""
    assert result_of(report, 4).verdict == "holds"
    assert result_of(report, 4).motion.diverged_at < 13
    assert result_of(report, 5).verdict == "does not hold"
    assert result_of(report, 5).readings[0].growth.stable
    assert result_of(report, 36).verdict == "holds"
    assert result_of(report, 36).motion.swings == 0
    for number in (1, 2, 3):
        assert result_of(report, number).verdict == "holds"


def test_as_listed_the_force_verlet_never_rests(report):
    words, listing = result_of(report, 31).readings
    assert (words.meaning, listing.meaning) == ("words", "listing")
    assert words.verdict == "holds"
    assert listing.verdict == "does not hold"
    assert "listing" in result_of(report, 31).measured


def test_comparisons_need_all_their_figures(report):
    assert [each.comparison.figures for each in report.comparisons] == [(36, 37)]
    assert (36, 37) in [each.figures for each in all_comparisons()]
    assert report.comparisons[0].verdict == "holds"


def test_thresholds_are_listed_where_they_change_a_verdict(report):
    assert {each.figure for each in report.sensitive_to_thresholds} == {31, 36}
    for each in report.sensitive_to_thresholds:
        reading = next(
            r for r in result_of(report, each.figure).readings if r.meaning == each.meaning
        )
        assert each.verdict.rstrip("0123456789") != reading.verdict.rstrip("0123456789")


def test_rounding_is_listed_where_it_changes_a_measurement(report):
    """Figure 8 has grown out of the last digits; figures that rest come out the same."""
    figures = {each.figure for each in report.sensitive_to_rounding}
    assert 8 in figures
    assert not figures & {36, 37}
    for each in report.sensitive_to_rounding:
        reading = next(
            r for r in result_of(report, each.figure).readings if r.meaning == each.meaning
        )
        assert each.value == getattr(reading.motion, each.measure) != each.nudged


def test_an_interrupted_report_goes_on(tmp_path):
    class Interrupted(Exception):
        pass

    def stop(text, fraction):
        if text.startswith("testing the claim"):
            raise Interrupted

    with pytest.raises(Interrupted):
        rope_report([4, 26], FRAMES, folder=tmp_path, progress=stop)
    # Each has the run of the other one then: they are read, and not made again.
    one, other = tmp_path.glob("*/*.npz")
    first, second = one.read_bytes(), other.read_bytes()
    one.write_bytes(second)
    other.write_bytes(first)
    done = rope_report([4, 26], FRAMES, folder=tmp_path)
    assert [each.figure.figure for each in done.figures] == [4, 26]
    right = rope_report([4, 26], FRAMES)
    ends = [[each.motion.diverged_at for each in of.figures] for of in (done, right)]
    assert ends[0] == ends[1][::-1] != ends[1]
    # Done is done: the next report computes everything again.
    assert not list(tmp_path.glob("*/*.npz"))


@pytest.mark.parametrize("frames", [0, -3, 1.5, "many"])
def test_bad_frames(frames):
    with pytest.raises(InputError, match="frames: .*whole number >= 1"):
        rope_report([4], frames)
