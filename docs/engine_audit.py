"""The audit of engines as Markdown, from the stored data alone: `make docs` writes it by cog."""

from __future__ import annotations

import ast
import json
import tomllib
from pathlib import Path
from typing import Any

from lookup import table

ROOT = Path(__file__).parent.parent
AUDIT = ROOT / "benchmarks/audit"
DATA = Path(__file__).parent / "data/audit.jsonl"
_PROBLEMS = {
    "springs": "rope",
    "springs-damped": "damped rope",
    "springs-rest": "rope from rest",
    "rigid": "rigid rope",
    "rigid-damped": "damped rigid rope",
    "kepler": "Kepler",
    "pleiades": "Pleiades",
}


def listed() -> dict[str, Any]:
    """The engines, and what was left out."""
    return tomllib.loads((AUDIT / "engines.toml").read_text())


def rows() -> list[dict[str, Any]]:
    """The rows of the data file, without the line of facts."""
    return [json.loads(line) for line in DATA.read_text().splitlines()[1:]]


def order_words(quantity: dict[str, Any] | None) -> str:
    """An order with its interval, or why there is none."""
    if quantity is None:
        return "none"
    if quantity["verdict"] == "does not converge":
        return "does not converge"
    if quantity["observed"] is not None:
        low, high = quantity["ci95"]
        return f"{quantity['observed']:.2f} [{low:.2f}, {high:.2f}]"
    return "undetermined"


def orders() -> str:
    """What each method converges to, and with which order."""
    shown = []
    for row in rows():
        for run, found in row["cases"].items():
            name, _, special = run.partition(" ")
            quantities = found.get("quantities", {})
            problem = f"{_PROBLEMS[name]} {special}".strip()
            converges = {"right": "yes", "wrong": "no"}.get(found["verdict"], found["verdict"])
            words = [order_words(quantities.get(each)) for each in ("position", "velocity")]
            shown.append(
                [f"{row['engine']} {row['version']}", row["method"], problem, converges, *words]
            )
    headers = ["engine", "method", "problem", "solves it", "order of positions", "of velocities"]
    return table(headers, shown, words=4)


def damping_words(row: dict[str, Any]) -> str:
    """Whether damping acts per time, if a damped run tells."""
    found = next((each for run, each in row["cases"].items() if "damped" in run), None)
    if found is None:
        return "not run"
    if found["verdict"] == "right":
        return "per time"
    return "another equation" if found["verdict"] == "wrong" else "undetermined"


def limits() -> str:
    """Damping, energy, the largest stable step and the time of a step."""
    shown = []
    for row in rows():
        long = row.get("long") or {}
        fewest = long.get("fewest_stable")
        drift = long.get("drift") or {}
        stable = "not run" if not long else "none found" if fewest is None else f"1/{fewest}"
        micro = row["seconds_per_step"]
        shown.append(
            [
                f"{row['engine']} {row['version']}",
                row["method"],
                damping_words(row),
                drift.get("line", "not run" if not long else "the run ended early"),
                stable,
                "-" if micro is None else f"{1e6 * micro:.2g}",
            ]
        )
    headers = [
        "engine",
        "method",
        "damping",
        "energy at dt = 1/64",
        "largest stable dt",
        "µs a step",
    ]
    return table(headers, shown, words=4)


def claims() -> str:
    """What each engine's documentation says, with its address."""
    shown = [
        [
            each["name"],
            each["holds"],
            each["claim"],
            f"<{each['source']}>" + (f", {each['where']}" if "where" in each else ""),
        ]
        for each in listed()["engine"]
    ]
    return table(["engine", "what holds the problem", "claim", "where"], shown, words=4)


def left_out() -> str:
    """Engines without a row, and why."""
    reasons = listed()["left_out"].items()
    return "\n".join(f"- {why}: {', '.join(names)}" for why, names in reasons)


def diagnoses() -> str:
    """The runs that `ropeode grade` finds wrong, with its diagnosis."""
    lines = [
        f"- {row['engine']}, {row['method']}, {run}: {found['finding']}. "
        + " ".join(found["diagnosis"])
        for row in rows()
        for run, found in row["cases"].items()
        if found["verdict"] == "wrong"
    ]
    return "\n".join(lines) or "None."


def order_of(exporter: str, method: str, run: str, quantity: str = "position") -> str:
    """One order of the table, for the text.

    Arguments:
        exporter: file name.
        method: as the table names it.
        run: of this method.
        quantity: `position` or `velocity`.
    """
    for row in rows():
        if (row["exporter"], row["method"]) == (exporter, method):
            return order_words(row["cases"][run]["quantities"][quantity])
    raise LookupError(f"{exporter}, {method}: not in {DATA}")


def lines_of_code(source: str) -> int:
    """Lines that are neither blank, nor comments, nor the docstring, nor imports."""
    tree = ast.parse(source)
    first = tree.body[0]
    aside = {
        line
        for node in tree.body
        if node is first or isinstance(node, ast.Import | ast.ImportFrom)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    return sum(
        bool(text.strip()) and not text.strip().startswith("#") and number not in aside
        for number, text in enumerate(source.splitlines(), 1)
    )


def exporters() -> str:
    """All exporters, each with its engine."""
    parts = []
    for each in listed()["engine"]:
        source = (AUDIT / "exporters" / each["exporter"]).read_text()
        summary = f"{each['name']}: {each['holds']} ({each['exporter']})"
        body = f"<details>\n<summary>{summary}</summary>\n\n```py\n{source}```\n\n</details>"
        parts.append(body)
    return "\n\n".join(parts)
