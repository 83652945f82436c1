"""What is wrong with a stepper that failed a check, read off single steps."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.diagnosis.low_order import diagnose_order_1
from ropeode.checking.diagnosis.probe_states import (
    AT_REST,
    ELSEWHERE,
    Probe,
    expansions,
    probe_ropes,
)
from ropeode.checking.diagnosis.single_precision import diagnose_single_precision
from ropeode.checking.diagnosis.start import diagnose_start
from ropeode.checking.diagnosis.step_size import diagnose_step_size
from ropeode.checking.report import Diagnosis
from ropeode.precision import in_float64
from ropeode.steppers import Stepper, as_stepper
from ropeode.theory import (
    HIGHEST_ORDER,
    Expansion,
    describe,
    diagnose_equation,
    diagnose_identity,
    recognised,
    tableau_of,
    where_off,
)

# What the coefficients of a Runge-Kutta method may explain.
_OF_A_METHOD = {"order", "pace", "stage-time"}
# What may be one of the costs of an order; a stage's time is said by the coefficients, too.
_OF_COSTS = {"order", "lagged-damping"}
# Coefficients that are rounded to few digits leave a term of a lower order, of at most this part of
# the solution's own.
_FEW_DIGITS = 1e-2
# What a term may be, as a part of its largest value, where there is none.
_NONE = 1e-3


class _Cost(NamedTuple):
    """What may cost a method its order.

    Fields:
        field: of `CheckArgs`.
        none: its value without it.
        words: what it is.
        remedy: for a method of an order above 2.
    """

    field: str
    none: float
    words: str
    remedy: str


_COSTS = (
    _Cost(
        "damping",
        0.0,
        "damping",
        "take the damping at the velocity of each stage, or in a composition multiply v by "
        "exp(-damping / mass * dt / 2) at both ends of each part, with the part's dt",
    ),
    _Cost(
        "drive",
        0.0,
        "forces that depend on time",
        "let a stage at t + c dt take forces of that time",
    ),
    _Cost("free", 1.0, "pinned nodes", "keep pinned nodes where they are in all stages"),
)


@in_float64
def diagnose_stepper(examination: Examination) -> tuple[Diagnosis, ...]:
    """Find what is wrong with a stepper that failed a check.

    Its step is expanded in dt at random states of two ropes: at dt = 0 it must be the identity,
    its derivative there must be the right-hand side, and the first term of its error must be of
    the claimed order.

    Returns:
        One diagnosis for each cause. If there is none, one of the cause `unknown`, with what is
        right.

    Raises:
        UserCodeError: the step raised.
    """
    probe = Probe(examination)
    # What rounds its numbers has no expansion in dt: it looks like other mistakes.
    if rounded := diagnose_single_precision(probe) or diagnose_step_size(probe):
        return (rounded,)
    found = expansions(examination)
    expected = examination.expected(found[0].problem) or 0
    start = diagnose_start(found, expected or 1)
    if start is not None and start.evidence["order"] == 0:
        from_rest = diagnose_start(expansions(examination, AT_REST), expected)
        return tuple(each for each in (start, from_rest) if each is not None)
    named = _at(found, start)
    if not named:
        order = _order(found)
        low = diagnose_order_1(found, expected) if order == 1 else None
        if low is None or (expected <= 1 and low.cause != "in-place"):
            low = _order_alone(found, order, expected)
        named = (low,)
    if named[0].cause == "unknown":
        other = _other_method(examination)
        seen = min(each.seen for each in found) >= 1
        return (other,) if other else (seen and _elsewhere(examination, expected)) or named
    remedy, order = named[0].remedy, _order(found)
    named = tuple(_with_stages(each, examination) for each in named)
    if {cause.cause for cause in named} <= _OF_A_METHOD:
        named = tuple(_with_tableau(each, examination, expected) for each in named)
    first, *others = named
    # Coefficients that are wrong explain the order by themselves.
    unexplained = first.cause in _OF_COSTS and first.remedy == remedy and not others
    if unexplained and order is not None and order < expected:
        return (_with_cost(first, examination, found, order, expected),)
    return named


def _at(found: Sequence[Expansion], start: Diagnosis | None) -> tuple[Diagnosis, ...]:
    """What is wrong at dt = 0, at the states of expansions."""
    identity = diagnose_identity(found)
    causes = [identity, start]
    if identity is None:
        causes.append(diagnose_equation(found))
    elif (kept := identity.evidence.get("kept")) is not None:
        causes.append(diagnose_equation(found, np.array(kept)))
    return tuple(cause for cause in causes if cause is not None)


def _elsewhere(examination: Examination, expected: int) -> tuple[Diagnosis, ...]:
    """What is wrong at states far from the usual ones, at which nothing is."""
    for region in ELSEWHERE:
        found = expansions(examination, region)
        named = _at(found, None)
        order = _order(found)
        if not named and order is not None and order < min(expected, min(e.seen for e in found)):
            named = (_order_alone(found, order, expected),)
        if named:
            return tuple(
                dataclasses.replace(
                    each,
                    line=f"{region.words}, and not otherwise: {each.line}",
                    remedy="let the same formula hold everywhere: look for a threshold or a limit",
                )
                for each in named
            )
    return ()


def _sentences(first: str, *others: str) -> str:
    """Clauses, of which the first is left without a capital."""
    capital = (f"{each[0].upper()}{each[1:]}" for each in others)
    return ". ".join([f"{first[0].lower()}{first[1:].rstrip('.')}", *capital])


def _recognised(stepper: Stepper, declared: int | None = None) -> tuple[Any, str]:
    """The method with a name that a step is, or nearly is, and a sentence; None if it is none."""
    tableau = tableau_of(stepper, probe_ropes()[0]).tableau
    method = None if tableau is None else recognised(tableau)
    return method, describe(tableau, declared) if tableau is not None and method else ""


def _with_tableau(diagnosis: Diagnosis, examination: Examination, expected: int) -> Diagnosis:
    """A diagnosis with the Runge-Kutta method that the step is, if it is one that has a name."""
    stepper = examination.stepper
    if stepper.needs == "second order, linear damping":
        # Its tableau is read without damping, of which it treats itself.
        return diagnosis
    method, words = _recognised(stepper, expected or None)
    if method is None:
        return diagnosis
    also = [diagnosis.line] if diagnosis.cause == "stage-time" else []
    return dataclasses.replace(
        diagnosis,
        line=_sentences(words, *also),
        evidence={**diagnosis.evidence, "method": words},
        remedy="; ".join(method.corrections) or diagnosis.remedy,
    )


def _with_stages(diagnosis: Diagnosis, examination: Examination) -> Diagnosis:
    """A diagnosis that no combination of terms explains, with a state that is lost in a stage."""
    if "difference" not in diagnosis.evidence:
        return diagnosis
    reason = tableau_of(examination.stepper, probe_ropes()[0]).reason
    if not reason.startswith("multiplies"):
        return diagnosis
    line = _sentences(f"the step {reason}", diagnosis.line)
    return dataclasses.replace(
        diagnosis, line=line, remedy="let each stage begin with y + dt * ..."
    )


def _other_method(examination: Examination) -> Diagnosis | None:
    """The method that a step is in place of the one that is claimed, if it is one with a name."""
    claimed = examination.claims.method
    if claimed in (None, examination.stepper.label):
        return None
    method, words = _recognised(examination.stepper)
    if method is None or method == _recognised(as_stepper(claimed))[0]:
        return None
    line = f"{_sentences(words)}; it is claimed to be {claimed}"
    return Diagnosis("method", line, {"method": words}, "; ".join(method.corrections))


def _with_cost(
    diagnosis: Diagnosis,
    examination: Examination,
    found: Sequence[Expansion],
    order: int,
    expected: int,
) -> Diagnosis:
    """A diagnosis of an order that is too low, with what costs it: some of `_COSTS`, or digits."""
    told = [each for each in _COSTS if each.field not in examination.cannot_be_told]
    best, costs = order, tuple[_Cost, ...]()
    for several in itertools.chain(*(itertools.combinations(told, n) for n in range(1, 4))):
        if best < expected:
            without = expansions(examination, changed=[each[:2] for each in several])
            reached = _order(without) or expected
            if reached > best:
                best, costs, found = reached, several, without
    lines, remedies = [], [each.remedy for each in costs]
    if costs:
        words = " and ".join(each.words for each in costs)
        with_them = f"{order} with {'it' if costs == _COSTS[:1] else 'them'}"
        lines.append(
            f"right without {words}: order {best}; {with_them}"
            if best >= expected
            else f"order {best} without {words}, {with_them}; order {expected} is expected"
        )
    if best < expected:
        terms = (each.rate(best) for each in found)
        part = max(
            np.max(np.max(np.abs(each.value), axis=(2, 3)).T / each.natural) for each in terms
        )
        if part < _FEW_DIGITS:
            lines.append(
                f"its term of dt^{best + 1} is only {part:.1g} of the solution's own, as "
                "coefficients with few digits leave it"
            )
            remedies.append("write the coefficients as fractions and roots, with all digits")
    if not lines:
        return diagnosis
    if costs == _COSTS[:1] and best >= expected:
        if expected == 2 and diagnosis.cause == "lagged-damping":
            remedies = [diagnosis.remedy]
        remedies.append(f"or claim order {order} on problems with damping")
    return dataclasses.replace(
        diagnosis,
        line=_sentences(*lines, diagnosis.line),
        evidence={**diagnosis.evidence, "costs": {each.field: best for each in costs}},
        remedy="; ".join(remedies) or diagnosis.remedy,
    )


def _order(found: Sequence[Expansion]) -> int | None:
    orders = [each.order for each in found if each.order is not None]
    return min(orders) if orders else None


def _order_alone(found: Sequence[Expansion], order: int | None, expected: int) -> Diagnosis:
    """What is known of a step whose equation is right, and whose order has no known cause."""
    states = sum(len(each.t) for each in found)
    evidence = {"order": order, "expected": expected or None, "states": states}
    right = "the step solves the right equation, with"
    if order is None:
        seen = min(HIGHEST_ORDER, *(each.seen for each in found))
        line = f"{right} an order above {seen}; rounding hides more"
        if seen < 1:
            line = (
                "what a step does follows no whole powers of dt: is there another power, rounding, "
                "or a threshold of dt?"
            )
        return Diagnosis("unknown", f"at {states} random states {line}", evidence)
    every = np.concatenate([each.orders for each in found], axis=1)
    # Where rounding hides the terms of one quantity, the other has the order.
    x, v = (int(np.nanmin(row, initial=np.inf) if np.any(row == row) else order) for row in every)
    orders = f"order {x}" if x == v else f"order {x} in positions and {v} in velocities"
    if order >= expected:
        return Diagnosis(
            "unknown",
            f"at {states} random states {right} {orders}: what is wrong shows at other states, "
            "times or step sizes, or after many steps",
            evidence,
        )
    sizes = [np.abs(each.rate(order).value[:, 0 if x == order else 1]) for each in found]
    where = where_off(found, sizes, _NONE * max(map(np.max, sizes)))
    return Diagnosis(
        "order",
        f"{right} local {orders}{where or f' at all of {states} random states'}; order {expected} "
        "is expected",
        evidence,
        "use the same formula at all nodes, along all axes and at all times"
        if where
        else f"use a method of order {expected}, or claim order {order}",
    )
