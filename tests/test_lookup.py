"""The pages to look things up in: what the package names is on them."""

from __future__ import annotations

import json
import re
import runpy
from pathlib import Path

import pytest

import ropeode

ROOT = Path(__file__).parents[1]
REFERENCE = ROOT / "docs/reference"


def text_of(page: str) -> str:
    return (REFERENCE / f"{page}.md").read_text()


@pytest.fixture(scope="module")
def lookup():
    return runpy.run_path(str(ROOT / "docs/lookup.py"))


def test_pages_have_what_the_package_says(lookup):
    again = "run: cd docs && cog -P -r -I . reference/{schemas,steppers,problems}.md"
    for page, parts in {
        "steppers": [lookup["stepper_orders"](), lookup["steppers"]()],
        "problems": [lookup["problem_list"](), lookup["problems"]()],
        "schemas": [lookup["schema_keys"](file.stem) for file in (ROOT / "docs/schemas").iterdir()],
    }.items():
        for part in parts:
            assert part in text_of(page), again


def test_every_value_of_a_schema_is_described():
    described = text_of("schemas")
    for file in (ROOT / "docs/schemas").iterdir():
        for values in re.findall(r'"enum": \[(.*?)\]', file.read_text(), re.S):
            for value in json.loads(f"[{values}]"):
                assert f"`{value}`" in described, (file.name, value)


def test_every_picture_is_in_the_gallery():
    text = (ROOT / "docs/gallery/index.md").read_text()
    code = "".join(re.findall(r"^```python\n(.*?)^```", text, re.M | re.S))
    drawing = [name for name in ropeode.__all__ if name.startswith("plot_") or name == "animate"]
    assert len(drawing) >= 7
    assert [name for name in drawing if f"{name}(" not in code] == []
