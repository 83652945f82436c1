"""A small result of each kind, made up: its numbers, in `made_up.json`, are the same everywhere."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import itertools
import json
import types
import typing
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from ropeode import (
    CheckReport,
    Problem,
    Reference,
    Report,
    Rope,
    Verification,
    case_studies,
    references,
    study,
    theory,
)
from ropeode.norms import NORMS, Norm
from ropeode.sweep import SweepSummary
from tests.quartic import HOSTILE

DATA = json.loads(Path(__file__).with_suffix(".json").read_text())


def made(hint: Any, given: Any) -> Any:
    """What a type hint says, of numbers, names, lists and objects, as in JSON.

    What is not given of a result is its default, the rope of this module, empty, or None.
    """
    kind, parts = typing.get_origin(hint) or hint, typing.get_args(hint)
    if given is None:
        return None
    if kind in READ:
        return READ[kind](given)
    if kind is types.UnionType:
        # The others are None, and what stands in place of a result that there is not.
        return made(parts[0], given)
    if kind is tuple:
        each = itertools.repeat(parts[0]) if parts[-1] is ... else parts
        return tuple(map(made, each, given))
    if kind in (Mapping, dict):
        pairs = given.items() if isinstance(given, dict) else given
        return {made(parts[0], key): made(parts[1], value) for key, value in pairs}
    if not isinstance(given, dict):
        return given
    hints, fields = typing.get_type_hints(kind), inspect.signature(kind).parameters
    assert given.keys() <= fields.keys(), given.keys() - fields.keys()
    return kind(**{name: _field(each, hints[name], given) for name, each in fields.items()})


def _field(field: inspect.Parameter, hint: Any, given: dict) -> Any:
    if field.name in given:
        return made(hint, given[field.name])
    if field.default is not field.empty:
        return field.default
    return EMPTY.get(typing.get_origin(hint) or hint, lambda: None)()


@functools.cache
def problem():
    return READ[Problem]({})


@functools.cache
def reference():
    """Trusted at its first three samples."""
    certificate = made(references.Certificate, DATA["certificate"])
    return Reference(problem(), np.zeros((4, *problem().y0.shape)), certificate)


def named(given):
    """An object with these fields, of which only they are asked for."""
    return json.loads(json.dumps(given), object_hook=lambda each: SimpleNamespace(**each))


def table_row(stepper, steps, error=None, **more):
    """A run with this error, if it is resolved."""
    known = {
        "status": "ok",
        "diverged_at": None,
        "error_final": error and error * 0.75,
        "error_max": error,
        "error_rms": error and error / 2,
        "resolved": error is not None,
        "resolution": 2.5e-12,
        "round_off": 1e-14,
        "rhs_evaluations": 3 * steps,
        "seconds": 0.0125,
    }
    return study.Row(stepper, steps, 1 / steps, **{**known, **more})


def table_of(rows, orders):
    truth, norm = reference(), NORMS["position-max"]
    return study.AccuracyTable(problem(), truth, norm, tuple(rows), tuple(orders))


def work_row(method, effort, error=None, cost=None, **more):
    """A run with this error, if it is resolved, and so many evaluations, if they are counted."""
    rtol = effort if effort < 1 else None
    known = {
        "family": "SciPy" if rtol else "runge-kutta",
        "dt": None if rtol else 1 / effort,
        "rtol": rtol,
        **dict.fromkeys(("error_final", "error_max", "error_rms", "energy_error"), error),
        "error_over_tolerance": error and rtol and error / rtol / 256,
        "resolved": error is not None,
        "status": "ok",
        "rhs_evaluations": cost,
        "steps": cost and cost // 4,
        "seconds": cost and cost / 4096,
        "seconds_min": cost and cost / 8192,
        "seconds_max": cost and cost / 2048,
    }
    unknown = dict.fromkeys(inspect.signature(study.WorkRow).parameters)
    return study.WorkRow(**{**unknown, "method": method, "effort": effort, **known, **more})


# What is read otherwise than field by field.
READ = {
    Any: lambda given: given,
    float: float,
    complex: complex,
    np.ndarray: functools.partial(np.array, dtype=float),
    Path: Path,
    Counter: lambda given: Counter(dict(given)),
    Problem: lambda given: Rope(num_nodes=4, **given).problem(frames=3),
    Reference: lambda given: reference(),
    Norm: NORMS.get,
    references.Solver: functools.partial(getattr, references),
    references.ExtendedSolution: lambda given: named(given),
    theory.StabilityFunction: lambda given: theory.NoStabilityFunction(**given),
    study.Row: lambda given: table_row(**given),
    study.WorkRow: lambda given: work_row(**given),
    case_studies.Figure: lambda number: case_studies.all_figures()[number],
    case_studies.Comparison: lambda number: case_studies.all_comparisons()[number],
}
EMPTY = {
    Problem: problem,
    Reference: reference,
    Norm: lambda: NORMS["position-max"],
    tuple: tuple,
    Mapping: dict,
}


def hostile():
    """Names with signs that mean something to HTML, Markdown, LaTeX or CSV."""
    table = MADE_UP["accuracy-table"]()
    (row, *_), (order, _) = table.rows, table.orders
    return dataclasses.replace(
        table,
        problem=dataclasses.replace(problem(), name=HOSTILE),
        rows=(dataclasses.replace(row, stepper=HOSTILE),),
        orders=(dataclasses.replace(order, stepper=HOSTILE),),
    )


KINDS = {
    "accuracy-table": study.AccuracyTable,
    "check": CheckReport,
    "explain": study.Explanation,
    "horizon": study.Horizon,
    "report": Report,
    "sweep": SweepSummary,
    "verification": Verification,
    "work-precision": study.WorkPrecision,
}
MADE_UP = {
    "hostile": hostile,
    **{name: functools.partial(made, kind, DATA[name]) for name, kind in KINDS.items()},
}
