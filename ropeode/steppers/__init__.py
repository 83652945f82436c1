"""One-step methods: those of ropeode by name, and whatever else advances a state by dt."""

from __future__ import annotations

from ropeode.steppers.base import BuiltIn, ProblemClass, Stepper, System
from ropeode.steppers.constraint import ConstraintVerlet, Rattle
from ropeode.steppers.euler import ExplicitEuler, SemiImplicitEuler
from ropeode.steppers.phase import Phase
from ropeode.steppers.registry import STEPPERS, by_family, options
from ropeode.steppers.runge_kutta import RungeKutta
from ropeode.steppers.runge_kutta_methods import RungeKutta4
from ropeode.steppers.stepper_loading import as_stepper
from ropeode.steppers.templates import TEMPLATES, template
from ropeode.steppers.verlet import StormerVerlet, VelocityVerlet

__all__ = [
    "STEPPERS",
    "TEMPLATES",
    "BuiltIn",
    "ConstraintVerlet",
    "ExplicitEuler",
    "Phase",
    "ProblemClass",
    "Rattle",
    "RungeKutta",
    "RungeKutta4",
    "SemiImplicitEuler",
    "Stepper",
    "StormerVerlet",
    "System",
    "VelocityVerlet",
    "as_stepper",
    "by_family",
    "options",
    "template",
]
