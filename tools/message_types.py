"""The TypeScript types of the lab's messages, from their one definition in Python.

``python tools/message_types.py`` writes ``ropeode/laboratory/page/messages.d.ts``.
"""

from __future__ import annotations

import inspect
import json
import sys
from pathlib import Path
from typing import Any, Literal

from pydantic.json_schema import models_json_schema

from ropeode.files import write_whole
from ropeode.laboratory import messages

FILE = Path(__file__).parents[1] / "ropeode/laboratory/page/messages.d.ts"
HEADER = """\
// Written by tools/message_types.py from ropeode/laboratory/messages.py: change that file.
// Arrays of an answer are not in its JSON; its comment names them.
"""
PLAIN = {"string": "string", "integer": "number", "number": "number", "boolean": "boolean"}


def declarations() -> str:
    """The text of ``messages.d.ts``."""
    models = [
        each
        for each in vars(messages).values()
        if inspect.isclass(each) and issubclass(each, messages.Message)
    ]
    # What the page sends may leave out fields that have a default; what it gets is complete.
    sent = _sent(models)
    modes: list[tuple[Any, Literal["validation", "serialization"]]] = [
        (each, "validation" if each.__name__ in sent else "serialization")
        for each in models
        if not each.__subclasses__()
    ]
    _, schema = models_json_schema(modes)
    found = schema["$defs"]
    answers = [name for name in found if name not in sent and "kind" in found[name]["properties"]]
    unions = [
        'export type Ask = Wanted["ask"];',
        "export type Answer =",
        *(f"  | {name}" for name in answers),
        "",
    ]
    return "\n".join(
        [HEADER, *unions, *(_interface(name, found[name], name in sent) for name in found)]
    )


def _sent(models: list[type]) -> set[str]:
    """The names of the messages that go from the page to Python."""
    _, schema = models_json_schema([(messages.Want, "validation")])
    return set(schema["$defs"]) & {each.__name__ for each in models}


def _interface(name: str, schema: dict[str, Any], sent: bool) -> str:
    required = schema.get("required", [])
    lines = [*_comment(schema), f"export interface {name} {{"]
    for field, each in schema.get("properties", {}).items():
        optional = "?" if sent and field not in required else ""
        lines.append(f"  {field}{optional}: {_type(each)};")
    return "\n".join([*lines, "}", ""])


def _comment(schema: dict[str, Any]) -> list[str]:
    lines = schema.get("description", "").splitlines()
    return ["/**", *(f" * {line}".rstrip() for line in lines), " */"] if lines else []


def _type(schema: dict[str, Any] | Literal[True]) -> str:
    """The TypeScript type of a JSON schema."""
    if schema is True:
        return "unknown"
    if "$ref" in schema:
        return schema["$ref"].rsplit("/", 1)[1]
    if "const" in schema:
        return json.dumps(schema["const"])
    if "enum" in schema:
        return " | ".join(map(json.dumps, schema["enum"]))
    if some := schema.get("anyOf") or schema.get("oneOf"):
        return " | ".join(map(_type, some))
    match schema.get("type"):
        case "null":
            return "null"
        case "array":
            if items := schema.get("prefixItems"):
                return f"[{', '.join(map(_type, items))}]"
            inner = _type(schema["items"])
            return f"({inner})[]" if " | " in inner else f"{inner}[]"
        case "object":
            return f"{{ [name: string]: {_type(schema.get('additionalProperties', True))} }}"
        case None:
            return "unknown"
        case str(kind):
            return PLAIN[kind]
    raise ValueError(f"no TypeScript type for the schema {schema}")


if __name__ == "__main__":
    if sys.argv[1:]:
        sys.exit("message_types.py takes no argument")
    write_whole(FILE, declarations())
