"""Files with numbers that are not finite: the run diverged, and the others are judged."""

from __future__ import annotations

import numpy as np
import pytest
from trajectory_writing import WRITERS, finding, node_values

from ropeode import grade
from ropeode.checking import read_runs, trajectory_errors
from ropeode.errors import InputError
from ropeode.simulation import simulate

STEPS = (16, 24, 32, 48)


def files(folder, problem, bad, suffix=".csv", number=np.nan):
    """Runs of velocity Verlet, of which some are not finite, or huge, from a sample on."""
    made = []
    for steps in STEPS:
        values = node_values(problem, simulate(problem, "velocity-verlet", steps).states)
        if steps in bad and np.isfinite(number):
            values[bad[steps] :, 1:] *= number
        elif steps in bad:
            values[bad[steps] :, 1, 3] = number
        made.append(WRITERS[suffix](folder / f"{steps}{suffix}", problem.ts, values, 1 / steps))
    return made


@pytest.mark.parametrize(("suffix", "number"), [*((s, np.nan) for s in WRITERS), (".csv", -np.inf)])
def test_the_others_are_judged(tmp_path, small_rope, known, suffix, number):
    made = files(tmp_path, small_rope, {16: 2}, suffix, number)
    report = grade(made, known, expected_order=2)
    assert report.verdict == "right"
    assert finding(report).convergence.quantities["position"].errors[0] is None
    (note,) = report.notes
    assert note.startswith("the run with dt = 0.0625 diverged at t = 2 (")
    assert f"16{suffix}, " in note
    assert note.endswith(f": {number:g}), and does not count")
    assert grade(made, known, expected_order=3, diagnose=False).verdict == "wrong"


ADD = "add runs with 96, 192 and 384 steps per frame (dt <= 0.0104)"


@pytest.mark.parametrize(
    ("bad", "number", "words"),
    [
        ({16: 2, 24: 1}, np.nan, "unstable at dt = 0.0625 and 0.04167; "),
        (dict.fromkeys(STEPS, 1), np.nan, ADD),
        (dict.fromkeys(STEPS, 1), 1e200, ADD),
    ],
)
def test_too_few_that_are_stable_decide_nothing(tmp_path, small_rope, known, bad, number, words):
    report = grade(files(tmp_path, small_rope, bad, number=number), known)
    assert report.verdict == "undetermined"
    assert words in finding(report).line
    assert len(report.notes) == (0 if number == 1e200 else len(bad))


def test_what_follows_does_not_count(tmp_path, small_rope, known):
    """Many programs end there, in the middle of a sample."""
    made = files(tmp_path, small_rope, {16: 2})
    lines = made[0].read_text().splitlines(keepends=True)
    first = next(i for i, line in enumerate(lines) if line.endswith("nan\n"))
    made[0].write_text("".join(lines[: first + 3]) + "3,0,")
    (coarsest, *_) = read_runs(made, small_rope)
    assert (coarsest.reached, coarsest.diverged.time) == (2, 2.0)
    assert f"line {first + 1}, column 6 (vy)" in coarsest.diverged.where
    assert grade(made, known).verdict == "right"
    # Without it the file is cut off.
    made[0].write_text("".join(lines[: first - 2]))
    with pytest.raises(InputError, match=r"16.csv, line \d+: .* at the end of the file|is missing"):
        grade(made, known)


def test_what_cannot_be_a_run_is_refused(tmp_path, small_rope, known):
    made = files(tmp_path, small_rope, {16: 0})
    with pytest.raises(InputError, match=r"16.csv, line 4, column 6 \(vy\): nan given; .*initial"):
        grade(made, known)
    with pytest.raises(InputError, match=r"line 8, column 6 \(vy\): nan given.*leave out runs"):
        trajectory_errors(files(tmp_path, small_rope, {16: 1}), known)
