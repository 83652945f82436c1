"""ODE steppers held against certified reference solutions.

The public names are imported when they are first used, so that `import ropeode` costs nothing
and the command line can show its help without importing JAX.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ropeode.analysis.errors import ErrorSeries, error_series
    from ropeode.analysis.order import ObservedOrder, observed_order
    from ropeode.errors import InputError, ReferenceRefused, RopeodeError, UserCodeError
    from ropeode.problems.problem import LinearDamping, Problem
    from ropeode.problems.rope import Rope
    from ropeode.references.reference import Reference, reference
    from ropeode.render.formats import format_table
    from ropeode.simulation import Trajectory, simulate
    from ropeode.steppers.base import ProblemClass, Stepper, System
    from ropeode.study.accuracy_table import AccuracyTable, accuracy_table

_MODULES = {
    "analysis.errors": ("ErrorSeries", "error_series"),
    "analysis.order": ("ObservedOrder", "observed_order"),
    "errors": ("InputError", "ReferenceRefused", "RopeodeError", "UserCodeError"),
    "problems.problem": ("LinearDamping", "Problem"),
    "problems.rope": ("Rope",),
    "references.reference": ("Reference", "reference"),
    "render.formats": ("format_table",),
    "simulation": ("Trajectory", "simulate"),
    "steppers.base": ("ProblemClass", "Stepper", "System"),
    "study.accuracy_table": ("AccuracyTable", "accuracy_table"),
}
_HOME = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "AccuracyTable",
    "ErrorSeries",
    "InputError",
    "LinearDamping",
    "ObservedOrder",
    "Problem",
    "ProblemClass",
    "Reference",
    "ReferenceRefused",
    "Rope",
    "RopeodeError",
    "Stepper",
    "System",
    "Trajectory",
    "UserCodeError",
    "accuracy_table",
    "error_series",
    "format_table",
    "observed_order",
    "reference",
    "simulate",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'ropeode' has no attribute {name!r}")
    return getattr(importlib.import_module(f"ropeode.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
