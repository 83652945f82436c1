"""The words for motions, on motions that were made up so that the words are known."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ropeode import Problem, Rope
from ropeode.analysis import Thresholds, classify_motion, sensitivity
from ropeode.errors import InputError
from ropeode.problems import PROBLEMS
from ropeode.simulation import Trajectory, simulate

NODES = 5
LENGTH = 100.0
# In the units of the ropes here: V = sqrt(g L).
SPEED = 10.0
ROPE = {"num_nodes": NODES, "start": (0, 0), "end": (-LENGTH, 0), "damping": 0.0}


def run_of(problem: Problem, states: np.ndarray) -> Trajectory:
    """A run that made given states."""
    run = simulate(Rope(**ROPE).problem(1), "explicit-euler", 1)
    return dataclasses.replace(run, problem=problem, states=states, times=problem.ts[: len(states)])


def rod(angle: np.ndarray, rate: np.ndarray, stretch: Any = 0.0, stretching: Any = 0.0):
    """A straight rope at an angle from hanging down; stretched evenly."""
    # Energies are looked at in tests of their own.
    problem = Rope(**ROPE).problem(len(angle) - 1).changed(energy=None)
    out = np.stack([-np.sin(angle), -np.cos(angle)])
    across = np.stack([-np.cos(angle), np.sin(angle)])
    states = np.stack([(1 + stretch) * out, stretching * out + (1 + stretch) * rate * across])
    place = LENGTH * np.linspace(0, 1, NODES)
    return run_of(problem, np.moveaxis(states, 2, 0)[..., None] * place)


def swinging(frames: int, decay: float, omega: float = 0.12, start: float = 1.2):
    t = np.arange(frames + 1.0)
    size = start * np.exp(-decay * t)
    angle = size * np.cos(omega * t)
    return rod(angle, -size * (decay * np.cos(omega * t) + omega * np.sin(omega * t)))


def test_a_damped_swing():
    decay, omega, start = 0.005, 0.12, 1.2
    settling = np.log(start * np.hypot(omega, decay) * LENGTH / (1e-3 * SPEED)) / decay
    found = classify_motion(swinging(int(settling) + 200, decay))
    assert found.verdict == "settles"
    assert settling - np.pi / omega - 1 <= found.settled_at <= settling + 1
    # The free nodes' centre of mass is 5/8 of the length from the pin; extremes of the angle
    # that are beyond the threshold on both sides make a swing.
    phase = np.arctan2(decay, omega)
    extremes = start * np.cos(phase) * np.exp(-decay * (np.pi * np.arange(1, 200) - phase) / omega)
    assert found.swings == np.sum(np.sin(extremes) * 0.625 > 0.05)
    # A quarter period after the start, and half a period from one to the next. Between samples
    # the angle is no straight line: it bends by less than omega^2/8 of its size there.
    crossings = (np.arange(found.swings) + 0.5) * np.pi / omega
    np.testing.assert_allclose(found.swing_times, crossings, atol=0.02)
    assert max(found.jitter, found.largest_stretch) < 1e-14


def test_a_fall_without_a_swing():
    t = np.arange(400.0)
    found = classify_motion(rod(np.pi / 2 * np.exp(-t / 30), -np.pi / 60 * np.exp(-t / 30)))
    assert (found.verdict, found.swings) == ("settles_without_swinging", 0)
    settling = 30 * np.log(np.pi / 60 * LENGTH / (1e-3 * SPEED))
    assert found.settled_at == int(np.ceil(settling))
    vertical = 30 * np.log(np.pi / 2 / np.arcsin(0.05 / 0.625))
    assert found.reached_vertical_at == int(np.ceil(vertical))


def test_a_rest_that_ends_in_divergence():
    still, rate, tiny = 200, 0.3, 1e-10
    t = np.arange(400.0)
    stretch = tiny * np.exp(rate * (t - still))
    found = classify_motion(rod(0.0 * t, 0.0 * t, stretch, rate * stretch))
    assert (found.verdict, found.settled_at) == ("diverges", 0)
    assert found.diverged_at == int(np.ceil(still + np.log(1 / tiny) / rate))
    assert found.unsettled_at == int(np.ceil(still + np.log(1e-2 / (tiny * rate * LENGTH)) / rate))
    assert found.largest_stretch == pytest.approx(stretch[found.diverged_at - 1])
    assert np.isfinite(found.jitter)


@pytest.mark.parametrize("bad", [np.nan, 1e300, None])
def test_a_run_cut_short_or_without_numbers_has_diverged(bad):
    run = swinging(100, 0.0)
    if bad is None:
        cut = {"states": run.states[:70], "times": run.times[:70]}
        wrong = dataclasses.replace(run, **cut, status="diverged", diverged_at=70)
    else:
        wrong = dataclasses.replace(run, states=run.states.copy())
        wrong.states[70:, 0, 0, 2] = bad
        with pytest.raises(InputError, match="'a first sample that has diverged' given"):
            classify_motion(dataclasses.replace(run, states=wrong.states[70:]))
    found = classify_motion(wrong)
    assert (found.verdict, found.diverged_at, found.frames) == ("diverges", 70, 69)
    assert found.swings == classify_motion(swinging(69, 0.0)).swings


def test_jitter_is_the_rate_at_which_springs_change_length():
    # Every spring's length oscillates by a thousandth with 0.7 per frame: a mean square of half.
    t = np.arange(1001.0)
    run = rod(0.0 * t, 0.0 * t, 1e-3 * np.sin(0.7 * t), 1e-3 * 0.7 * np.cos(0.7 * t))
    found = classify_motion(run)
    # Over 100 frames the mean of cos^2 differs from 1/2 by less than 1/(2 * 100 * 0.7).
    assert found.jitter == pytest.approx(7e-4 / np.sqrt(2), rel=0.01)
    assert found.largest_stretch == pytest.approx(1e-3, rel=1e-3)


def test_energy_is_counted_from_hanging_still():
    # Hanging, spring i (of 3) bears 3 - i nodes: sum of the tensions' works and of the heights.
    # Straight and level, where the rope starts, it has no energy of either kind.
    problem = Rope(num_nodes=4, start=(0, 0), end=(-90, 0)).problem(410)
    states = np.stack([problem.y0] * 411)
    states[401:] *= np.nan
    found = classify_motion(run_of(problem, states))
    tension = np.arange(3.0, 0.0, -1)
    hanging = np.sum(tension**2) / 200 - np.sum(tension * (30 + tension / 100))
    assert found.energy_at_rest == pytest.approx(hanging, rel=1e-13)
    np.testing.assert_allclose(found.energy, [-hanging] * 401, rtol=1e-13)


turns = st.floats(0, 2 * np.pi)


def lively_rope(turn: np.ndarray, length: float, time: float) -> Problem:
    """A rope in other units and from another side."""
    rope = Rope(
        num_nodes=4, start=(0, 0), end=length * turn @ (-30, 10), damping=0.04 / time,
        stiffness=40 / time**2, gravity=length / time**2 * turn @ (0, -1),
    )  # fmt: skip
    problem = rope.problem(400)
    return problem.changed(ts=time * problem.ts)


@pytest.fixture(scope="module")
def lively():
    return simulate(lively_rope(np.eye(2), 1.0, 1.0), "velocity-verlet", 16)


@settings(max_examples=3, deadline=None)
@given(turns, st.sampled_from([-1.0, 1.0]), st.floats(0.01, 100), st.floats(0.1, 10))
def test_words_depend_on_no_units_and_no_direction(lively, angle, mirror, length, time):
    usual = classify_motion(lively)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turn = turn * [mirror, 1.0]
    states = turn @ lively.states * np.array([length, length / time])[:, None, None]
    problem = lively_rope(turn, length, time)
    turned = dataclasses.replace(lively, problem=problem, states=states, times=problem.ts)
    found = classify_motion(turned)
    for name in ("verdict", "settled_at", "swings", "reached_vertical_at"):
        assert getattr(found, name) == getattr(usual, name)
    np.testing.assert_allclose(found.swing_times, usual.swing_times * time, rtol=1e-9)
    assert found.jitter == pytest.approx(usual.jitter, rel=1e-6)
    assert found.largest_stretch == pytest.approx(usual.largest_stretch, rel=1e-9)
    square = (length / time) ** 2
    np.testing.assert_allclose(found.energy, usual.energy * square, atol=1e-9 * square * 1e3)
    words = [each.verdict for each in sensitivity(lively)]
    assert [each.verdict for each in sensitivity(turned)] == words


def test_in_space_a_rope_that_hangs_at_first_is_seen_along_its_motion():
    t, azimuth = np.arange(301.0), 2.0
    run = rod(np.sin(0.1 * t), 0.1 * np.cos(0.1 * t))
    end = (-LENGTH * np.cos(azimuth), 0.0, -LENGTH * np.sin(azimuth))
    problem = Rope(num_nodes=NODES, start=(0, 0, 0), end=end).problem(300).changed(energy=None)
    # The plane of the motion goes through the vertical.
    turn = np.array([[np.cos(azimuth), 0], [0, 1], [np.sin(azimuth), 0]])
    found = classify_motion(dataclasses.replace(run, problem=problem, states=turn @ run.states))
    np.testing.assert_allclose(found.swing_times, np.pi * np.arange(1, 10) / 0.1, atol=0.01)
    assert found.reached_vertical_at == 0


def test_a_rest_counts_only_if_it_lasts_and_sensitivity_shows_a_verdict_on_the_edge():
    settled = classify_motion(swinging(3000, 0.01)).settled_at
    # The rest lasts from `settled` to the last frame, and 5 T = 50 frames are asked for.
    assert classify_motion(swinging(settled + 50, 0.01)).verdict == "settles"
    assert classify_motion(swinging(settled + 49, 0.01)).verdict == "never_settles"
    changed = sensitivity(swinging(settled + 60, 0.01))
    assert len(changed) == 8
    # Half the speed is reached ln(2)/0.01 = 69 frames later, after the end.
    differing = {(each.threshold, each.value) for each in changed if each.differs}
    assert differing == {("rest", 10.0), ("speed", 5e-4)}


@pytest.mark.parametrize(
    ("problem", "message"),
    [
        (Rope(num_nodes=1).problem(2), "num_nodes: 1 given"),
        (Rope(gravity=(0, 0)).problem(2), r"gravity: \[0.0, 0.0\] given"),
        (Rope(num_nodes=2, pinned=(0, 1)).problem(2), r"pinned: \[0, 1\] given"),
        (PROBLEMS["oscillator"](2), "trajectory: 'oscillator' given"),
        (Problem(lambda t, y, args: -y, [1.0], [0.0, 1.0, 2.0]), "trajectory: 'problem' given"),
    ],
)
def test_other_motions_have_no_words(problem, message):
    run = simulate(problem, "explicit-euler", 4)
    for judge in (classify_motion, sensitivity):
        with pytest.raises(InputError, match=message):
            judge(run)
    with pytest.raises(InputError, match="speed: 0.0 given"):
        Thresholds(speed=0.0)
