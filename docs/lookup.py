"""The parts of the reference that the package itself tells: schemas, steppers, problems.

Light, so that a test can see that the pages say the same: `make docs` writes them by cog.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tabulate import tabulate

from ropeode.laboratory import parameters_of
from ropeode.problems import PROBLEMS, Problem
from ropeode.problems.library import ROPES
from ropeode.references import entries
from ropeode.render import argument_words
from ropeode.render.docstrings import description, source
from ropeode.steppers import STEPPERS, BuiltIn, ProblemClass, options, variants

SCHEMAS = Path(__file__).parent / "schemas"
# Ropes refer to no book.
_ROPES = {
    "rope": "[the rope as a first-order ODE](../explanation/rope.md)",
    "inextensible-rope": "[the inextensible rope](../explanation/inextensible-rope.md)",
}


def table(headers: list[str], rows: list[list[str]], words: int | set[int] = 0) -> str:
    """A Markdown table; columns of words (the first ones, or those named) to the left."""
    left = set(range(words)) if isinstance(words, int) else words
    align = ["left" if column in left else "right" for column in range(len(headers))]
    cells = [[cell.replace("|", r"\|") for cell in row] for row in rows]
    return tabulate(cells, headers, tablefmt="pipe", disable_numparse=True, colalign=align)


# ---- schemas


def schema_keys(name: str) -> str:
    """Tables of all keys of a schema, a part each; parts of the accuracy table stand there only."""
    schema = json.loads((SCHEMAS / f"{name}.json").read_text())
    known = json.loads((SCHEMAS / "accuracy-table.json").read_text())["$defs"]
    parts = {
        part: found
        for part, found in schema["$defs"].items()
        if name == "accuracy-table" or known.get(part) != found
    }
    if name != "accuracy-table":
        parts.pop("AccuracyTable", None)
    written = [_keys(schema)]
    written += [f"**{part}**: {_started(found)}\n\n{_keys(found)}" for part, found in parts.items()]
    return "\n\n".join(written)


def _started(part: dict[str, Any]) -> str:
    """The sentence on a part, as it goes on after its name."""
    words = part["description"]
    return words[0].lower() + words[1:]


def _keys(part: dict[str, Any]) -> str:
    rows = [
        [
            f"`{key}`" + ("" if key in part["required"] else " (may be missing)"),
            _type(found),
            found["description"],
        ]
        for key, found in part["properties"].items()
    ]
    return table(["key", "type", "meaning"], rows, words=3)


def _type(found: dict[str, Any]) -> str:
    """The type of a value in words."""
    if "$ref" in found:
        return found["$ref"].rpartition("/")[2]
    if "const" in found:
        return f"`{found['const']}`"
    if "enum" in found:
        return "text"
    if "anyOf" in found:
        return " or ".join(dict.fromkeys(_type(each) for each in found["anyOf"]))
    if "prefixItems" in found:
        return f"{len(found['prefixItems'])} × {_type(found['prefixItems'][0])}"
    if found.get("type") == "array":
        return f"list of {_type(found.get('items', {}))}"
    if found.get("type") == "object":
        values = found["additionalProperties"]
        inside = "any" if values is True else _type(values)
        return f"object of {inside}" if inside else "object"
    return {"string": "text", "integer": "whole number"}.get(found.get("type", ""), "") or (
        found.get("type", "any")
    )


# ---- steppers


def stepper_orders() -> str:
    """The declared orders of all steppers, with every combination of their options."""
    kinds = [
        ProblemClass(damped=False, at_rest=True),
        ProblemClass(damped=False, at_rest=False),
        ProblemClass(damped=True, at_rest=True),
        ProblemClass(damped=True, at_rest=False),
    ]
    rows = [
        [f"`{each.label}`", *(_order(each, kind) for kind in kinds)]
        for cls in STEPPERS.values()
        for each in variants(cls)
    ]
    headers = ["stepper", "at rest", "moving", "damped, at rest", "damped, moving"]
    return table(headers, rows, words=1)


def _order(stepper: BuiltIn, kind: ProblemClass) -> str:
    """The order on the problems that the stepper is for: rigid ones, for those that keep links."""
    meant = kind if stepper.solves(kind) else kind._replace(rigid=True)
    return str(stepper.order(meant))


def steppers() -> str:
    """A section for each stepper."""
    return "\n\n".join(_stepper(cls) for cls in STEPPERS.values())


def _stepper(cls: type[BuiltIn]) -> str:
    facts = [
        f"It runs on problems of the kind *{cls.needs}*"
        + (", with frames of equal length." if cls().equal_frames else "."),
        "Symplectic on problems without damping." if cls().symplectic else "Not symplectic.",
    ]
    parts = [f"### {cls.name}", _description(cls), " ".join(facts)]
    words = argument_words(cls)
    if chosen := options(cls):
        rows = [
            [f"`{name}`", ", ".join(f"`{choice}`" for choice in choices), _code(words[name])]
            for name, choices in chosen.items()
        ]
        headers = ["option", "values, the default first", "meaning"]
        parts.append(table(headers, rows, words=3))
    return "\n\n".join([*parts, f"Source: {_code(source(cls))}"])


# ---- problems


def problem_list() -> str:
    """All problems, a line each."""
    rows = []
    for name in PROBLEMS:
        problem = _problem(name)
        known = "exact" if problem.exact is not None else "stored" if _stored(name) else "-"
        if problem.exact is not None and _stored(name):
            known = "exact, stored"
        kind = "first order"
        if problem.mechanics is not None:
            kind = "rigid links" if problem.rigid else "second order"
        first = _description(_documented(name)).partition("\n\n")[0]
        rows.append([f"[`{name}`](#{name})", first, kind, known])
    return table(["problem", "what it is", "kind", "solution"], rows, words=4)


def problems() -> str:
    """A section for each problem."""
    return "\n\n".join(_problem_section(name) for name in PROBLEMS)


def _problem_section(name: str) -> str:
    problem, documented = _problem(name), _documented(name)
    rows = [
        [f"`{each.name}`", f"`{json.dumps(each.default)}`", each.unit, _code(each.words)]
        for each in parameters_of(problem)
    ]
    parts = [f"### {name}", _description(documented)]
    parts.append(table(["parameter", "default", "unit", "meaning"], rows, words=4))
    facts = [f"Frames: {problem.frames} by default." if name not in ROPES else ""]
    if problem.exact is not None:
        facts.append("Its exact solution is known.")
    if stored := _stored(name):
        facts.append(f"Stored references: {', '.join(f'`{each}`' for each in stored)}.")
    origin = _ROPES.get(name) or _code(source(documented))
    return "\n\n".join([*parts, " ".join(filter(None, facts)), f"Source: {origin}"])


def _problem(name: str) -> Problem:
    return PROBLEMS[name]() if name not in ROPES else ROPES[name]().problem(20)


def _documented(name: str) -> Any:
    """What has the docstring of a problem."""
    return ROPES.get(name, PROBLEMS[name])


def _stored(name: str) -> list[str]:
    """The stored references of a problem."""
    return [entry for entry, found in entries().items() if found.problem == name]


# ---- docstrings


def _description(documented: Any) -> str:
    """What a docstring says before it lists arguments and sources."""
    return _code("\n\n".join(description(documented)))


def _code(text: str) -> str:
    """Code as Markdown has it."""
    return text.replace("``", "`")
