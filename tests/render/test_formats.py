"""What formats do to what they are given; `test_golden.py` holds how results look in each."""

from __future__ import annotations

import dataclasses
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET

import pytest

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
from tests.render.made_up import MADE_UP, table_of


def test_formats_are_listed_on_the_command_line():
    assert list(LISTED) == list(FORMATS)


def test_a_page_is_well_formed_and_holds_a_picture():
    text = format_table(MADE_UP["hostile"](), "html")
    # Of HTML's elements without an end this is the only one.
    page = ET.fromstring(re.sub("<!DOCTYPE html>|<meta [^>]*>", "", text, flags=re.IGNORECASE))
    seen = [each.tag.rpartition("}")[2] for each in page.iter()]
    assert seen.count("svg") == 1
    # What others named is text, and nothing from outside is asked for.
    assert "b" not in seen
    assert not re.search(r"""(src|href)\s*=\s*["'](?!#)|url\((?!#)|@import""", text)


def test_a_cell_does_not_end_at_a_sign_of_the_format():
    blocks = [Heading("t"), Grid(["a"], [["x|y<z"]], left=frozenset({0}))]
    assert r"x\|y&lt;z" in markdown(blocks)
    assert "x|y&lt;z" in html_page(blocks)


def test_latex_escapes():
    assert r"a$|$b $<$c$>$ \textasciitilde{}\textasciicircum{}''" in (
        latex_part([Paragraph('a|b <c> ~^"')])
    )
    assert r"$-2.0 \times 10^{-5}$ of $1 \times 10^{56}$, $< 3.1 \times 10^{-10}$, x2e5" in (
        latex_part([Paragraph("-2.0e-05 of 1e+56, < 3.1e-10, x2e5")])
    )


def test_the_layout_of_latex():
    table = MADE_UP["accuracy-table"]()
    columns = ["final-error", "seconds"]
    text = format_table(table, "latex", columns=columns, caption=r"$\Delta t$", label="t:a")
    assert "\\caption{$\\Delta t$}\n\\label{t:a}\n" in text
    assert [line for line in text.splitlines() if "emph" in line] == [
        r"\emph{final error}\\[1ex]",
        r"\emph{seconds}\\[1ex]",
    ]
    for form, given, words in (
        ("latex", {"columns": ["order"]}, "column: 'order' given, which does not exist"),
        ("latex", {"label": "a b"}, "label: 'a b' given"),
        ("csv", {"caption": "a"}, "format: 'csv' given; allowed: latex, with caption"),
    ):
        with pytest.raises(InputError, match=words):
            format_table(table, form, **given)


def has_latex() -> bool:
    """Whether there is a pdflatex that finds what tables and slides need."""
    if not (shutil.which("pdflatex") and shutil.which("kpsewhich")):
        return False
    needed = ["kpsewhich", "booktabs.sty", "beamer.cls", "pgfmath.sty"]
    return subprocess.run(needed, capture_output=True, check=False).returncode == 0


def grid_of(table):
    """Its runs, whose steppers may be broken into lines."""
    rows = [(row.stepper, f"{row.dt:g}", f"{row.resolution:.1e}") for row in table.rows]
    return Grid(("stepper", "dt", "resolution"), rows, frozenset({0}), frozenset({0}))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["article", "beamer"])
def test_latex_compiles_and_is_no_wider_than_the_page(kind, tmp_path):
    if not has_latex():
        pytest.skip("there is no LaTeX with booktabs and beamer here")

    def renamed(each, number):
        name = f"a_stepper.py:with_a_long_name&more%{number}{each.stepper}"
        return dataclasses.replace(each, stepper=name)

    rope = MADE_UP["accuracy-table"]()
    many = table_of(
        [renamed(row, number) for number in range(3) for row in rope.rows],
        [renamed(order, number) for number in range(3) for order in rope.orders],
    )
    texts = [format_table(each, "latex") for each in (rope, MADE_UP["hostile"](), many)]
    # Of documents with tables of all kinds, in the way of the other results.
    texts += [latex_part([Paragraph(many.problem.name), grid_of(many), grid_of(rope)])]
    frames = "\n".join(f"\\begin{{frame}}\n{each}\\end{{frame}}" for each in texts)
    (tmp_path / "t.tex").write_text(
        f"\\documentclass{{{kind}}}\\usepackage{{booktabs}}\\begin{{document}}\n"
        + (frames if kind == "beamer" else "\n".join(texts))
        + "\\end{document}\n"
    )
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "t.tex"]
    done = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:]
    assert not [line for line in done.stdout.splitlines() if "Overfull \\hbox" in line]
