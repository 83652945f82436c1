"""Every format, of tables that hold all that a table can hold."""

from __future__ import annotations

import csv
import dataclasses
import functools
import io
import json
import re
import shutil
import subprocess
from html.parser import HTMLParser

import numpy as np
import pytest

from ropeode import Problem, accuracy_table
from ropeode.errors import InputError
from ropeode.render import (
    FORMATS,
    Grid,
    Heading,
    Paragraph,
    format_table,
    html_page,
    latex_part,
    markdown,
)
from ropeode.terminal import FORMATS as LISTED
from tests.quartic import HOSTILE
from tests.schemas import assert_conforms


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


@pytest.fixture(scope="module")
def written(tables):
    """Each table in each format, written once."""
    return functools.cache(lambda case, form: FORMATS[form](tables[case]))


@pytest.mark.parametrize("case", ["rope", "long names", "hostile", "cut"])
@pytest.mark.parametrize("form", FORMATS)
def test_every_format_holds_the_findings(form, case, tables, written):
    table = tables[case]
    text = written(case, form)
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
        text = FORMATS["json"](table)
        assert_conforms(text)
        whole = json.loads(text, parse_constant=pytest.fail)
        assert whole["schema"] == "ropeode.accuracy-table/1"
        for row in whole["rows"]:
            if row["status"] == "diverged":
                assert row["diverged_at"] is not None
                assert row["error_max"] is None
            if not row["resolved"]:
                assert row["error_max"] is None
        for order in whole["orders"]:
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


def test_html_is_well_formed_and_safe_and_holds_the_plot(tables, written):
    for case, table in tables.items():
        page = _Page()
        page.feed(written(case, "html"))
        assert page.seen.count("svg") == 1
        assert not page.open
        assert page.seen.count("table") == 2
        assert "b" not in page.seen
        assert table.problem.name in "".join(page.text)


@pytest.mark.parametrize("case", ["rope", "hostile"])
def test_each_error_stands_under_its_header(case, tables, written):
    """The last error of the rope is the largest; that of the other case is not."""
    rows = tables[case].rows
    lines = [line for line in written(case, "markdown").splitlines() if line.startswith("|")]
    headers, _, *runs = (re.split(r" *\| *", line)[1:-1] for line in lines[: 2 + len(rows)])
    for row, cells in zip(rows, runs, strict=True):
        run = dict(zip(headers, cells, strict=True))
        assert (run["stepper"], int(run["steps/frame"])) == (row.stepper, row.steps_per_frame)
        if row.status == "ok":
            for name in ("max", "final", "rms"):
                error = getattr(row, f"error_{name}")
                below = f"&lt; {row.resolution:.1e}"
                assert run[f"{name} error"] == (below if error is None else f"{error:.3e}")
    errors = [row.error_final != row.error_max for row in rows]
    assert any(errors) == (case == "hostile")


def test_a_cell_does_not_end_at_a_sign_of_the_format():
    blocks = [Heading("t"), Grid(["a"], [["x|y<z"]], left=frozenset({0}))]
    assert r"x\|y&lt;z" in markdown(blocks)
    assert "x|y&lt;z" in html_page(blocks)


def test_markdown_tables_have_equal_columns(tables):
    for table in tables.values():
        lines = [line for line in FORMATS["markdown"](table).splitlines() if line.startswith("|")]
        columns = {len(re.findall(r"(?<!\\)\|", line)) for line in lines}
        # Orders have a cell more where theory stands beside them.
        with_theory = any(each.constant for each in table.orders)
        assert columns == ({9} if with_theory else {9, 8})


def test_latex_is_a_fragment_with_step_sizes_down_and_steppers_across(written, tables):
    table = tables["rope"]
    lines = written("rope", "latex").splitlines()
    assert lines[0] == r"% In the preamble: \usepackage{booktabs}"
    assert not any(r"\section" in line or "documentclass" in line for line in lines)
    first, rk4 = table.rows[0], next(row for row in table.rows if row.stepper == "rk4")
    (row,) = (line for line in lines if line.startswith(f"1/{first.steps_per_frame} &"))
    digits, power = f"{first.error_max:.1e}".split("e")
    assert row.split(" & ")[1] == rf"${digits} \times 10^{{{int(power)}}}$"
    assert len(row.split(" & ")) == 1 + len(table.orders)
    below = next(line for line in lines if line.startswith("order & "))
    for cell, each in zip(below[:-3].split(" & ")[1:], table.orders, strict=True):
        assert cell == (f"{each.order.observed:.2f}" if each.order.observed else each.order.verdict)
    assert rk4 in table.rows


def test_latex_escapes(written):
    caption = next(x for x in written("hostile", "latex").splitlines() if "caption" in x)
    assert r"100\% \& \$x\_1\$ \textbackslash{} \{\#\}" in caption
    assert r"a$|$b $<$c$>$ \textasciitilde{}\textasciicircum{}''" in (
        latex_part([Paragraph('a|b <c> ~^"')])
    )
    assert r"$-2.0 \times 10^{-5}$ of $1 \times 10^{56}$, $< 3.1 \times 10^{-10}$, x2e5" in (
        latex_part([Paragraph("-2.0e-05 of 1e+56, < 3.1e-10, x2e5")])
    )


def test_the_layout_of_latex(tables):
    columns = ["final-error", "seconds"]
    text = format_table(
        tables["rope"], "latex", columns=columns, caption=r"$\Delta t$", label="t:a"
    )
    assert "\\caption{$\\Delta t$}\n\\label{t:a}\n" in text
    assert [line for line in text.splitlines() if "emph" in line] == [
        r"\emph{final error}\\[1ex]",
        r"\emph{seconds}\\[1ex]",
    ]
    with pytest.raises(InputError, match="column: 'order' given, which does not exist"):
        format_table(tables["rope"], "latex", columns=["order"])
    with pytest.raises(InputError, match="label: 'a b' given"):
        format_table(tables["rope"], "latex", label="a b")
    with pytest.raises(InputError, match="format: 'csv' given; allowed: latex, with caption"):
        format_table(tables["rope"], "csv", caption="a")


def has_latex() -> bool:
    """Whether there is a pdflatex that finds what tables and slides need."""
    if not (shutil.which("pdflatex") and shutil.which("kpsewhich")):
        return False
    needed = ["kpsewhich", "booktabs.sty", "beamer.cls", "pgfmath.sty"]
    found = subprocess.run(needed, capture_output=True, check=False, text=True)
    return len(found.stdout.splitlines()) == len(needed) - 1


def grid_of(table):
    """Its runs, whose steppers may be broken into lines."""
    rows = [(row.stepper, f"{row.dt:g}", f"{row.resolution:.1e}") for row in table.rows]
    return Grid(("stepper", "dt", "resolution"), rows, frozenset({0}), frozenset({0}))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["article", "beamer"])
def test_latex_compiles_and_is_no_wider_than_the_page(kind, tables, written, tmp_path):
    if not has_latex():
        pytest.skip("there is no LaTeX with booktabs and beamer here")
    long = "a_stepper.py:with_a_long_name&more%"
    rope = tables["rope"]
    rows = [
        dataclasses.replace(row, stepper=f"{long}{n}{row.stepper}")
        for n in range(3)
        for row in rope.rows
    ]
    orders = [
        dataclasses.replace(each, stepper=f"{long}{n}{each.stepper}")
        for n in range(3)
        for each in rope.orders
    ]
    many = dataclasses.replace(rope, rows=tuple(rows), orders=tuple(orders))
    texts = [*(written(case, "latex") for case in tables), FORMATS["latex"](many)]
    # Of documents with tables of all kinds, in the way of the other results.
    texts += [latex_part([Paragraph(many.problem.name), grid_of(many), grid_of(rope)])]
    frames = "\n".join(f"\\begin{{frame}}\n{each}\\end{{frame}}" for each in texts)
    (tmp_path / "t.tex").write_text(
        f"\\documentclass{{{kind}}}\\usepackage{{booktabs}}\\begin{{document}}\n"
        + (frames if kind == "beamer" else "\n".join(texts))
        + "\\end{document}\n"
    )
    done = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "t.tex"],
        cwd=tmp_path,
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout[-2000:]
    assert not [line for line in done.stdout.splitlines() if "Overfull \\hbox" in line]
