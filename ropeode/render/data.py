"""The accuracy table for other programs: JSON and CSV."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import math
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from ropeode.norms import Norm
from ropeode.problems.problem import Problem
from ropeode.references.reference import Reference
from ropeode.render.schemas.accuracy_table import (
    AccuracyTableForm,
    ConstantForm,
    ProblemForm,
    ReferenceForm,
)
from ropeode.study.accuracy_table import AccuracyTable
from ropeode.study.error_constant import AGREE, AGREE_CLOSELY, ErrorConstant

SCHEMA: Literal["ropeode.accuracy-table/1"] = "ropeode.accuracy-table/1"


def json_text(form: Any) -> str:
    """A JSON form as text; numbers that do not exist are null."""
    return json.dumps(plain(form), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def csv_text(lines: list[dict[str, Any]]) -> str:
    """Lines as CSV, under the names of all their columns; what does not exist is empty."""
    text = io.StringIO()
    names = list(dict.fromkeys(name for line in lines for name in line))
    writer = csv.DictWriter(text, fieldnames=names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(plain(lines))
    return text.getvalue()


def as_lines(table: AccuracyTable) -> list[dict[str, Any]]:
    """One line for each run, with the order of its stepper and the reference's bound."""
    whole = as_dict(table)
    orders = {each["stepper"]: each for each in whole["orders"]}
    lines = []
    for row in whole["rows"]:
        order = orders[row.stepper]
        low, high = order["ci95"] or (None, None)
        lines.append(
            {
                **vars(row),
                "expected_order": order["expected"],
                "observed_order": order["observed"],
                "order_low": low,
                "order_high": high,
                "verdict": order["verdict"],
                "used_for_order": row.dt in order["used"],
                "error_predicted": _error_predicted(row.dt, order["error_constant"]),
                "reference_bound": whole["reference"]["bound_max"],
            }
        )
    return lines


def _error_predicted(dt: float, constant: ConstantForm | None) -> float | None:
    """The leading term of the error of a run."""
    if constant is None or constant["predicted"] is None or constant["order"] is None:
        return None
    return constant["predicted"] * dt ** constant["order"]


def constant_dict(constant: ErrorConstant) -> ConstantForm:
    """What JSON says of an error constant."""
    return {
        "order": constant.order,
        "predicted": constant.predicted,
        "why": constant.why,
        "measured": constant.measured,
        "dt": constant.dt,
        "ratio": constant.ratio,
        "agree_10_percent": constant.agree_from(AGREE),
        "agree_1_percent": constant.agree_from(AGREE_CLOSELY),
    }


def problem_dict(problem: Problem) -> ProblemForm:
    """What JSON says of a problem."""
    return {
        "name": problem.name,
        "frames": problem.frames,
        "t_start": float(problem.ts[0]),
        "t_end": float(problem.ts[-1]),
        "parameters": dict(problem.parameters),
    }


def reference_dict(reference: Reference, norm: Norm) -> ReferenceForm:
    """What JSON says of a reference, with its bound in a norm."""
    certificate = reference.certificate
    return {
        "level": certificate.level,
        "solver": str(certificate.solver),
        "rtol": certificate.rtol,
        "atol": np.asarray(certificate.atol).tolist(),
        "steps": certificate.steps,
        "stiff": certificate.stiff,
        "witnesses": [
            {
                "solver": str(w.solver),
                "tolerance": w.tolerance,
                "role": w.role,
                "steps": w.steps,
                "difference": w.difference,
            }
            for w in certificate.witnesses
        ],
        "sampling": certificate.sampling,
        "drift_max": {
            quantity: float(np.max(drift[: reference.trusted]))
            for quantity, drift in certificate.drift.items()
        },
        "bound_max": float(reference.bound(norm)[-1]),
        "accuracy": certificate.accuracy,
        "horizon": certificate.horizon,
        "horizon_reason": certificate.horizon_reason,
        "versions": dict(sorted(certificate.versions.items())),
    }


def as_dict(table: AccuracyTable) -> AccuracyTableForm:
    """The table in its JSON form."""
    return {
        "schema": SCHEMA,
        "problem": problem_dict(table.problem),
        "norm": table.norm.name,
        "reference": reference_dict(table.reference, table.norm),
        "rows": list(table.rows),
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
                "left_out": list(each.order.left_out),
                "error_constant": each.constant and constant_dict(each.constant),
            }
            for each in table.orders
        ],
    }


def plain(value: Any) -> Any:
    """A JSON form as nested dicts, lists, texts and numbers; None for numbers that JSON has not."""
    if dataclasses.is_dataclass(value):
        return {each.name: plain(getattr(value, each.name)) for each in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
