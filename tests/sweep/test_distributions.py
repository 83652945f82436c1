"""Draws: the same everywhere, whatever else is drawn, and from the right distribution."""

import decimal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from ropeode.errors import InputError
from ropeode.sweep import Distribution

names = st.sampled_from(["damping", "stiffness", "stepper", "x"])
whole = st.integers(0, 2**31)


def draws(distribution: Distribution, count: int = 2000, name: str = "damping") -> np.ndarray:
    return np.array([distribution.value(5, draw, name, None) for draw in range(count)])


def test_uniform_and_log_uniform_are():
    uniform = draws(Distribution(uniform=[-1.0, 3.0]))
    assert stats.kstest(uniform, stats.uniform(-1, 4).cdf).pvalue > 0.01
    logs = draws(Distribution(log_uniform=[10.0, 1e4]))
    assert stats.kstest(logs, stats.loguniform(10, 1e4).cdf).pvalue > 0.01
    # The same random bits lie behind both.
    assert np.allclose((uniform + 1) / 4, np.log10(logs / 10) / 3, rtol=1e-13, atol=1e-13)


def test_integers_and_choices_are_as_likely():
    counts = np.bincount(draws(Distribution(integers=[3, 8])).astype(int))
    assert len(counts) == 9
    assert not counts[:3].any()
    assert stats.chisquare(counts[3:]).pvalue > 0.01
    chosen = draws(Distribution(choice=["a", "b", "c"]))
    assert stats.chisquare(np.unique(chosen, return_counts=True)[1]).pvalue > 0.01


def test_neighbours_are_independent():
    uniform = Distribution(uniform=[0.0, 1.0])
    series = [
        draws(uniform),
        draws(uniform, name="stiffness"),
        [uniform.value(6, draw, "damping", None) for draw in range(2000)],
        [uniform.value(5, draw, "damping", 2)[1] for draw in range(2000)],
        [*draws(uniform)[1:], 0.5],
    ]
    correlations = np.corrcoef(series) - np.eye(len(series))
    # Five standard deviations of the correlation of independent series of this length.
    assert np.max(np.abs(correlations)) < 5 / np.sqrt(2000)


@given(whole, whole, names, st.integers(1, 5), st.integers(1, 5))
@settings(max_examples=10, deadline=None)
def test_more_entries_leave_the_first_ones(seed, draw, name, few, more):
    distribution = Distribution(uniform=[[0.0, 5.0], [1.0, 6.0]])
    long = distribution.value(seed, draw, name, few + more)
    assert long[:few] == distribution.value(seed, draw, name, few)
    assert long[0] == distribution.value(seed, draw, name, None)
    assert all(0 <= x <= 1 and 5 <= y <= 6 for x, y in long)


@given(st.floats(1e-300, 1e300), st.floats(1.0, 1e5), whole)
@settings(max_examples=50, deadline=None)
def test_logarithms_are_rounded_rightly(low, factor, draw):
    high = min(low * factor, 1e300)
    drawn = Distribution(log_uniform=[low, high]).value(1, draw, "x", None)
    fraction = Distribution(uniform=[0.0, 1.0]).value(1, draw, "x", None)
    with decimal.localcontext(decimal.Context(prec=60)):
        start, end = decimal.Decimal(low), decimal.Decimal(high)
        exact = start * (end / start) ** decimal.Decimal(fraction)
        assert float(exact) == drawn
    assert low <= drawn <= high


def test_draws_are_the_same_everywhere_and_for_ever():
    drawn = Distribution(log_uniform=[1, 9]).value(3, 1, "x", 2)
    assert drawn == [2.717330389497861, 6.155352708015026]


def test_bad_distributions():
    for values in (
        *({"uniform": [1, 2, 3]}, {"uniform": [[1], 2]}, {"uniform": [[1, 2], [1]]}),
        *({"log_uniform": [0, 1]}, {"integers": [0.5, 1]}, {"integers": [2, 1]}),
        *({"choice": []}, {}),
    ):
        with pytest.raises(InputError, match="given; allowed: "):
            Distribution(**values)
