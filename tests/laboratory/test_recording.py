"""Recordings, and the one that is shipped: what the page asks first, as Python answers it now."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from ropeode.laboratory import (
    DEFAULT_LADDER,
    DEFAULT_PROBLEM,
    DEFAULT_STEPPERS,
    Laboratory,
    answers_in,
    asks_ahead,
    asks_of,
    recorded,
)
from ropeode.laboratory.messages import AskLibrary, AskRun, ProblemChoice
from ropeode.progress import silent
from tools.default_recording import FILE

MEND = "run make recording"
# What differs from machine to machine: times, and what is estimated from rounding.
ESTIMATES = {"seconds", "resolution", "bound", "energy_bound", "certificate"}


@pytest.fixture(scope="module")
def shipped():
    return list(answers_in(FILE.read_text()))


def default_asks():
    return asks_of(Laboratory(), DEFAULT_PROBLEM, DEFAULT_STEPPERS, DEFAULT_LADDER)


def test_the_worker_prepares_what_the_next_press_of_the_key_asks(shipped):
    asked = [ask for ask, _, _ in shipped]
    most = max(each.steps_per_frame for each in asked if isinstance(each, AskRun))
    truth, *runs = itertools.islice(asks_ahead(), 4)
    assert truth in asked
    next_press = {"kind": "run", "problem": DEFAULT_PROBLEM, "steps_per_frame": 2 * most}
    assert runs == [AskRun(stepper=each, **next_press) for each in DEFAULT_STEPPERS]


def test_it_answers_what_the_page_asks_first(shipped, ask):
    assert FILE.stat().st_size < 1_300_000
    assert [question for question, _, _ in shipped] == list(default_asks()), MEND
    assert all(header["kind"] == question.kind for question, header, _ in shipped)
    library, (today, _) = shipped[0][1], ask({"kind": "library"})
    assert library == {**today.model_dump(mode="json"), "key": ""}, MEND


def test_a_recording_has_refusals_too(laboratory):
    question = AskRun(
        kind="run", problem=ProblemChoice(name="nothing"), stepper="rk4", steps_per_frame=1
    )
    asks = [AskLibrary(kind="library"), question]
    answers = [*answers_in(recorded(asks, laboratory, silent))]
    assert [ask for ask, _, _ in answers] == asks
    (_, library, _), (_, refused, _) = answers
    assert (library["kind"], library["key"]) == ("library", "")
    assert refused["kind"] == "refused"
    assert "'nothing' given" in refused["message"]


@pytest.mark.slow
def test_all_of_it_is_what_python_answers_today(shipped, laboratory):
    text = recorded(default_asks(), laboratory, silent)
    for (question, was, old), (_, is_now, new) in zip(shipped, answers_in(text), strict=True):
        assert (set(was), set(old)) == (set(is_now), set(new)), question
        for name in set(was) - ESTIMATES:
            same = was[name] == is_now[name]
            if isinstance(was[name], float):
                same = math.isclose(was[name], is_now[name], rel_tol=1e-3)
            assert same, (question, name, MEND)
        for name, values in old.items():
            assert values.shape == new[name].shape
            if name not in ESTIMATES:
                size = float(np.max(np.abs(values), initial=0.0))
                np.testing.assert_allclose(values, new[name], rtol=1e-3, atol=1e-6 * size)
