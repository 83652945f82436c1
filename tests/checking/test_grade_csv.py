"""Whatever is wrong in a CSV file, the complaint names its line."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from trajectory_writing import csv_lines, write_csv

from ropeode.checking import read_runs
from ropeode.errors import InputError
from ropeode.problems import Rope

NODES, STEPS, FRAMES = 4, 3, 2
HEAD = 2  # a comment and the header
ROWS = NODES * (STEPS * FRAMES + 1)
ANY_ROW = st.integers(HEAD, HEAD + ROWS - 1)
few = settings(max_examples=40, deadline=None)


@pytest.fixture(scope="module")
def problem():
    return Rope(num_nodes=NODES).problem(frames=FRAMES)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("csv")
    for steps in (1, 2):
        write_csv(made / f"right-{steps}.csv", *samples(steps), 1 / steps)
    return made


def samples(steps):
    times = np.arange(steps * FRAMES + 1) / steps
    values = np.random.default_rng(steps).normal(size=(len(times), NODES, 4))
    return times, values


def read(folder, problem, lines, end="\n"):
    paths = [folder / "right-1.csv", folder / "right-2.csv", folder / "it.csv"]
    paths[-1].write_bytes(("\n".join(lines) + end).encode())
    return read_runs(paths, problem)


def right_lines():
    return csv_lines(*samples(STEPS), 1 / STEPS)


# What stands in place of two lines.
LINES = {
    "dropped": lambda line, after: [after],
    "doubled": lambda line, after: [line, line, after],
    "swapped": lambda line, after: [after, line],
    "merged": lambda line, after: [line + after],
    "an empty one": lambda line, after: ["", line, after],
    "a field more": lambda line, after: [line + ",1.5", after],
    "a field less": lambda line, after: [line.rpartition(",")[0], after],
}


@few
@given(change=st.sampled_from(list(LINES)), row=st.integers(HEAD, HEAD + ROWS - 2))
def test_a_line_that_is_wrong(folder, problem, change, row):
    lines = right_lines()
    lines[row : row + 2] = LINES[change](*lines[row : row + 2])
    at = row + 2 if change == "doubled" else row + 1
    with pytest.raises(InputError, match=rf"^\S*it\.csv, line {at}\b"):
        read(folder, problem, lines)


NO_NUMBER = [
    "abc", "", " ", "\t", "1.2.3", "--1", "1e", "1_0", "0x10", "1;5", "1d3", "é", "nano", "1.5nan",
    "\0",
]  # fmt: skip
NOT_FINITE = ["nan", "-inf", "1e999", "-nan(ind)", "1.#QNAN", "NaN ", "-1.#IND"]
WRONG_FIELD = (
    st.tuples(st.integers(0, 5), st.sampled_from(NO_NUMBER))
    # Velocities of a run that diverged may be what time and node may not.
    | st.tuples(st.integers(0, 1), st.sampled_from(NOT_FINITE))
    | st.tuples(st.just(1), st.sampled_from(["-1", "0", "1", "2", "3", "4", "1.5", "1e9"]))
    | st.tuples(st.just(0), st.sampled_from([-1.0, -1e-9, 1e-9, 0.1, 7.0]))
)


@settings(max_examples=120, deadline=None)
@given(row=ANY_ROW, wrong=WRONG_FIELD)
@example(row=7, wrong=(4, "\t"))
@example(row=7, wrong=(5, ""))
def test_a_field_that_is_wrong(folder, problem, row, wrong):
    """No number, a wrong node, or another time than the other nodes' (a number to add)."""
    lines, (column, text) = right_lines(), wrong
    fields = lines[row].split(",")
    if isinstance(text, float):
        text = repr(float(fields[0]) + text)
    assume(text != fields[column])
    fields[column] = text
    lines[row] = ",".join(fields)
    with pytest.raises(InputError, match=rf"it\.csv, line {row + 1}, column {column + 1} "):
        read(folder, problem, lines)


@few
@given(cut=st.integers(1, 10_000))
def test_a_file_that_was_cut_off(folder, problem, cut):
    text = "\n".join(right_lines()) + "\n"
    text = text[: len(text) - 1 - cut % (len(text) - 1)]
    last = text.count("\n") + (not text.endswith("\n"))
    with pytest.raises(InputError) as caught:
        read(folder, problem, [text], "")
    assert re.search(rf"it\.csv, (line {last}\b|dt: )", caught.value.problems[0])


@few
@given(sample=st.integers(1, STEPS * FRAMES), factor=st.sampled_from([0.0, 0.3, 0.9, 1.1, 2.0]))
def test_unequal_spacing(folder, problem, sample, factor):
    times, values = samples(STEPS)
    times[sample:] += (factor - 1.0) / STEPS
    lines = csv_lines(times, values, 1e-3)
    # The first interval is taken for the usual one, so that the next one is blamed for it.
    # A sample at a sample time may come early; then it is the one after it that is not there.
    with pytest.raises(InputError, match=r"it\.csv, line \d+: ") as caught:
        read(folder, problem, lines)
    line = int(re.search(r"line (\d+)", str(caught.value))[1])
    assert (line - HEAD - 1) // NODES in range(sample, sample + 2 + (sample == 1))


FIRST, HEADER = right_lines()[:2]
# What stands in a file, and its complaint.
CONTENTS = [
    *(
        ([FIRST, head, *right_lines()[2:]], "it.csv, line 2: ")
        for head in ("t,node,x,y,z", "time,i,x,y", "0,0,1.5,2.5", "", "t;node;x;y")
    ),
    ([FIRST, "# more"], "it.csv, line 3: 'nothing' given"),
    ([FIRST, HEADER], "it.csv, line 3: 'no samples' given"),
    ([], "it.csv, line 1: 'nothing' given"),
    (["\x00\x7f" * 100_000], "it.csv, line 1: "),
    ([FIRST, HEADER, "1" * 10_000], "it.csv, line 3: '1111.* allowed: a complete line"),
    (csv_lines(np.arange(7) / 3, np.zeros((7, 3, 4)), 1 / 3), "the file 3"),
    (csv_lines(np.arange(7) / 3, np.zeros((7, 5, 4)), 1 / 3), "has nodes 0 to 3 only"),
    (
        [
            re.sub(r",(\d),", lambda m: f",{int(m[1]) + 1},", line, count=1)
            for line in right_lines()
        ],
        "number nodes from 0",
    ),
]


@pytest.mark.parametrize(("lines", "words"), CONTENTS)
def test_what_is_no_file_of_this_problem(folder, problem, lines, words):
    with pytest.raises(InputError, match=words):
        read(folder, problem, lines, "" if len(lines) < 4 else "\n")


@pytest.mark.parametrize("digits", ["%.6g", "%.7f", "%.9g"])
@pytest.mark.parametrize(("number", "end"), [(np.float32, "\r\n"), (np.float64, "\n")])
def test_times_may_be_rounded(folder, problem, digits, number, end):
    """Every step, of a size whose multiples do not come out even; samples at sample times do."""
    steps = 300
    times = np.arange(steps * FRAMES + 1) / steps
    values = np.random.default_rng(1).normal(size=(len(times), NODES, 4))
    lines = csv_lines(times, values, 1 / steps)
    for row, t in enumerate(np.repeat(number(times), NODES), HEAD):
        lines[row] = f"{digits % t},{lines[row].partition(',')[2]}"
    finest = read(folder, problem, [end.join(lines)], end)[-1]
    assert (finest.dt, finest.interval) == (1 / steps, pytest.approx(1 / steps, rel=1e-3))
    assert np.array_equal(finest.values, values[::steps])
    without = lines[: HEAD + 100 * NODES] + lines[HEAD + 101 * NODES :]
    with pytest.raises(InputError, match=f"line {HEAD + 1 + 100 * NODES}: 'a time 0.0066"):
        read(folder, problem, without)
