"""The published JSON Schemas of what `--format json` writes, from the types in the package.

``python -m tools.json_schemas`` writes ``docs/schemas/NAME.json``.
"""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Mapping
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, NotRequired, Union, get_args, get_origin, get_type_hints

from ropeode.case_studies.report_form import ReportForm
from ropeode.files import write_whole
from ropeode.render.docstrings import argument_words
from ropeode.render.schemas.accuracy_table import AccuracyTableForm, ConstantForm
from ropeode.render.schemas.check import CheckForm
from ropeode.render.schemas.explanation import ConstantsForm, ExplanationForm
from ropeode.render.schemas.horizon import HorizonForm
from ropeode.render.schemas.work_precision import WorkPrecisionForm

FOLDER = Path(__file__).parents[1] / "docs/schemas"
FORMS: tuple[type, ...] = (
    AccuracyTableForm,
    CheckForm,
    ExplanationForm,
    HorizonForm,
    ReportForm,
    WorkPrecisionForm,
)
# Python 3.11 forgets it.
_EXTENDS: dict[type, type] = {ConstantsForm: ConstantForm}
_PLAIN = {str: "string", int: "integer", float: "number", bool: "boolean", NoneType: "null"}


def schemas() -> dict[str, str]:
    """The text of each schema, by the name of its file."""
    written = {}
    for form in FORMS:
        parts: dict[type, dict[str, Any]] = {}
        schema = _object(form, parts)
        name, version = schema["properties"]["schema"]["const"].removeprefix("ropeode.").split("/")
        head = {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "$id": f"urn:ropeode:{name}:{version}",
            "title": f"ropeode.{name}/{version}",
        }
        named = {_name(kind): part for kind, part in parts.items()}
        assert len(named) == len(parts), "two parts have one name"
        text = json.dumps({**head, **schema, "$defs": named}, indent=2, ensure_ascii=False)
        written[f"{name}.json"] = text + "\n"
    return written


def _object(kind: type, parts: dict[type, dict[str, Any]]) -> dict[str, Any]:
    """The schema of a TypedDict or a dataclass; those inside it go into `parts`."""
    hints, words = get_type_hints(kind, include_extras=True), _words(kind)
    assert set(words) == set(hints), f"{kind.__name__} does not describe just the keys that it has"
    return {
        "description": _json_words(inspect.getdoc(kind) or "").partition("\n\n")[0],
        "type": "object",
        "properties": {
            key: {"description": words[key], **_value(hint, parts)} for key, hint in hints.items()
        },
        "required": [key for key, hint in hints.items() if get_origin(hint) is not NotRequired],
        "additionalProperties": False,
    }


def _value(hint: Any, parts: dict[type, dict[str, Any]]) -> dict[str, Any]:
    """The schema of a value of this type."""
    of, inner = get_origin(hint), get_args(hint)
    if hint is Any:
        return {}
    if of is NotRequired:
        return _value(inner[0], parts)
    if of is Literal:
        return {"const": inner[0]} if len(inner) == 1 else {"enum": list(inner)}
    if of in (Union, UnionType):
        return {"anyOf": [_value(each, parts) for each in inner]}
    if of is tuple and inner[-1] is not ...:
        ends = {"minItems": len(inner), "maxItems": len(inner)}
        return {"type": "array", "prefixItems": [_value(each, parts) for each in inner], **ends}
    if of in (list, tuple):
        return {"type": "array", "items": _value(inner[0], parts)}
    if of in (dict, Mapping):
        return {"type": "object", "additionalProperties": _value(inner[1], parts)}
    if hint in _PLAIN:
        return {"type": _PLAIN[hint]}
    if hint not in parts:
        parts[hint] = {}  # its place, before those of its own parts
        parts[hint] = _object(hint, parts)
    return {"$ref": f"#/$defs/{_name(hint)}"}


def _name(kind: type) -> str:
    """What a part is called."""
    return kind.__name__.removesuffix("Form")


def _words(kind: type) -> dict[str, str]:
    """What its docstring says of each key, and that of the one that it extends."""
    found = argument_words(kind)
    if kind in _EXTENDS:
        found = argument_words(_EXTENDS[kind]) | found
    return {key: _json_words(words) for key, words in found.items()}


def _json_words(words: str) -> str:
    """Words on Python's values, as JSON has these."""
    return re.sub(r"\bNone\b", "null", words)


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, text in schemas().items():
        write_whole(FOLDER / name, text)
