"""The shipped recording: it is what the page asks first, and what Python answers now."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from ropeode import Rope, simulate
from ropeode.laboratory import (
    DEFAULT_LADDER,
    DEFAULT_PROBLEM,
    DEFAULT_STEPPERS,
    Laboratory,
    answers_in,
    asks_of,
    recorded,
)
from ropeode.laboratory.messages import AskRun, ProblemChoice
from ropeode.progress import silent
from tests.laboratory.conftest import ROPE
from tools.default_recording import FILE

MEND = "run make recording"
# What differs from machine to machine: times, and what is estimated from rounding.
ESTIMATES = {"seconds", "round_off", "resolution", "bound", "energy_bound", "certificate"}


@pytest.fixture(scope="module")
def shipped():
    return list(answers_in(FILE.read_text()))


def default_asks():
    return asks_of(Laboratory(), DEFAULT_PROBLEM, DEFAULT_STEPPERS, DEFAULT_LADDER)


def test_it_answers_what_the_page_asks_first(shipped):
    assert FILE.stat().st_size < 1_300_000
    assert [ask for ask, _, _ in shipped] == list(default_asks()), MEND
    assert all(header["kind"] == ask.kind for ask, header, _ in shipped)


def test_its_library_is_that_of_today(shipped, ask):
    question, header, _ = shipped[0]
    today, _ = ask(question)
    assert header == {**today.model_dump(mode="json"), "key": ""}, MEND


def test_its_ropes_move_as_those_of_today(shipped):
    problem = Rope().problem(frames=40)
    answers = {(each.kind, getattr(each, "stepper", None)): a for each, _, a in shipped}
    points = answers["truth", None]["points"]
    start = problem.positions(problem.y0[None])[0].astype(np.float32)
    assert np.array_equal(points[0], start)
    for each, header, arrays in shipped:
        if each.kind != "run" or each.steps_per_frame != DEFAULT_LADDER[0]:
            continue
        run = simulate(problem, each.stepper, each.steps_per_frame, progress=silent)
        drawn = points[: len(arrays["differences"])] + arrays["differences"].astype(float)
        at_frames = drawn[::4][: len(run.times)]
        # What flies apart depends on rounding, which differs from machine to machine.
        kept = int(np.argmin(np.append(np.max(np.abs(run.positions), axis=(1, 2)) < 1e3, False)))
        at_frames, own = at_frames[:kept], run.positions[:kept]
        assert kept >= 4
        assert (header["status"], header["dt"]) == (run.status, run.dt)
        np.testing.assert_allclose(at_frames, own, rtol=1e-5, atol=1e-4 * 400)


def test_a_recording_has_refusals_too(laboratory):
    asks = [
        AskRun(kind="run", problem=ROPE, stepper="rk4", steps_per_frame=16),
        AskRun(kind="run", problem=ProblemChoice(name="nothing"), stepper="rk4", steps_per_frame=1),
    ]
    text = recorded(asks, laboratory, silent)
    (run, header, arrays), (_, refused, _) = answers_in(text)
    assert run == asks[0]
    assert (header["stepper"], header["key"]) == ("rk4", "")
    assert arrays["differences"].shape == (25, 4, 2)
    assert refused["kind"] == "refused"
    assert "'nothing' given" in refused["message"]
    assert all(set(each) == {"ask", "wire"} for each in json.loads(text))


@pytest.mark.slow
def test_all_of_it_is_what_python_answers_today(shipped, laboratory):
    text = recorded(default_asks(), laboratory, silent)
    for (question, was, old), (_, is_now, new) in zip(shipped, answers_in(text), strict=True):
        assert set(was) == set(is_now), question
        for name in set(was) - ESTIMATES:
            same = was[name] == is_now[name]
            if isinstance(was[name], float):
                same = math.isclose(was[name], is_now[name], rel_tol=1e-3)
            assert same, (question, name, MEND)
        assert {name: each.shape for name, each in old.items()} == {
            name: each.shape for name, each in new.items()
        }
        for name in set(old) - ESTIMATES:
            size = float(np.max(np.abs(old[name]), initial=0.0))
            np.testing.assert_allclose(old[name], new[name], rtol=1e-3, atol=1e-6 * size)
