"""Which runs are the best for their cost, and the cost of an error, against brute force."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ropeode.study.pareto import cost_to_reach, pareto_front

# Few different values, so that many points are equal in one of the two.
NUMBERS = st.sampled_from([0.5, 1.0, 2.0, 3.0, 7.0]) | st.floats(1e-12, 1e6)
POINTS = st.lists(st.tuples(NUMBERS, NUMBERS), max_size=12)


def beats(a, b):
    return a[0] <= b[0] and a[1] <= b[1] and a != b


@given(POINTS)
def test_the_front_is_what_no_point_beats(points):
    front = pareto_front(points)
    unbeaten = {point for point in points if not any(beats(other, point) for other in points)}
    assert {points[i] for i in front} == unbeaten
    assert len(front) == len(unbeaten)
    costs = [points[i][0] for i in front]
    assert costs == sorted(costs)
    assert all(points.index(points[i]) == i for i in front)


@given(st.lists(st.none() | st.tuples(NUMBERS, NUMBERS), max_size=8), NUMBERS)
def test_nothing_is_extrapolated(points, error):
    """The least of all costs that one can read from the picture by brute force."""
    known = [point for point in points if point is not None]
    found = cost_to_reach(error, points)
    if not any(each <= error for _, each in known):
        assert found is None
        return
    candidates = [cost for cost, each in known if each <= error]
    for a, b in itertools.pairwise(points):
        if a is None or b is None or not min(a[1], b[1]) < error < max(a[1], b[1]):
            continue
        slope = math.log(b[0] / a[0]) / math.log(b[1] / a[1])
        candidates.append(a[0] * (error / a[1]) ** slope)
    assert found is not None
    assert found.cost == pytest.approx(min(candidates), rel=1e-9)
    assert min(cost for cost, _ in known) * (1 - 1e-9) <= found.cost
