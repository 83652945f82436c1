"""What the documentation shows: its code runs, its links lead somewhere, its figures hold."""

from __future__ import annotations

import ast
import contextlib
import io
import re
from pathlib import Path

import pytest
from matplotlib import pyplot

from ropeode import accuracy_table
from ropeode.analysis import REASONS
from ropeode.problems import Rope
from ropeode.render import format_table
from tests.sampled import sampled

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
EVERY = sorted(ROOT.glob("docs/**/*.md"))
# Not those that only include a page beside docs/.
DOCS = [page for page in EVERY if not page.read_text().startswith("```{")]
PAGES = [README, ROOT / "README.zh.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *DOCS]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
# Code and the text that it prints, as a block right behind it; and as a comment behind a line.
EXAMPLE = re.compile(r"^```python\n(.*?)^```\n\n```text\n(.*?)^```", re.MULTILINE | re.DOTALL)
PRINTED = re.compile(r"^print\(.*\)  # (.*)$", re.MULTILINE)
# Pages in two languages, and what begins a comment, which is in that of the page.
CHINESE = [
    (README, ROOT / "README.zh.md"),
    *(
        (ROOT / "docs/tutorials" / page.name, page)
        for page in sorted(ROOT.glob("docs/zh/*.md"))
        if FENCE.search(page.read_text())
    ),
]
IMPORTS = ast.Import | ast.ImportFrom
COMMENTS = {"sh": "#", "cpp": "//"}


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


@pytest.mark.parametrize("page", WITH_CODE, ids=page_id)
def test_code_imports_what_exists(page):
    for code in blocks(page, "python"):
        imports = [each for each in ast.parse(code).body if isinstance(each, IMPORTS)]
        exec(compile(ast.Module(imports, []), str(page), "exec"), {})


@pytest.fixture
def no_windows(monkeypatch):
    """What `plt.show()` would show is drawn instead, and closed: no page leaves figures open."""

    def draw():
        for number in pyplot.get_fignums():
            pyplot.figure(number).canvas.draw()
        pyplot.close("all")

    pyplot.switch_backend("Agg")
    monkeypatch.setattr(pyplot, "show", draw)


# Pages other than README run what has tests of its own, and take up to ten seconds each.
@pytest.mark.parametrize("page", sampled(WITH_CODE, [README]), ids=page_id)
@pytest.mark.usefixtures("same_jax_settings", "no_windows")
def test_code_runs_and_prints_what_it_says(page, tmp_path, monkeypatch):
    # What it writes, a reader finds in the folder that they are in.
    monkeypatch.chdir(tmp_path)
    namespace = {"__name__": "docs"}
    shown = dict(EXAMPLE.findall(page.read_text()))
    for code in blocks(page, "python"):
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            exec(compile(code, str(page), "exec"), namespace)
        if promised := PRINTED.findall(code):
            assert out.getvalue().splitlines()[: len(promised)] == promised
        if code in shown:
            assert out.getvalue() == shown[code]


def meaning(language: str, code: str) -> str:
    """A block without its comments, and without what the assertions of Python say."""
    if language != "python":
        mark = COMMENTS.get(language)
        return re.sub(rf"\s*{mark}.*", "", code) if mark else code
    tree = ast.parse(code)
    for node in ast.walk(tree):
        if isinstance(node, ast.Assert):
            node.msg = None
    return ast.dump(tree)


@pytest.mark.parametrize(("english", "chinese"), CHINESE, ids=page_id)
def test_chinese_pages_have_the_code_of_the_english_ones(english, chinese):
    first, second = (
        [(language, meaning(language, code)) for language, code in FENCE.findall(page.read_text())]
        for page in (english, chinese)
    )
    assert first == second


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_a_page_has_one_title_closes_its_blocks_and_links_somewhere(page):
    assert len(re.findall(r"^# ", prose(page), re.MULTILINE)) == 1
    assert len(re.findall(r"^```", page.read_text(), re.MULTILINE)) % 2 == 0
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if "://" in target:
            continue
        file, _, anchor = target.partition("#")
        goal = page.parent / file if file else page
        assert goal.exists(), target
        assert ROOT in [goal.resolve(), *goal.resolve().parents], f"{target} leads out of here"
        assert not anchor or anchor in headings(goal), target


def test_every_page_is_listed_in_the_index_above_it():
    for page in {*EVERY} - {ROOT / "docs/index.md"}:
        above = page.parents[1:] if page.name == "index.md" else page.parents
        index = next(folder / "index.md" for folder in above if (folder / "index.md").exists())
        listed = re.findall(r"^- \[[^\]]+\]\(([^)#]+)\)", index.read_text(), re.MULTILINE)
        assert str(page.relative_to(index.parent)) in listed, page


def test_nobody_is_sent_to_a_package_index():
    """ropeode is not published there: `pip install '.[plots]'` works, 'ropeode[plots]' does not."""
    for path in [*PAGES, *ROOT.glob("ropeode/**/*.py"), *ROOT.glob("benchmarks/**/*.py")]:
        assert not re.search(r"pip install \S*ropeode", path.read_text()), path


def test_pages_show_the_files():
    shown = {code for page in DOCS for _, code in FENCE.findall(page.read_text())}
    for name in ("pendulum.py", "heun3.toml", "steps.py"):
        assert (ROOT / "docs/examples" / name).read_text() in shown, name


def rows_of(text: str) -> dict[tuple[str, str], list[str]]:
    """The words of each row of a table, by its stepper and its steps per frame."""
    found, stepper = {}, ""
    for line in text.partition("Observed orders")[0].splitlines():
        words = line.replace("< ", "<").split()
        if line[:1].strip():
            stepper = line
        elif words and words[0].isdigit():
            found[stepper, words[0]] = words
    return found


@pytest.mark.slow
def test_the_page_on_the_table_shows_it():
    """Its errors to two digits, where they are not made of amplified rounding."""
    # The default rope at the coarser half of the default step sizes.
    table = accuracy_table(Rope().problem(frames=20), steps_per_frame=(16, 128, 256, 512, 1024))
    page = blocks(ROOT / "docs/reference/table.md", "text")
    shown = rows_of(next(block for block in page if block.startswith("Accuracy of")))
    found = rows_of(format_table(table))
    assert len(shown.keys() & found.keys()) >= 10
    for key in shown.keys() & found.keys():
        (_, _, one, *_, evaluations, _), (_, _, other, *_, again, _) = shown[key], found[key]
        assert (one[0] == "<", evaluations) == (other[0] == "<", again)
        values = [min(float(each.lstrip("<")), 100.0) for each in (one, other)]
        assert values[0] == pytest.approx(values[1], rel=0.5 if one[0] == "<" else 0.01)


def test_every_reason_is_described():
    text = (ROOT / "docs/reference/table.md").read_text()
    for reason in REASONS:
        assert f"**{reason}**" in text
