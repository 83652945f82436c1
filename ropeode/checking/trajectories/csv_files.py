"""Trajectories in CSV: one line for each node at each time."""

from __future__ import annotations

import contextlib
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ropeode.checking.trajectories.layout import Layout, Written
from ropeode.files import open_to_read
from ropeode.validation import bad_value

_LONGEST_LINE = 2**12
_NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*", re.ASCII)
# As the C libraries write them: nan, -nan(ind), inf, Infinity, 1.#INF, -1.#IND, 1.#QNAN.
_NOT_FINITE = re.compile(
    r"\s*([+-]?)(nan(?:\(\w*\))?|inf(?:inity)?|1\.#[a-z]+0*)\s*", re.IGNORECASE | re.ASCII
)
# So many columns, of time and node, are finite in runs that diverged too.
_PLACE = 2
_STEP = re.compile(r"#\s*dt\s*[=:]\s*(\S+)\s*")


def read_csv(path: Path, layout: Layout) -> Written:
    """Read one line for each node at each time.

    Arguments:
        path: of the file.
        layout: of its samples.

    Raises:
        InputError: it cannot be read, or a line is wrong; the message names the line and the
            column.
    """
    with open_to_read("file", path) as file:
        return _Csv(path, layout, file).samples()


class _Csv:
    """A file that begins with comments and a header, as ``t,node,x,y,vx,vy``.

    A comment ``# dt = 0.01`` gives the step size. Nodes are numbered from 0; all nodes of one
    time are written one after the other, in order.

    Arguments:
        path: of the file.
        layout: of its samples.
        file: opened.

    Raises:
        InputError: it does not begin with comments and a header.
    """

    def __init__(self, path: Path, layout: Layout, file: BinaryIO):
        self.path, self.layout, self._file = path, layout, file
        self.dt: str | None = None
        number = 0
        while True:
            line = file.readline(_LONGEST_LINE)
            number += 1
            text = line.decode("utf-8-sig" if number == 1 else "utf-8", errors="replace").strip()
            if not text.startswith("#"):
                break
            if match := _STEP.fullmatch(text):
                self.dt = match[1]
        if not line:
            raise bad_value(
                f"{self.path}, line {number}",
                "nothing",
                f"a header, {self._allowed_headers}, and the samples",
                "check whether the program wrote its output",
            )
        names = ",".join(part.strip() for part in text.split(","))
        if names not in self.layout.headers:
            raise bad_value(
                f"{self.path}, line {number}",
                text,
                f"the header {self._allowed_headers}",
                "write the header above the numbers, and one line for each node",
            )
        self.columns = tuple(names.split(","))
        self._header_lines, self._begin = number, file.tell()

    @property
    def _allowed_headers(self) -> str:
        return " or ".join(map(repr, self.layout.headers))

    def samples(self) -> Written:
        """All samples.

        After a number that is not finite a program may end anywhere.

        Raises:
            InputError: a line is wrong; the message names the line and the column.
        """
        rows, first, nodes = self._rows(), self._header_lines + 1, self.layout.nodes
        whole = len(rows) // nodes * nodes
        self._check_nodes(rows, first)
        values = rows[:whole].reshape(-1, nodes, len(self.columns))
        if (values[:, :, 0] != values[:, :1, 0]).any():
            self._complain_of_times(values[:, :, 0], first)
        if whole < len(rows) and np.isfinite(values).all():
            given = f"node {len(rows) - whole - 1} at the end of the file"
            allowed = f"all {nodes} nodes at t = {rows[whole, 0]:.9g}"
            self._complain(first + len(rows) - 1, given, allowed, "let the program finish")

        def where(sample: int, node: int | None = None, column: int | None = None) -> str:
            text = f"{self.path}, line {first + sample * nodes + (node or 0)}"
            if column is not None:
                text += f", column {column + 3} ({self.columns[column + _PLACE]})"
            return text

        return Written(self.path, self.dt, values[:, 0, 0], values[:, :, _PLACE:], where)

    def _rows(self) -> np.ndarray:
        """All lines as numbers, ``(lines, columns)``."""
        lines = sum(1 for line in self._file if line.endswith(b"\n"))
        self._file.seek(self._begin)
        with contextlib.suppress(ValueError), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Of a file without numbers.
            rows = np.loadtxt(self._file, delimiter=",", comments=None, ndmin=2)
            # NumPy passes over empty lines, and takes a last one that does not end.
            as_usual = rows.shape == (lines, len(self.columns))
            if as_usual and np.isfinite(rows[:, :_PLACE]).all():
                return rows
        self._file.seek(self._begin)
        return np.array([*self._rows_by_hand()]).reshape(-1, len(self.columns))

    def _rows_by_hand(self) -> Iterator[list[float]]:
        """The numbers of each line, for what NumPy does not read and for complaints."""
        finite = True
        for number, line in enumerate(self._file, self._header_lines + 1):
            if not line.endswith(b"\n"):
                fix = "let the program finish, and end the last line with a newline too"
                if finite:
                    self._complain(number, line.decode(errors="replace"), "a complete line", fix)
                return
            numbers = self._row(line, number)
            finite = finite and bool(np.isfinite(numbers).all())
            yield numbers

    def _row(self, row: bytes, line: int) -> list[float]:
        """One line, with a message for whatever is wrong in it."""
        text = row.decode("utf-8", errors="replace").rstrip("\r\n")
        fields = text.split(",")
        if len(fields) != len(self.columns):
            given = f"{len(fields)} fields" if text.strip() else "an empty line"
            fix = "write the numbers of one node in each line, and nothing else"
            self._complain(
                line, given, f"{len(self.columns)} fields: {','.join(self.columns)}", fix
            )
        numbers = []
        for i, (name, value) in enumerate(zip(self.columns, fields, strict=True), 1):
            where = f"{self.path}, line {line}, column {i} ({name})"
            if match := _NOT_FINITE.fullmatch(value):
                number = float(f"{match[1]}inf" if "inf" in match[2].lower() else "nan")
            elif _NUMBER.fullmatch(value):
                number = float(value)
            else:
                fix = "write numbers as 1.25 or 1.25e-3"
                raise bad_value(where, value.strip(), "a number", fix)
            if i <= _PLACE and not np.isfinite(number):
                fix = "write a finite number, in runs that diverged too"
                raise bad_value(where, value.strip(), "a finite number", fix)
            numbers.append(number)
        return numbers

    def _check_nodes(self, rows: np.ndarray, first: int) -> None:
        """Check that nodes are numbered in order; the first line is that of node 0."""
        nodes = self.layout.nodes
        expected = np.arange(len(rows)) % nodes
        wrong = rows[:, 1] != expected
        if not wrong.any():
            return
        i = int(np.argmax(wrong))
        given, node, time = rows[i, 1], int(expected[i]), rows[i, 0]
        fix = f"write the nodes 0 to {nodes - 1} of each time in order, each once"
        if given == 1 and i == 0:
            fix = "number nodes from 0"
        elif given == nodes:
            fix = f"the problem has nodes 0 to {nodes - 1} only; grade the file with its own spec"
        elif given == 0 and i < nodes:
            fix = f"the problem has {nodes} nodes, the file {i}; grade the file with its own spec"
        raise bad_value(
            f"{self.path}, line {first + i}, column 2 (node)",
            _as_written(given),
            f"node {node} (t = {time:.9g})",
            fix,
        )

    def _complain_of_times(self, times: np.ndarray, first: int) -> None:
        """Complain of a node whose time differs from that of the others."""
        sample = int(np.argmax((times != times[:, :1]).any(axis=1)))
        usual = float(np.median(times[sample]))
        node = int(np.argmax(times[sample] != usual))
        fix = "write all nodes of one time before those of the next, with the same t"
        raise bad_value(
            f"{self.path}, line {first + sample * self.layout.nodes + node}, column 1 (t)",
            float(times[sample, node]),
            f"{usual!r}, like the other nodes of this sample",
            fix,
        )

    def _complain(
        self, line: int, given: str, allowed: str, fix: str = "correct the program"
    ) -> None:
        raise bad_value(f"{self.path}, line {line}", given, allowed, fix)


def _as_written(number: float) -> int | float:
    return int(number) if number == int(number) else float(number)
