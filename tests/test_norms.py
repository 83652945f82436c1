"""Norms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from ropeode.errors import InputError
from ropeode.norms import NORMS, distance, norm_for
from ropeode.problems import Problem, Rope

ROPE = Rope(num_nodes=3).problem(frames=2)
DECAY = Problem(lambda t, y, args: -y, np.ones((2, 3)), [0.0, 1.0])
STATES = hnp.arrays(np.float64, (4, 2, 2, 3), elements=st.floats(-1e150, 1e150))


def fitting(problem):
    return [norm for norm in NORMS.values() if norm.quantity in problem.quantities]


@given(a=STATES, b=STATES)
def test_no_norm_exceeds_the_largest_node(a, b):
    """And each is symmetric, and zero for equal states."""
    for norm in fitting(ROPE):
        apart = distance(ROPE, norm, a, b)
        largest = distance(ROPE, NORMS[f"{norm.quantity}-max"], a, b)
        assert np.all(apart <= largest * (1 + 1e-14))
        assert np.array_equal(apart, distance(ROPE, norm, b, a))
        assert np.all(distance(ROPE, norm, a, a) == 0)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_as_far_as_can_be(value):
    a, b = np.zeros((2, 3, 2, 2, 3))
    a[1, :, 0, 1] = value
    for norm in fitting(ROPE):
        expected = [0.0, np.finfo(np.float64).max / (3**0.5 if "rms" in norm.name else 1), 0.0]
        np.testing.assert_allclose(distance(ROPE, norm, a, b), expected)


@pytest.mark.parametrize("norm", NORMS.values(), ids=NORMS)
def test_scales_like_a_norm(norm):
    problem = ROPE if norm in fitting(ROPE) else DECAY
    draw = np.random.default_rng(3).normal(size=(5, *problem.y0.shape))
    zero = np.zeros_like(draw)
    one = distance(problem, norm, draw, zero)
    for factor in (1e-200, 3.0, 1e200):
        scaled = distance(problem, norm, factor * draw, zero)
        np.testing.assert_allclose(scaled, factor * one, rtol=1e-13)


def test_values():
    a, b = np.zeros((2, 1, 2, 2, 3))
    a[0, 0, :, 1] = (3.0, 4.0)
    a[0, 1, :, 2] = (6.0, -8.0)
    found = {norm.name: distance(ROPE, norm, a, b)[0] for norm in fitting(ROPE)}
    largest = {"position-max": 5.0, "velocity-max": 10.0}
    mean = {"position-rms": np.sqrt(25 / 3), "velocity-rms": np.sqrt(100 / 3)}
    assert found == pytest.approx({**largest, **mean})


def test_what_does_not_fit_into_float64_is_still_a_number():
    a = np.full((1, 2, 2, 3), 1.7e308)
    for norm in fitting(ROPE):
        assert np.isfinite(distance(ROPE, norm, a, -a)).all()
        assert distance(ROPE, norm, a, -a)[0] > 1e308


def test_blocks_make_no_difference(monkeypatch):
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 37, 2, 2, 3))
    whole = distance(ROPE, NORMS["position-max"], a, b)
    monkeypatch.setattr("ropeode.norms._BLOCK_BYTES", 5 * ROPE.y0.nbytes)
    assert np.array_equal(distance(ROPE, NORMS["position-max"], a, b), whole)


def test_a_norm_is_named_or_given():
    assert norm_for(ROPE).name == "position-max"
    assert norm_for(DECAY).name == "state-max"
    for norm in fitting(ROPE):
        assert norm_for(ROPE, norm.name) == norm_for(ROPE, norm) == norm
    for wrong in ("velocity", "state-max", NORMS["state-max"], 3, ["velocity-max"], np.zeros(2)):
        with pytest.raises(InputError, match="norm: .* given"):
            norm_for(ROPE, wrong)
    with pytest.raises(InputError, match="did you mean 'position-max'"):
        norm_for(ROPE, "positon-max")
