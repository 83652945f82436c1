"""The accuracy table for other programs: JSON and CSV."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import math
from typing import Any

import numpy as np

from ropeode.problems.problem import Problem
from ropeode.study.accuracy_table import AccuracyTable

SCHEMA = "ropeode.accuracy-table/1"


def as_json(table: AccuracyTable) -> str:
    """Schema `ropeode.accuracy-table/1`; numbers that do not exist are null."""
    return json.dumps(without_infinities(as_dict(table)), indent=2, allow_nan=False) + "\n"


def as_csv(table: AccuracyTable) -> str:
    """One line for each run, with the order of its stepper and the reference's bound."""
    whole = as_dict(table)
    orders = {each["stepper"]: each for each in whole["orders"]}
    lines = []
    for row in whole["rows"]:
        order = orders[row["stepper"]]
        low, high = order["ci95"] or (None, None)
        lines.append(
            {
                **row,
                "expected_order": order["expected"],
                "observed_order": order["observed"],
                "order_low": low,
                "order_high": high,
                "verdict": order["verdict"],
                "used_for_order": row["dt"] in order["used"],
                "reference_bound": whole["reference"]["bound_max"],
            }
        )
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(lines[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(without_infinities(lines))
    return text.getvalue()


def problem_dict(problem: Problem) -> dict[str, Any]:
    """What JSON says of a problem."""
    return {
        "name": problem.name,
        "frames": problem.frames,
        "t_start": float(problem.ts[0]),
        "t_end": float(problem.ts[-1]),
        "parameters": dict(problem.parameters),
    }


def as_dict(table: AccuracyTable) -> dict[str, Any]:
    """The table as nested plain values."""
    problem, reference = table.problem, table.reference
    made = reference.certificate
    return {
        "schema": SCHEMA,
        "problem": problem_dict(problem),
        "norm": table.norm.name,
        "reference": {
            "level": made.level,
            "solver": made.solver,
            "rtol": made.rtol,
            "atol": made.atol,
            "steps": made.steps,
            "stiff": made.stiff,
            "witnesses": [
                {
                    "solver": w.solver,
                    "tolerance": w.tolerance,
                    "role": w.role,
                    "steps": w.steps,
                    "difference": w.difference,
                }
                for w in made.witnesses
            ],
            "drift_max": {
                quantity: float(np.max(drift[: reference.trusted]))
                for quantity, drift in made.drift.items()
            },
            "bound_max": float(reference.bound(table.norm)[-1]),
            "accuracy": made.accuracy,
            "horizon": made.horizon,
            "horizon_reason": made.horizon_reason,
            "versions": dict(made.versions),
        },
        "rows": [dataclasses.asdict(row) for row in table.rows],
        "orders": [
            {
                "stepper": each.stepper,
                "solves_this_problem": each.solves,
                "expected": each.expected,
                "observed": each.order.observed,
                "ci95": list(each.order.ci95) if each.order.ci95 else None,
                "verdict": each.order.verdict,
                "why": each.order.why,
                "used": list(each.order.used),
                "left_out": [dataclasses.asdict(point) for point in each.order.left_out],
            }
            for each in table.orders
        ],
    }


def without_infinities(value: Any) -> Any:
    """Nested plain values, with None for numbers that JSON does not have."""
    if isinstance(value, dict):
        return {key: without_infinities(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [without_infinities(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
