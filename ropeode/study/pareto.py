"""Which runs are the best for their cost, and the cost that an error has."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """The points that no other one beats: none costs less with no larger error, or the reverse.

    Of points that are equal, the first stands for all.

    Arguments:
        points: cost and error of each.

    Returns:
        Their indices, from cheap to costly.
    """
    front: list[int] = []
    least = math.inf
    for index in sorted(range(len(points)), key=lambda i: (*points[i], i)):
        if points[index][1] < least:
            least = points[index][1]
            front.append(index)
    return front


class Reached(NamedTuple):
    """The cost at which a method reaches an error.

    Fields:
        cost: in the unit of its axis.
        at_most: it is that of a run whose error is smaller, since none has a larger one.
    """

    cost: float
    at_most: bool


def cost_to_reach(error: float, points: Iterable[tuple[float, float] | None]) -> Reached | None:
    """The least cost at which a method is known to have no larger an error than this.

    Between neighbouring efforts log(cost) is a straight line over log(error). Nothing is
    extrapolated: where all errors are larger, there is no cost; where all are smaller, the
    cheapest run costs at most what the error needs.

    Arguments:
        error: to be reached.
        points: cost and error of each effort, from cheap to costly; None for an effort whose error
            is not certified, over which nothing is interpolated.
    """
    reached: list[Reached] = []
    before = None
    for point in points:
        if point is not None and point[1] <= error:
            if before is not None and before[1] > error:
                reached.append(Reached(_between(error, before, point), False))
            reached.append(Reached(point[0], point[1] < error))
        elif point is not None and before is not None and before[1] < error:
            # The error grows with the effort, as that of round-off does.
            reached.append(Reached(_between(error, before, point), False))
        before = point
    return min(reached, key=lambda each: (each.cost, each.at_most), default=None)


def _between(error: float, a: tuple[float, float], b: tuple[float, float]) -> float:
    part = math.log(error / a[1]) / math.log(b[1] / a[1])
    return math.exp((1.0 - part) * math.log(a[0]) + part * math.log(b[0]))
