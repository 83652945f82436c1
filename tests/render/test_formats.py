"""Every format, of tables that hold all that a table can hold."""

from __future__ import annotations

import csv
import io
import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ropeode.problems.problem import Problem
from ropeode.render.data import SCHEMA
from ropeode.render.formats import FORMATS
from ropeode.render.horizon import as_lines as horizon_lines
from ropeode.render.stepper_list import as_text as stepper_list
from ropeode.steppers import STEPPERS
from ropeode.study.accuracy_table import accuracy_table
from ropeode.terminal.output import FORMATS as LISTED
from tests.quartic import HOSTILE


def cubic(t, y, args):
    return -100 * y**3


@pytest.fixture(scope="module")
def tables(study):
    return {
        "rope": study("convergence", "rope"),
        "long names": study("convergence", "long names"),
        # A diverged run, a name that is hostile to every format, and an undetermined order.
        "hostile": accuracy_table(
            Problem(cubic, [1.0], np.arange(13.0), name=HOSTILE),
            ["explicit-euler"],
            (2, 700, 1400),
        ),
        # The reference ends before the frames do.
        "cut": study("convergence", "cut"),
    }


def test_formats_are_listed_on_the_command_line():
    assert list(LISTED) == list(FORMATS)


@pytest.mark.parametrize("case", ["rope", "long names", "hostile", "cut"])
@pytest.mark.parametrize("form", FORMATS)
def test_every_format_holds_the_findings(form, case, tables):
    table = tables[case]
    text = FORMATS[form](table)
    assert text.endswith("\n")
    assert not re.search(r"\b(nan|NaN|inf|Infinity|None)\b", text)
    for each in table.orders:
        assert each.stepper in text.replace(r"\_", "_")
        assert each.order.verdict in text
    for row in table.rows:
        assert str(row.steps_per_frame) in text
        assert row.status != "diverged" or "diverged" in text
    if form not in ("csv",):
        assert str(table.reference.certificate.solver) in text


def test_an_interval_is_from_low_to_high(tables):
    lines = list(csv.DictReader(io.StringIO(FORMATS["csv"](tables["rope"]))))
    intervals = [(line["order_low"], line["order_high"]) for line in lines if line["order_low"]]
    assert intervals
    assert all(float(low) < float(high) for low, high in intervals)


def test_text_fits_80_columns(tables):
    for table in tables.values():
        for line in FORMATS["text"](table).splitlines():
            assert len(line) <= 80
    assert all(len(line) <= 80 for line in stepper_list().splitlines())


def test_text_words(tables):
    hostile, cut = (FORMATS["text"](tables[case]) for case in ("hostile", "cut"))
    at = tables["hostile"].rows[0].diverged_at
    assert re.search(rf"2 +0.5 +diverged +frame {at} ", hostile)
    assert "undetermined: 2 of 3 step sizes can be used, 3 are needed" in hostile
    assert "left out: unstable: 2" in hostile
    assert f"trusted before t = {tables['cut'].reference.horizon:g} only" in cut.replace("\n", " ")
    assert "< " in FORMATS["text"](tables["rope"])


def test_json_schema(tables):
    for table in tables.values():
        whole = json.loads(FORMATS["json"](table), parse_constant=pytest.fail)
        assert whole["schema"] == SCHEMA == "ropeode.accuracy-table/1"
        assert set(whole) == {"schema", "problem", "norm", "reference", "rows", "orders"}
        assert {
            "level", "solver", "rtol", "witnesses", "bound_max", "accuracy", "horizon",
        } <= set(whole["reference"])  # fmt: skip
        for witness in whole["reference"]["witnesses"]:
            assert {"solver", "tolerance", "difference"} <= set(witness)
        for row in whole["rows"]:
            assert {
                "stepper", "steps_per_frame", "dt", "status", "diverged_at", "error_final",
                "error_max", "error_rms", "resolved", "rhs_evaluations", "seconds",
            } <= set(row)  # fmt: skip
            if row["status"] == "diverged":
                assert row["diverged_at"] is not None
                assert row["error_max"] is None
            if not row["resolved"]:
                assert row["error_max"] is None
        for order in whole["orders"]:
            assert {
                "stepper", "expected", "observed", "ci95", "verdict", "used", "left_out",
            } <= set(order)  # fmt: skip
            assert all(set(point) == {"dt", "reason"} for point in order["left_out"])
            assert (order["observed"] is None) == (order["ci95"] is None)
    assert json.loads(FORMATS["json"](tables["cut"]))["reference"]["horizon"] is not None
    assert json.loads(FORMATS["json"](tables["rope"]))["reference"]["horizon"] is None
    rope = json.loads(FORMATS["json"](tables["rope"]))["problem"]["parameters"]
    assert rope["num_nodes"] == 4


def test_csv_is_read_back(tables):
    for table in tables.values():
        lines = list(csv.DictReader(io.StringIO(FORMATS["csv"](table))))
        assert len(lines) == len(table.rows)
        for line, row in zip(lines, table.rows, strict=True):
            assert line["stepper"] == row.stepper
            assert float(line["dt"]) == row.dt
            assert line["error_max"] == ("" if row.error_max is None else str(row.error_max))


class _Page(HTMLParser):
    def __init__(self):
        super().__init__()
        self.open, self.seen, self.text = [], [], []

    def handle_starttag(self, tag, attrs):
        self.seen.append(tag)
        if tag != "meta":
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def test_html_is_well_formed_and_safe(tables):
    for table in tables.values():
        page = _Page()
        page.feed(FORMATS["html"](table))
        assert not page.open
        assert page.seen.count("table") == 2
        assert "b" not in page.seen
        assert table.problem.name in "".join(page.text)


def test_markdown_tables_have_equal_columns(tables):
    for table in tables.values():
        lines = [line for line in FORMATS["markdown"](table).splitlines() if line.startswith("|")]
        columns = {len(re.findall(r"(?<!\\)\|", line)) for line in lines}
        # Orders have a cell more where theory stands beside them.
        with_theory = any(each.constant for each in table.orders)
        assert columns == ({9} if with_theory else {9, 8})


def test_latex_escapes(tables):
    text = FORMATS["latex"](tables["hostile"])
    title = next(line for line in text.splitlines() if line.startswith(r"\section"))
    assert r"100\% \& \$x\_1\$ \textbackslash{} \{\#\}" in title
    assert text.count(r"\begin{tabular}") == text.count(r"\end{tabular}") == 2


def has_booktabs() -> bool:
    """Whether there is a pdflatex that finds the package that tables need."""
    if not (shutil.which("pdflatex") and shutil.which("kpsewhich")):
        return False
    search = subprocess.run(["kpsewhich", "booktabs.sty"], capture_output=True, check=False)
    return search.returncode == 0


def test_latex_compiles(tables, tmp_path):
    if not has_booktabs():
        pytest.skip("there is no LaTeX with the package booktabs here")
    body = FORMATS["latex"](tables["hostile"]).replace("% needs", "%")
    (tmp_path / "t.tex").write_text(
        "\\documentclass{article}\\usepackage{booktabs}\\begin{document}\n"
        + body
        + "\\end{document}\n"
    )
    subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "t.tex"],
        cwd=tmp_path,
        check=True,
        capture_output=True,
    )


def test_every_stepper_is_in_the_list():
    for name, cls in STEPPERS.items():
        assert name in stepper_list()
        assert cls.source in stepper_list()


def test_the_list_gives_orders_on_the_problems_that_steppers_are_for():
    table = stepper_list().split("\n\n")[0]
    rows = {line.split()[0]: line.split()[1:] for line in table.splitlines()}
    assert rows["rattle"] == ["2", "2", "2", "yes"]
    assert rows["constraint-verlet:start=rest"] == ["1", "1", "0", "no"]
    assert rows["stormer-verlet:damping=per-step"] == ["2", "0", "0", "yes"]
    assert "    sweeps: 1, or more" in stepper_list().splitlines()


def test_runs_of_the_same_kind_have_columns_of_their_own():
    """Two witnesses differ only in how their rounding is moved."""
    times = np.arange(2.0)
    runs = [
        SimpleNamespace(role="rounding", solver="Dopri8", tolerance=1e-13, errors=times + k)
        for k in range(3)
    ]
    study: Any = SimpleNamespace(times=times, bound=times, runs=runs, lost=times)
    last = list(horizon_lines(study)[-1].items())[2:-1]
    name = "rounding Dopri8 1e-13"
    assert last == [(name, 1.0), (f"{name}, 2", 2.0), (f"{name}, 3", 3.0)]
