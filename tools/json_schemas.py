"""The published JSON Schemas of what `--format json` writes, from the types of the results.

``python -m tools.json_schemas`` writes ``docs/schemas/NAME.json``.
"""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic.json_schema import GenerateJsonSchema

from ropeode.case_studies import Report
from ropeode.checking import CheckReport
from ropeode.files import write_whole
from ropeode.json_form import adapter, of_path
from ropeode.render import argument_words
from ropeode.study import AccuracyTable, Explanation, Horizon, WorkPrecision

FOLDER = Path(__file__).parents[1] / "docs/schemas"
RESULTS: tuple[Any, ...] = (
    AccuracyTable,
    CheckReport,
    Explanation,
    Horizon,
    Report,
    WorkPrecision,
)


class _Described(GenerateJsonSchema):
    """Schemas with the words of the docstrings, which list all keys."""

    def dataclass_schema(self, schema: Any) -> dict[str, Any]:
        cls = schema["cls"]
        found = super().dataclass_schema(schema)
        return _described(found, cls, {name: name for name in found["properties"]})

    def typed_dict_schema(self, schema: Any) -> dict[str, Any]:
        return _described(super().typed_dict_schema(schema), *schema["cls"].shows)

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def _described(found: dict[str, Any], cls: type, paths: Mapping[str, str]) -> dict[str, Any]:
    keys = found["properties"]
    words = {key: _words(cls, path) for key, path in paths.items()}
    said = [*words.values()]
    # Where two keys would be described alike, the ways to them tell them apart.
    words |= {key: _words_of_way(cls, paths[key]) for key in paths if said.count(words[key]) > 1}
    description = _json_words((inspect.getdoc(cls) or "").partition("\n\n")[0])
    return {
        "description": " ".join(description.split()),
        "type": "object",
        "properties": {key: {"description": text, **keys[key]} for key, text in words.items()},
        "required": [*paths],
        "additionalProperties": False,
    }


def _words_of_way(cls: type, path: str) -> str:
    parts = path.split(".")
    return ": ".join(_words(cls, ".".join(parts[: i + 1])) for i in range(len(parts)))


def _words(cls: type, path: str) -> str:
    """What the class that has an attribute says of it."""
    owner, name, _ = of_path(cls, path)
    own = getattr(owner, name, None)
    if isinstance(own, property):
        words = " ".join((inspect.getdoc(own) or "").partition("\n\n")[0].split()).rstrip(".")
        return _json_words(f"{words[0].lower()}{words[1:]}")
    return _json_words(argument_words(owner)[name])


def _json_words(words: str) -> str:
    """Words on Python's values, as JSON has these; without the shapes of arrays."""
    words = re.sub(r"\b(None|infinite|not a number)\b", "null", words)
    return re.sub(r", ``\(\w*,\)``", "", words).replace("``", "`")


def schemas() -> dict[str, str]:
    """The text of each schema, by the name of its file."""
    return {f"{name}.json": text for name, text in map(_schema, RESULTS)}


def _schema(result: Any) -> tuple[str, str]:
    name, version = result.SCHEMA.removeprefix("ropeode.").split("/")
    schema = adapter(result).json_schema(mode="serialization", schema_generator=_Described)
    words = {"description": "name and version of this form", "const": result.SCHEMA}
    whole = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:ropeode:{name}:{version}",
        "title": result.SCHEMA,
        "description": schema["description"],
        "type": "object",
        "properties": {"schema": words, **schema["properties"]},
        "required": ["schema", *schema["required"]],
        "additionalProperties": False,
        "$defs": schema["$defs"],
    }
    return name, json.dumps(whole, indent=2, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for file, text in schemas().items():
        write_whole(FOLDER / file, text)
