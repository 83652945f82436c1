"""The published JSON Schemas, as a program that reads our JSON uses them."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jsonschema import Draft202012Validator

FOLDER = Path(__file__).parents[1] / "docs/schemas"


@functools.cache
def validators() -> dict[str, Draft202012Validator]:
    """Each schema's, by the name that `schema` has in what is written."""
    # Takes seconds where the packages of all its formats are installed.
    from jsonschema import Draft202012Validator

    schemas = [json.loads(file.read_text()) for file in FOLDER.glob("*.json")]
    for schema in schemas:
        Draft202012Validator.check_schema(schema)
    return {schema["title"]: Draft202012Validator(schema) for schema in schemas}


def assert_conforms(text: str) -> None:
    """What was written has just the keys of its schema, with values of their types."""
    form = json.loads(text)
    validators()[form["schema"]].validate(form)
