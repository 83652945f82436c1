"""When float64 loses its digits, and what longer spans take."""

from __future__ import annotations

import math

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import Problem, horizon
from ropeode.problems import PROBLEMS
from ropeode.references.extended.taylor import solve
from ropeode.render import format_horizon
from tests.results import check_result

pytest.importorskip("heyoka", reason="heyoka is an extra")


# Seconds that no run takes, however busy the machine is.
NEVER = 1e9


def lorenz(t, y, args):
    return jnp.stack([10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]])


@pytest.fixture(scope="module")
def chaotic():
    """Lorenz: 0.39 digits in each time unit; float64 has lost all of them after 40 or so."""
    problem = Problem(lorenz, [1.0, 1.0, 20.0], np.linspace(0, 48, 97), name="lorenz")
    return horizon(problem, [20, 40, 80], time_limit=NEVER)


@pytest.mark.slow
def test_float64_loses_all_its_digits(chaotic):
    left = {each.digits: each for each in chaotic.digits_left}
    for each in (left[12], left[4], left[1]):
        assert each.certificate <= each.reference <= each.luckiest
    # 11 digits at 0.9056/ln 10 each time unit, give or take what ten units differ by.
    assert left[1].reference - left[12].reference == pytest.approx(11 / 0.393, rel=0.25)
    assert chaotic.runs[0].errors[-1] > 0.1
    assert chaotic.reference.horizon < 48
    assert chaotic.worst_cover < 1

    # All that grows grows alike: float64 runs, extended runs and tangents measure one rate.
    float64, extended = chaotic.float64_growth, chaotic.extended_growth
    assert float64.law == extended.law == "exponential"
    for growth in (float64, extended, chaotic.exponent):
        assert growth.interval[0] < 0.9056 < growth.interval[1]
    # Float64 differences are used while they are above rounding and below saturation.
    assert chaotic.times[0] < float64.start < float64.end < chaotic.times[-1]


@pytest.mark.slow
def test_what_is_measured_is_what_the_runs_lost(chaotic):
    """Against a third run: its distance from the finer one, in digits of its precision."""
    other = solve(chaotic.problem, precision=100)
    truth = chaotic.truth.states
    apart = np.max(np.abs(other.rounded - truth), axis=1)
    seen = apart > 1e-9
    lost = 100 * math.log10(2) + np.log10(np.maximum.accumulate(apart)[seen] / chaotic.size)
    if np.any(seen):
        assert np.max(np.abs(lost - chaotic.lost[seen])) < 1.0
    at_20, at_40, _ = chaotic.needs
    assert (at_20.measured, at_40.measured) == (True, True)
    assert at_40.digits == pytest.approx(18 + np.interp(40, chaotic.times, chaotic.lost))


@pytest.mark.slow
def test_a_prediction_holds(chaotic):
    """What half the span foretells of the rest, against what the whole one lost."""
    half = Problem(lorenz, [1.0, 1.0, 20.0], np.linspace(0, 24, 97))
    need = horizon(half, [40], time_limit=NEVER).needs[0]
    assert not need.measured
    assert need.bits == math.ceil(need.interval[1] * math.log2(10))
    # Enough, and within two runs' chance, which is 1.34 digits for each pair.
    assert chaotic.needs[1].digits <= need.interval[1]
    assert need.digits == pytest.approx(chaotic.needs[1].digits, abs=2 * 1.34)


def test_nothing_is_lost():
    calm = horizon(PROBLEMS["oscillator"](frames=4), [4, 100], time_limit=NEVER)
    check_result(calm)
    # One unit of rounding in a state of size 1 is 2.2e-16, and there are not a hundred of them.
    assert all(each.digits >= 14 for each in calm.digits_left if each.reference is not None)
    assert calm.float64_growth is calm.extended_growth is None
    # Nothing but rounding is added in 100 time units.
    known, need = calm.needs
    assert (known.measured, need.measured) == (True, False)
    assert known.digits == 18 + calm.lost[-1] == 18 + known.lost
    assert need.digits < 18 + 3
    assert need.bits == math.ceil(need.interval[1] * math.log2(10))
    # The rounding of later steps adds up: between not at all and all in one direction, which
    # makes it as many times larger as the span is longer. How much there was is known up to itself.
    most = math.log10(100 / 4)
    assert need.lost - known.lost == pytest.approx(most / 2, abs=known.lost)
    assert need.interval[0] <= 18 + known.lost
    assert need.interval[1] >= 18 + known.lost + most
    assert calm.exponent.value == pytest.approx(-0.05, abs=0.02)


@pytest.mark.slow
def test_a_truth_that_ends_early():
    """At the pole of 1/(1 - t)."""
    problem = Problem(lambda t, y, args: y**2, [1.0], 0.3 * np.arange(5))
    study = horizon(problem, [0.6, 2.0], time_limit=NEVER)
    assert study.times[-1] == pytest.approx(0.9)
    assert [need.measured for need in study.needs] == [True, False]
    assert study.needs[0].digits < 18 + 3
    assert len(study.bound) == len(study.lost) == len(study.runs[0].errors) == len(study.times)
    words = " ".join(format_horizon(study).split())
    assert f"up to t = 0.9 only ({study.truth.failure})" in words
