"""What was found, in a sentence and in numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ropeode.analysis.order import ObservedOrder
from ropeode.checking.convergence import TOLERANCE
from ropeode.checking.diagnosis.equation import Equation
from ropeode.checking.report import Diagnosis


def told(equations: Sequence[Equation], reasons: Sequence[tuple[str, ...]]) -> Diagnosis:
    """The diagnosis in words.

    Arguments:
        equations: ropes that cannot be told apart, at least one.
        reasons: for each what may be the mistake.
    """
    first = equations[0]
    line = f"your stepper solves, to {in_words(first)}, the rope with "
    if len(equations) == 1:
        line += ": ".join(filter(None, (_words(first), "; ".join(reasons[0]))))
    else:
        line += "; or, which no run can tell apart, with ".join(
            f"{_words(each)} ({'; '.join(texts)})" if texts else _words(each)
            for each, texts in zip(equations, reasons, strict=True)
        )
    hints = list(dict.fromkeys(text for texts in reasons for text in texts))
    return Diagnosis("parameters", line, _evidence(equations, hints))


def _words(found: Equation) -> str:
    return " and ".join(number.words for number in found.numbers)


def _evidence(equations: Sequence[Equation], hints: Sequence[str]) -> dict[str, Any]:
    first = equations[0]
    return {
        "parameters": {number.name: number.as_json() for number in first.numbers},
        "alternatives": [
            {number.name: number.as_json() for number in each.numbers} for each in equations[1:]
        ],
        "orders": {
            name: {"observed": order.observed, "ci95": order.ci95, "verdict": order.verdict}
            for name, order in first.orders.items()
        },
        "reference_bound": first.bound,
        "misfit": first.misfit,
        "hints": list(hints),
    }


def in_words(found: Equation) -> str:
    """The orders of all quantities, in a few words: whole numbers where they are near to one.

    Where too few step sizes have errors that the uncertainty of the numbers can tell, it is the
    order with which the runs tend to their limit.

    Arguments:
        found: the rope that is solved.
    """
    texts = {
        name: _order_in_words(order, found.tends_with[name]) for name, order in found.orders.items()
    }
    if len({*texts.values()}) == 1:
        return next(iter(texts.values()))
    return " and ".join(
        f"{text} ({'positions' if name == 'position' else 'velocities'})"
        for name, text in texts.items()
    )


def _order_in_words(order: ObservedOrder, tends_with: int | None) -> str:
    if order.observed is None:
        return "an unknown order" if tends_with is None else f"order {tends_with}"
    near = round(order.observed)
    return f"order {near if abs(order.observed - near) <= TOLERANCE else f'{order.observed:.2f}'}"
