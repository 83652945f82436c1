"""When float64 loses its digits, and what longer spans take."""

from __future__ import annotations

import dataclasses
import math

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.analysis.lyapunov import LyapunovExponent
from ropeode.errors import InputError, ReferenceRefused
from ropeode.problems.oscillator import oscillator
from ropeode.problems.problem import Problem
from ropeode.references.extended.taylor import solve
from ropeode.references.solvers.solver import DOPRI8
from ropeode.render.formats import format_horizon
from ropeode.study import horizon as module
from ropeode.study.horizon import horizon
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
    for digits in (12, 8, 4, 1):
        each = left[digits]
        assert each.certificate <= each.reference <= each.luckiest
    # 11 digits at 0.9056/ln 10 each time unit, give or take what ten units differ by.
    assert left[1].reference - left[12].reference == pytest.approx(11 / 0.393, rel=0.25)
    assert chaotic.runs[0].errors[-1] > 0.1
    assert chaotic.reference.horizon < 48
    assert chaotic.worst_cover < 1


@pytest.mark.slow
def test_all_that_grows_grows_alike(chaotic):
    """Float64 runs, extended runs and tangents: three measurements of one rate."""
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
    assert at_20.measured
    assert at_40.measured
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


@pytest.mark.slow
def test_nothing_is_lost():
    study = horizon(oscillator(frames=4), [100], time_limit=NEVER)
    check_result(study)
    # One unit of rounding in a state of size 1 is 2.2e-16, and there are not a hundred of them.
    assert all(each.digits >= 14 for each in study.digits_left if each.reference is not None)
    assert study.float64_growth is None
    assert study.extended_growth is None
    # Nothing but rounding is added in 100 time units.
    assert study.needs[0].digits < 18 + 3
    assert study.exponent.value == pytest.approx(-0.05, abs=0.02)


def test_what_time_was_left_for(monkeypatch):
    """As if the time had run out after two frames of four."""

    def cut(problem, **more):
        return dataclasses.replace(solution(problem, **more), agreed=3, failure="time ran out")

    solution = module.extended_solution
    monkeypatch.setattr(module, "extended_solution", cut)
    study = horizon(oscillator(frames=4), [2, 100], time_limit=NEVER)
    assert study.times[-1] == 2.0
    assert [need.measured for need in study.needs] == [True, False]
    assert study.needs[0].digits < 18 + 3
    assert len(study.bound) == len(study.lost) == len(study.runs[0].errors) == len(study.times)
    assert "up to t = 2 only (time ran out)" in " ".join(format_horizon(study).split())


def test_a_truth_that_float64_contradicts_is_refused(monkeypatch):
    def wrong(problem, **more):
        found = solution(problem, **more)
        found.states[2:] *= 1 + 1e-9
        return found

    solution = module.extended_solution
    monkeypatch.setattr(module, "extended_solution", wrong)
    with pytest.raises(ReferenceRefused, match="from t = 2 on the runs in extended precision"):
        horizon(oscillator(frames=4), [100], time_limit=NEVER)


@pytest.mark.parametrize(
    ("spans", "words"),
    [
        ([], r"spans: \[\] given; allowed: one or more"),
        ([0], "spans: 0 given; allowed: a finite number > 0"),
        (["far"], "spans: 'far' given; allowed: a finite number > 0"),
        ([1e6], "spans: 1000000.0 given; allowed: at most 10000"),
    ],
)
def test_faults(spans, words):
    with pytest.raises(InputError, match=words) as raised:
        horizon(oscillator(), spans)
    assert all("Fix: " in line for line in raised.value.problems)


def test_every_fault_is_told():
    with pytest.raises(InputError) as raised:
        horizon(oscillator(), [0, -1])
    assert len(raised.value.problems) == 2


def test_the_rounding_of_later_steps_adds_up():
    """Between not at all and all in one direction: ten times the span, at most one digit more."""
    times = np.arange(11.0)
    still = [
        LyapunovExponent(0.0, (0.0, 0.0), 0.0, times, np.zeros((2, 11)), DOPRI8, 1e-10, None)
    ] * 2
    need = module._need(1000.0, 18, times, np.full(11, 0.3), still)
    assert need.lost == pytest.approx(0.3 + 1.0)
    assert need.interval[0] <= 18 + 0.3
    assert need.interval[1] >= 18 + 0.3 + 2.0
