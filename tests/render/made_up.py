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

import ropeode
from ropeode import Problem, Reference, Rope, case_studies, references, study, theory
from ropeode.norms import NORMS, Norm
from ropeode.sweep import SweepSummary
from tests.quartic import HOSTILE

DATA = json.loads(Path(__file__).with_suffix(".json").read_text())


def made(hint: Any, given: Any) -> Any:
    """What a type hint says, of numbers, names, lists and objects, as in JSON.

    Many objects with the same fields may be a table, of `columns` and `values`. What is not given
    of a result is its default, the rope of this module, empty, or None.
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
        if isinstance(given, dict):
            given = [dict(zip(given["columns"], each, strict=True)) for each in given["values"]]
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


def table_of(rows, orders):
    truth, norm = reference(), NORMS["position-max"]
    return study.AccuracyTable(problem(), truth, norm, tuple(rows), tuple(orders))


# What is read otherwise than field by field.
READ = {
    Any: lambda given: given,
    # Names of fields in JSON; what counts steps stays whole.
    float: lambda given: float(given) if isinstance(given, str) else given,
    complex: complex,
    np.ndarray: functools.partial(np.array, dtype=float),
    Path: Path,
    Counter: lambda given: Counter(dict(given)),
    Problem: lambda given: Rope(num_nodes=4, **given).problem(frames=3),
    Reference: lambda given: reference(),
    Norm: NORMS.get,
    references.Solver: functools.partial(getattr, references),
    references.ExtendedSolution: lambda given: named(given),
    theory.StabilityFunction: str,
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
    "check": ropeode.CheckReport,
    "explain": study.Explanation,
    "horizon": study.Horizon,
    "report": ropeode.Report,
    "sweep": SweepSummary,
    "verification": ropeode.Verification,
    "work-precision": study.WorkPrecision,
}
MADE_UP = {
    "hostile": hostile,
    **{name: functools.partial(made, kind, DATA[name]) for name, kind in KINDS.items()},
}
