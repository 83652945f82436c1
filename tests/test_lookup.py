"""The pages to look things up in: what the package names is on them."""

from __future__ import annotations

import functools
import inspect
import json
import re
import runpy
import tomllib
import unicodedata
from pathlib import Path

import pytest

import ropeode
from ropeode.problems import PROBLEMS
from ropeode.steppers import STEPPERS

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


# ---- bibliography


def plain(text: str) -> str:
    """Without accents and emphasis, on one line."""
    letters = unicodedata.normalize("NFKD", text.replace("ø", "o").replace("*", ""))
    return " ".join("".join(c for c in letters if not unicodedata.combining(c)).split())


@functools.cache
def works() -> list[tuple[str, str, str]]:
    """The first author, the year and the title of each work of the bibliography."""
    entry = re.compile(r"^\*\*([^,*]+)[^*]*\*\* \((\d+)\)\. ([^.]+?)(?:\.|, \d\w\w edition)", re.M)
    whole = re.sub(r"(?<!\n)\n(?!\n)", " ", text_of("bibliography"))
    return [(plain(who), year, plain(what)) for who, year, what in entry.findall(whole)]


def cited(source: str) -> list[str]:
    """The works that a source names, as it names them."""
    source = plain(source).replace("ODEs", "Ordinary Differential Equations")
    pieces = re.split(r"; |, after |: (?=[A-Z]\w+,)| one of ", source)
    return [piece for piece in pieces if re.match(r"[A-Z]", piece)]


def missing(source: str) -> list[str]:
    """The works that a source names and the bibliography has not."""
    return [
        piece
        for piece in cited(source)
        if not any(
            re.search(rf"\b{who}\b", piece)
            and (f"{year}" in piece or re.search(rf"\b{re.escape(what)}\b", piece, re.I))
            for who, year, what in works()
        )
    ]


def sources() -> dict[str, str]:
    """What steppers, problems, recipes and functions give as their sources."""
    found = {name: each.source for name, each in STEPPERS.items()}
    for name, documented in {**STEPPERS, **PROBLEMS}.items():
        found[f"{name}, described"] = inspect.getdoc(documented).partition("\nSource: ")[2]
        # Ropes refer to no book.
        assert found[f"{name}, described"] or name.endswith("rope"), name
    for recipe in ROOT.glob("reference/*.toml"):
        published = tomllib.loads(recipe.read_text()).get("published")
        found[recipe.name] = published["source"] if published else ""
    for file in (ROOT / "ropeode").rglob("*.py"):
        paragraphs = re.findall(
            r'^ *Sources?: (.*?)(?:\n *\n|"""|\n *\w+:\n)', file.read_text(), re.S | re.M
        )
        found |= {f"{file.name}, {n}": words for n, words in enumerate(paragraphs)}
    return {name: words.partition("\n\n")[0] for name, words in found.items() if words}


def test_the_bibliography_is_read_and_in_order():
    assert ("Verlet", "1967", 'Computer "experiments" on classical fluids') in works()
    assert len(works()) == len(re.findall(r"^\*\*", text_of("bibliography"), re.M))
    absent = "Hairer, Wanner, Solving Ordinary Differential Equations III, section 1"
    assert missing(f"{absent}; Verlet, Phys. Rev. 159 (1967)") == [absent]
    first = [who.lower() for who, *_ in works()]
    assert first == sorted(first)


def test_every_source_is_in_the_bibliography():
    named = sources()
    assert len(named) > 2 * len(STEPPERS) + len(PROBLEMS)
    assert {name: missing(words) for name, words in named.items() if missing(words)} == {}


# ---- glossary


# ---- gallery


def test_every_picture_is_in_the_gallery():
    text = (ROOT / "docs/gallery/index.md").read_text()
    code = "".join(re.findall(r"^```python\n(.*?)^```", text, re.M | re.S))
    drawing = [name for name in ropeode.__all__ if name.startswith("plot_") or name == "animate"]
    assert len(drawing) >= 7
    assert [name for name in drawing if f"{name}(" not in code] == []
