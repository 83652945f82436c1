"""CITATION.cff, by the rules of the Citation File Format 1.2.0 for what it has."""

from __future__ import annotations

import tomllib
from pathlib import Path

import yaml

import ropeode

ROOT = Path(__file__).parents[1]
# Required by https://github.com/citation-file-format/citation-file-format; and of its other keys
# those that describe this package without a release.
REQUIRED = {"cff-version", "message", "title", "authors"}
OPTIONAL = {"type", "abstract", "version", "license", "keywords"}


def test_it_is_a_citation_file_and_says_what_the_package_says():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert REQUIRED <= set(citation) <= REQUIRED | OPTIONAL
    assert (citation["cff-version"], citation["type"]) == ("1.2.0", "software")
    assert all(citation[key] for key in ("message", "title", "abstract"))
    # An author with the one key `name` is an entity, not a person.
    assert citation["authors"] == [{"name": "The ropeode developers"}]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert citation["version"] == project["version"] == ropeode.__version__
    assert citation["license"] == "MIT"
    assert (ROOT / "LICENSE").read_text().startswith("MIT License")
    assert "creativecommons.org/licenses/by/4.0" in (ROOT / "docs/LICENSE").read_text()
