"""The shipped recording: it is what the page asks first, and what Python answers now."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from ropeode.laboratory import (
    DEFAULT_LADDER,
    DEFAULT_PROBLEM,
    DEFAULT_STEPPERS,
    Laboratory,
    answers_in,
    asks_of,
    recorded,
)
from ropeode.laboratory.messages import AskLibrary, AskRun, ProblemChoice
from ropeode.progress import silent
from tools.default_recording import FILE

MEND = "run make recording"
# What differs from machine to machine: times, and what is estimated from rounding.
ESTIMATES = {"seconds", "round_off", "resolution", "bound", "energy_bound", "certificate"}


@pytest.fixture(scope="module")
def shipped():
    return list(answers_in(FILE.read_text()))


def default_asks():
    return asks_of(Laboratory(), DEFAULT_PROBLEM, DEFAULT_STEPPERS, DEFAULT_LADDER)


def test_it_answers_what_the_page_asks_first(shipped, ask):
    assert FILE.stat().st_size < 1_300_000
    assert [question for question, _, _ in shipped] == list(default_asks()), MEND
    assert all(header["kind"] == question.kind for question, header, _ in shipped)
    question, library, _ = shipped[0]
    today, _ = ask(question)
    assert library == {**today.model_dump(mode="json"), "key": ""}, MEND


def test_a_recording_has_refusals_too(laboratory):
    asks = [
        AskLibrary(kind="library"),
        AskRun(kind="run", problem=ProblemChoice(name="nothing"), stepper="rk4", steps_per_frame=1),
    ]
    text = recorded(asks, laboratory, silent)
    (library, header, _), (_, refused, _) = answers_in(text)
    assert library == asks[0]
    assert (header["kind"], header["key"]) == ("library", "")
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
