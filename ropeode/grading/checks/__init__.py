"""The checks, by name, in the order in which they are reported."""

from __future__ import annotations

import functools
from collections.abc import Callable

from ropeode.grading.checks.conservation import energy, free_flight, momentum, pins
from ropeode.grading.checks.manners import determinism, first_sample, purity
from ropeode.grading.checks.orders import order
from ropeode.grading.checks.rounding import float32, zero_length
from ropeode.grading.checks.stability import stability
from ropeode.grading.checks.structure import reversible, symplectic
from ropeode.grading.checks.symmetry import (
    boost,
    mirror,
    node_order,
    rotation,
    time_shift,
    translation,
    units,
)
from ropeode.grading.examination import Examination
from ropeode.grading.problems import convergence_problems
from ropeode.grading.report import Finding

Check = Callable[[Examination], Finding]

CHECKS: dict[str, Check] = {
    "determinism": determinism,
    "purity": purity,
    "first-sample": first_sample,
    **{f"order-{name}": functools.partial(order, problem=name) for name in convergence_problems()},
    "free-flight": free_flight,
    "pins": pins,
    "momentum": momentum,
    "translation": translation,
    "boost": boost,
    "rotation": rotation,
    "mirror": mirror,
    "node-order": node_order,
    "time-shift": time_shift,
    "units": units,
    "stability": stability,
    "energy": energy,
    "symplectic": symplectic,
    "reversible": reversible,
    "float32": float32,
    "zero-length": zero_length,
}

# What is left out where there is little time. Damping, drive and unlike numbers are in the two
# orders that stay.
SLOW = (
    "order-textbook",
    "order-damped",
    "order-uneven",
    "order-free",
    "stability",
    "energy",
    "symplectic",
)
