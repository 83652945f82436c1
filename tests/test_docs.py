"""What the documentation shows: its code runs, its links lead somewhere, its figures hold."""

from __future__ import annotations

import ast
import contextlib
import io
import re
import runpy
from pathlib import Path

import pytest

from ropeode.analysis import order
from ropeode.problems.rope import Rope
from ropeode.study.accuracy_table import accuracy_table

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
DOCS = sorted(ROOT.glob("docs/**/*.md"))
PAGES = [README, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *DOCS]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
# The text that a line of code prints, as a comment behind it.
PRINTED = re.compile(r"^print\(.*\)  # (.*)$", re.MULTILINE)


def page_id(page: Path) -> str:
    return str(page.relative_to(ROOT))


def blocks(page: Path, language: str) -> list[str]:
    return [code for kind, code in FENCE.findall(page.read_text()) if kind == language]


def prose(page: Path) -> str:
    return FENCE.sub("", page.read_text())


def headings(page: Path) -> set[str]:
    """The anchors that headings make, as GitHub and MyST do."""
    titles = re.findall(r"^#+ (.*)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


WITH_CODE = [page for page in PAGES if blocks(page, "python")]
# The others run what has tests of its own, and take up to ten seconds each.
QUICK = {"README.md"}


@pytest.mark.parametrize("page", WITH_CODE, ids=page_id)
def test_code_imports_what_exists(page):
    for code in blocks(page, "python"):
        imports = [
            node for node in ast.parse(code).body if isinstance(node, ast.Import | ast.ImportFrom)
        ]
        exec(compile(ast.Module(imports, []), str(page), "exec"), {})


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=[] if page_id(page) in QUICK else [pytest.mark.slow])
        for page in WITH_CODE
    ],
    ids=page_id,
)
@pytest.mark.usefixtures("same_jax_settings")
def test_code_runs_and_prints_what_it_says(page, tmp_path, monkeypatch):
    # What it writes, a reader finds in the folder that they are in.
    monkeypatch.chdir(tmp_path)
    namespace = {"__name__": "docs"}
    for code in blocks(page, "python"):
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            exec(compile(code, str(page), "exec"), namespace)
        if promised := PRINTED.findall(code):
            assert out.getvalue().splitlines()[: len(promised)] == promised


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if "://" in target:
            continue
        file, _, anchor = target.partition("#")
        goal = page.parent / file if file else page
        assert goal.exists(), target
        assert ROOT in [goal.resolve(), *goal.resolve().parents], f"{target} leads out of here"
        assert not anchor or anchor in headings(goal), target


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_pages_have_one_title(page):
    assert len(re.findall(r"^# ", prose(page), re.MULTILINE)) == 1


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_fences_are_closed(page):
    assert len(re.findall(r"^```", page.read_text(), re.MULTILINE)) % 2 == 0


def test_every_page_is_in_the_index():
    index = ROOT / "docs/index.md"
    for page in DOCS:
        assert page == index or f"({page.relative_to(index.parent)})" in index.read_text(), page


def test_the_picture_of_the_rooms_is_that_of_the_imports():
    rooms = runpy.run_path(str(ROOT / "docs/rooms.py"))
    shown = (ROOT / "CONTRIBUTING.md").read_text()
    assert rooms["picture"]() in shown, "run: cd docs && cog -P -r -I . ../CONTRIBUTING.md"


def test_a_picture_has_a_line_for_each_import_that_no_other_way_replaces():
    rooms = runpy.run_path(str(ROOT / "docs/rooms.py"))
    imports = {"a": {"b", "c", "d"}, "b": {"d"}, "c": {"d"}, "d": set(), "e": {"c"}}
    reduced = rooms["reduced"](imports)
    assert reduced == {"a": {"b", "c"}, "b": {"d"}, "c": {"d"}, "d": set(), "e": {"c"}}
    drawn = " / ".join(rooms["drawn"](reduced))
    assert drawn == "● e / │ ● a / │ ├─╮ / ├─┼─╯ / ● │ c / │ ● b / ├─╯ / ● d"


def test_nobody_is_sent_to_a_package_index():
    """ropeode is not published there: `pip install '.[plots]'` works, 'ropeode[plots]' does not."""
    for path in [*PAGES, *ROOT.glob("ropeode/**/*.py"), *ROOT.glob("benchmarks/**/*.py")]:
        assert not re.search(r"pip install \S*ropeode", path.read_text()), path


def test_readme_has_the_commands_and_a_ten_line_example():
    text = README.read_text()
    assert "make table" in text.split("```")[1]
    assert "make test" in text.split("```")[1]
    example = blocks(README, "python")[1]
    assert len([line for line in example.splitlines() if line]) <= 10
    for name in ("Rope", "simulate", "reference", "error_series", "accuracy_table"):
        assert f"{name}(" in example


@pytest.mark.parametrize("name", ["pendulum.py", "steps.py"])
def test_readme_shows_the_files(name):
    assert (ROOT / "docs/examples" / name).read_text() in blocks(README, "python")


@pytest.mark.slow
def test_readme_shows_the_table():
    """Its errors to two digits, where they are not made of amplified rounding."""
    # The default rope at the coarser half of the default step sizes.
    table = accuracy_table(Rope().problem(frames=20), steps_per_frame=(16, 128, 256, 512, 1024))
    shown = next(block for block in blocks(README, "text") if block.startswith("Accuracy of"))
    rows = {(row.stepper, row.steps_per_frame): row for row in table.rows}
    labels = {row.stepper for row in table.rows}
    stepper, checked = "", 0
    for line in shown.partition("Observed orders")[0].splitlines():
        words = line.split()
        if line in labels:
            stepper = line
        elif stepper and words and words[0].isdigit() and (stepper, int(words[0])) in rows:
            row = rows[stepper, int(words[0])]
            checked += 1
            if words[2] == "<":
                assert row.error_max is None
                assert float(words[3]) == pytest.approx(row.resolution, rel=0.5)
            elif float(words[2]) < 100:
                assert float(words[2]) == pytest.approx(row.error_max, rel=0.01)
            else:
                assert row.error_max > 100
            assert int(words[-2]) == row.rhs_evaluations
    assert checked >= 10


def test_every_reason_is_described():
    text = (ROOT / "docs/reference/table.md").read_text()
    for name, reason in vars(order).items():
        if name.isupper() and isinstance(reason, str):
            assert f"**{reason}**" in text
