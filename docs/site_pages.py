"""What the site makes of the pages beyond Markdown, as an extension of Sphinx.

The pages are plain Markdown, for a reader of the repository. Here tutorials become notebooks that
are run, scenes of the lab that they name can be played in the page, the pages that an index lists
become its table of contents, and the files beside docs/ get a place in the site.
"""

from __future__ import annotations

import posixpath
import re
from typing import Any

from sphinx.application import Sphinx

from tools.site_scenes import NAMED

_NOTEBOOK = """---
file_format: mystnb
kernelspec:
  name: python3
---
"""
_NOTEBOOKS = re.compile(r"(tutorials|zh)/")
_CODE = re.compile(r"^```python\n", re.MULTILINE)
# A page, as docstrings name it.
_PAGE = re.compile(r"\bdocs/([\w/-]+)\.md\b")
# Files beside docs/, which are pages of the site under other names.
_OUTSIDE = {
    "README": "index",
    "README.zh": "zh/index",
    "CONTRIBUTING": "contributing",
    "CHANGELOG": "changelog",
}
_NAMES = "|".join(map(re.escape, _OUTSIDE))
_LINK_OUT = re.compile(rf"\]\(((?:\.\./)+)({_NAMES})\.md(#[\w-]+)?\)")
# A page that an item of a list begins with.
_LISTED = re.compile(r"^- \[([^\]]+)\]\(([\w./-]+)\.(?:md|ipynb)\)", re.MULTILINE)


def as_page(docname: str, text: str) -> str:
    """The source of a page of the site, from that of a page of the repository."""
    text = _LINK_OUT.sub(_inside, text)
    if _NOTEBOOKS.match(docname) and _CODE.search(text):
        text = _NOTEBOOK + _with_scenes(_CODE.sub("```{code-cell} python\n", text))
    if posixpath.basename(docname) == "index":
        text += _contents(_LISTED.findall(text))
    return text


def _contents(pages: list[tuple[str, str]]) -> str:
    entries = [f"{words} <{path}>" for words, path in pages if not path.startswith("..")]
    listed = "\n".join(dict.fromkeys(entries))
    return f"\n\n```{{toctree}}\n:hidden:\n\n{listed}\n```\n" if listed else ""


def _inside(link: re.Match[str]) -> str:
    up, name, anchor = link[1], link[2], link[3] or ""
    kept = "" if name.startswith("README") else anchor
    return f"]({up.removesuffix('../')}{_OUTSIDE[name]}.md{kept})"


def _with_scenes(text: str) -> str:
    """Behind each paragraph that names scenes of the lab, these scenes."""
    paragraphs = text.split("\n\n")
    for index, paragraph in enumerate(paragraphs):
        for name in NAMED.findall(paragraph):
            paragraphs[index] += (
                f'\n\n```{{raw}} html\n<iframe class="lab" loading="lazy" title="The lab: {name}" '
                f'src="../lab/{name}.html"></iframe>\n```'
            )
    return "\n\n".join(paragraphs)


def _read(app: Sphinx, docname: str, source: list[str]) -> None:
    source[0] = as_page(docname, source[0])


def _in_its_language(
    app: Sphinx, page: str, template: str, context: dict[str, Any], document: Any
) -> None:
    if page.startswith("zh/"):
        context["language"] = "zh"


def _escape(app: Sphinx, context: Any, lines: list[str]) -> None:
    """`click` help is plain text: `*.csv` is no emphasis; what stands between backticks is code."""
    for index, line in enumerate(lines):
        if not line.lstrip().startswith(".."):
            parts = line.split("`")
            parts[::2] = [part.replace("*", r"\*") for part in parts[::2]]
            lines[index] = "`".join(parts)


def _link(app: Sphinx, what: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
    """A docstring that names a page leads there."""
    lines[:] = [_PAGE.sub(r":doc:`/\1`", line) for line in lines]


def setup(app: Sphinx) -> dict[str, Any]:
    """Have Sphinx call what is here."""
    app.connect("source-read", _read)
    app.connect("html-page-context", _in_its_language)
    app.connect("autodoc-process-docstring", _link)
    for part in ("description", "options", "arguments", "epilog"):
        app.connect(f"sphinx-click-process-{part}", _escape)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
