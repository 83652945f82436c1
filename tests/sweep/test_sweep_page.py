"""docs/reference/sweep-spec.md says what the schema says."""

import re
import tomllib
from pathlib import Path

from ropeode.sweep import INPUTS, RESULTS, STATUSES, Distribution, SweepSpec

PAGE = (Path(__file__).parents[2] / "docs/reference/sweep-spec.md").read_text()


def test_every_column_and_status_is_described():
    rows = re.findall(r"^\| `(.+?)` \| (\w+) \| (.+) \|$", PAGE, re.MULTILINE)
    assert rows == [(name, *column) for name, column in (INPUTS | RESULTS).items()]
    rows = re.findall(r"^\| `([a-z-]+)` \| ([^|]+) \|$", PAGE, re.MULTILINE)
    assert rows == list(STATUSES.items())


def test_every_word_of_a_spec_is_described():
    fields = type(SweepSpec({"grid": {"damping": [0.1]}}).fields)
    for name in {*fields.model_fields, *Distribution.model_fields, "seeds", "count"}:
        assert name in PAGE


def test_the_example_has_as_many_cases_as_it_says():
    text = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)[0]
    assert SweepSpec(tomllib.loads(text)).count == 7200
    assert "7200 cases" in PAGE
