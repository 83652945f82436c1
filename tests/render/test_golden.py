"""Every kind of result in every format, held by files that a reviewer reads."""

from __future__ import annotations

import re

import pytest

import ropeode
from ropeode.errors import InputError
from ropeode.terminal import FORMATS
from tests.golden import check_golden
from tests.render.made_up import MADE_UP
from tests.schemas import assert_conforms

WRITTEN_BY = {
    "accuracy-table": ropeode.format_table,
    "check": ropeode.format_check,
    "explain": ropeode.format_explanation,
    "horizon": ropeode.format_horizon,
    "hostile": ropeode.format_table,
    "report": ropeode.format_report,
    "work-precision": ropeode.format_work_precision,
}


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("name", WRITTEN_BY)
def test_every_format_is_that_of_its_file(name, form):
    text = WRITTEN_BY[name](MADE_UP[name](), form)
    assert text.endswith("\n")
    if form == "text":
        assert max(map(len, text.splitlines())) <= 80
    if form == "json":
        assert_conforms(text)
    check_golden(name + FORMATS[form], re.sub(r"<svg.*?</svg>", words_of, text, flags=re.DOTALL))


def words_of(picture):
    """How it is drawn, is a matter of matplotlib; here is what its points say to a pointer."""
    titles = re.findall(r"<title>.*?</title>", picture[0], flags=re.DOTALL)
    return "\n".join(["<svg>", *titles, "</svg>"])


@pytest.mark.parametrize("name", MADE_UP)
def test_what_a_notebook_shows_is_that_of_its_file(name):
    result = MADE_UP[name]()
    check_golden(f"{name}.notebook.md", f"{result!r}\n\n{result._repr_markdown_()}")


@pytest.mark.parametrize("name", WRITTEN_BY)
def test_a_format_that_does_not_exist_is_refused(name):
    with pytest.raises(InputError, match="format: 'htm' given.*did you mean 'html'"):
        WRITTEN_BY[name](MADE_UP[name](), "htm")
