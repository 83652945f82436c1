"""Whatever is wrong in a CSV file, the complaint names its line."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from trajectory_writing import csv_lines, write_csv

from ropeode.checking import read_runs
from ropeode.errors import InputError
from ropeode.problems import Rope

NODES, STEPS, FRAMES = 4, 3, 2
HEAD = 2  # a comment and the header
ROWS = NODES * (STEPS * FRAMES + 1)
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


def read(folder, problem, lines, end="\n", block=2**22):
    paths = [folder / "right-1.csv", folder / "right-2.csv", folder / "it.csv"]
    paths[-1].write_bytes(("\n".join(lines) + end).encode())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("ropeode.checking.trajectories.csv_files._BLOCK", block)
        return read_runs(paths, problem)


def right_lines():
    return csv_lines(*samples(STEPS), 1 / STEPS)


@few
@given(block=st.integers(1, 3000), ends=st.sampled_from(["\n", "\r\n"]))
def test_blocks_of_any_size_give_the_same_numbers(folder, problem, block, ends):
    runs = read(folder, problem, [ends.join(right_lines())], ends, block)
    times, values = samples(STEPS)
    finest = runs[-1]
    assert finest.dt == 1 / STEPS
    assert finest.interval == pytest.approx(1 / STEPS)
    assert np.array_equal(finest.values, values[np.isin(times, problem.ts)])


def dropped(lines, row):
    # At the end nothing follows that would be out of place.
    return lines[:row] + lines[row + 1 :], min(row, len(lines) - 2)


def doubled(lines, row):
    return [*lines[: row + 1], *lines[row:]], row + 1


def swapped(lines, row):
    row = min(row, len(lines) - 2)
    return [*lines[:row], lines[row + 1], lines[row], *lines[row + 2 :]], row


def merged(lines, row):
    row = min(row, len(lines) - 2)
    return [*lines[:row], lines[row] + lines[row + 1], *lines[row + 2 :]], row


def emptied(lines, row):
    return [*lines[:row], "", *lines[row:]], row


def with_a_field_more(lines, row):
    return [*lines[:row], lines[row] + ",1.5", *lines[row + 1 :]], row


def with_a_field_less(lines, row):
    return [*lines[:row], lines[row].rpartition(",")[0], *lines[row + 1 :]], row


LINES = (dropped, doubled, swapped, merged, emptied, with_a_field_more, with_a_field_less)


@few
@given(
    change=st.sampled_from(LINES),
    row=st.integers(HEAD, HEAD + ROWS - 1),
    block=st.integers(1, 3000),
)
def test_a_line_that_is_wrong(folder, problem, change, row, block):
    lines, at = change(right_lines(), row)
    with pytest.raises(InputError, match=rf"^\S*it\.csv, line {at + 1}\b"):
        read(folder, problem, lines, block=block)


WRONG = ["abc", "", " ", "1.2.3", "--1", "1e", "1_0", "0x10", "1;5", "1d3", "é", "nano", "1.5nan"]
NOT_FINITE = ["nan", "-inf", "1e999", "-nan(ind)", "1.#QNAN", "NaN ", "-1.#IND"]


@few
@given(
    row=st.integers(HEAD, HEAD + ROWS - 1),
    column=st.integers(0, 5),
    text=st.sampled_from([*WRONG, *NOT_FINITE, "\x00"]),
    block=st.integers(1, 3000),
)
def test_a_field_that_is_no_number(folder, problem, row, column, text, block):
    lines = right_lines()
    if text in NOT_FINITE and column > 1:
        return
    fields = lines[row].split(",")
    fields[column] = text
    lines[row] = ",".join(fields)
    where = rf"it\.csv, line {row + 1}, column {column + 1} "
    with pytest.raises(InputError, match=where):
        read(folder, problem, lines, block=block)


@pytest.mark.parametrize("text", ["", " ", "\t"])
def test_a_field_that_is_blank(folder, problem, text):
    lines = right_lines()
    fields = lines[7].split(",")
    lines[7] = ",".join([*fields[:4], text, fields[5]])
    with pytest.raises(InputError, match=r"it\.csv, line 8, column 5 \(vx\): .* a number"):
        read(folder, problem, lines)


@few
@given(row=st.integers(HEAD, HEAD + ROWS - 1), node=st.sampled_from([-1, 0, 1, 2, 3, 4, 1.5, 1e9]))
def test_a_wrong_node(folder, problem, row, node):
    lines = right_lines()
    fields = lines[row].split(",")
    if float(fields[1]) == node:
        return
    lines[row] = ",".join([fields[0], str(node), *fields[2:]])
    with pytest.raises(InputError, match=rf"it\.csv, line {row + 1}, column 2 \(node\)"):
        read(folder, problem, lines)


@few
@given(row=st.integers(HEAD, HEAD + ROWS - 1), shift=st.sampled_from([-1.0, -1e-9, 1e-9, 0.1, 7.0]))
def test_a_node_with_another_time(folder, problem, row, shift):
    lines = right_lines()
    t, _, rest = lines[row].partition(",")
    lines[row] = f"{float(t) + shift!r},{rest}"
    with pytest.raises(InputError, match=rf"it\.csv, line {row + 1}, column 1 \(t\)"):
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


HEADS = {
    "t,node,x,y,z": r"line 2: 't,node,x,y,z' given; allowed: the header 't,node,x,y' or",
    "time,i,x,y": "line 2: ",
    "0,0,1.5,2.5": "line 2: ",
    "": "line 2: ",
    "t;node;x;y": "line 2: ",
}


@pytest.mark.parametrize("head", HEADS)
def test_wrong_header(folder, problem, head):
    lines = right_lines()
    with pytest.raises(InputError, match=HEADS[head]):
        read(folder, problem, [lines[0], head, *lines[2:]])


def test_without_samples_or_without_anything(folder, problem):
    with pytest.raises(InputError, match="it.csv, line 3: 'nothing' given"):
        read(folder, problem, [right_lines()[0], "# more"])
    with pytest.raises(InputError, match="it.csv: 'no samples' given"):
        read(folder, problem, right_lines()[:2])
    with pytest.raises(InputError, match="it.csv, line 1: 'nothing' given"):
        read(folder, problem, [], "")


def test_what_is_no_text(folder, problem):
    with pytest.raises(InputError, match="it.csv, line 1: "):
        read(folder, problem, ["\x00\x7f" * 100_000])
    for block in (2000, 2**22):
        with pytest.raises(InputError, match="it.csv, line 3: 'a line that does not end'"):
            read(folder, problem, [*right_lines()[:2], "1" * 10_000], "", block)


def test_nodes_of_another_problem_have_their_reasons(folder, problem):
    for shape, words in (((7, 3, 4), "the file 3"), ((7, 5, 4), "has nodes 0 to 3 only")):
        lines = csv_lines(np.arange(7) / 3, np.zeros(shape), 1 / 3)
        with pytest.raises(InputError, match=words):
            read(folder, problem, lines)
    from_one = [
        re.sub(r",(\d),", lambda m: f",{int(m[1]) + 1},", line, count=1) for line in right_lines()
    ]
    with pytest.raises(InputError, match="line 3, column 2 .* number nodes from 0"):
        read(folder, problem, from_one)


@few
@given(digits=st.sampled_from(["%.6g", "%.7f", "%.9g"]), single=st.booleans())
def test_times_may_be_rounded(folder, problem, digits, single):
    """Every step, of a size whose multiples do not come out even; samples at sample times do."""
    steps = 300
    times = np.arange(steps * FRAMES + 1) / steps
    values = np.ones((len(times), NODES, 4))
    if single:
        times = times.astype(np.float32).astype(np.float64)
    lines = csv_lines(times, values, 1 / steps)
    lines[HEAD:] = [
        f"{digits % float(t)},{rest}"
        for t, _, rest in (line.partition(",") for line in lines[HEAD:])
    ]
    assert read(folder, problem, lines)[-1].values.shape == (FRAMES + 1, NODES, 4)
    without = lines[: HEAD + 100 * NODES] + lines[HEAD + 101 * NODES :]
    with pytest.raises(InputError, match=f"line {HEAD + 1 + 100 * NODES}: 'a time 0.0066"):
        read(folder, problem, without)
