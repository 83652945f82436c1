"""The checks, by name, in the order in which they are reported."""

from __future__ import annotations

import functools
from collections.abc import Callable

from ropeode.checking.check_context import Examination
from ropeode.checking.checks.conservation import energy, free_flight, momentum, pins
from ropeode.checking.checks.error_constant import predicted
from ropeode.checking.checks.orders import order
from ropeode.checking.checks.rounding import float32, zero_length
from ropeode.checking.checks.side_effects import determinism, first_sample, purity
from ropeode.checking.checks.stability import stability
from ropeode.checking.checks.structure import reversible, symplectic
from ropeode.checking.checks.symmetry import SYMMETRIES, symmetry, time_shift
from ropeode.checking.checks.thresholds import thresholds
from ropeode.checking.report import Finding

Check = Callable[[Examination], Finding]

# The names of `convergence_problems`. Building those starts JAX's threads, and an import may not:
# a process that has only imported this can be forked.
_ORDERS = ("textbook", "damped", "unequal", "driven", "uneven", "free")

CHECKS: dict[str, Check] = {
    "determinism": determinism,
    "purity": purity,
    "first-sample": first_sample,
    **{f"order-{name}": functools.partial(order, problem=name) for name in _ORDERS},
    "error-constant": predicted,
    "free-flight": free_flight,
    "pins": pins,
    "momentum": momentum,
    **{name: functools.partial(symmetry, check=name) for name in SYMMETRIES},
    "time-shift": time_shift,
    "thresholds": thresholds,
    "stability": stability,
    "energy": energy,
    "symplectic": symplectic,
    "reversible": reversible,
    "float32": float32,
    "zero-length": zero_length,
}

# Left out by --quick. The two checks of order that stay cover damping, drive and unequal
# parameters.
SLOW = (
    "order-textbook",
    "order-damped",
    "order-uneven",
    "order-free",
    "error-constant",
    "stability",
    "energy",
    "symplectic",
)
