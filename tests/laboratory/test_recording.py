"""Recordings: the one that is shipped, as Python answers it now, and those of labs in one file."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from ropeode import laboratory as room
from ropeode.cli import cli
from ropeode.laboratory.messages import AskRun, ProblemChoice
from ropeode.progress import silent
from tests.laboratory.conftest import ROPE
from tools.default_recording import FILE

MEND = "run make recording"
# What differs from machine to machine: times, and what is estimated from rounding.
ESTIMATES = {"seconds", "resolution", "bound", "energy_bound", "certificate"}


@pytest.fixture(scope="module")
def shipped():
    return list(room.answers_in(FILE.read_text()))


def default_asks():
    shown = room.DEFAULT_PROBLEM, room.DEFAULT_STEPPERS, room.DEFAULT_LADDER
    return room.asks_of(room.Laboratory(), *shown)


def test_it_answers_what_the_page_asks_first(shipped, ask):
    assert FILE.stat().st_size < 1_300_000
    assert [question for question, _, _ in shipped] == list(default_asks()), MEND
    assert all(header["kind"] == question.kind for question, header, _ in shipped)
    library, (today, _) = shipped[0][1], ask({"kind": "library"})
    assert library == {**today.model_dump(mode="json"), "key": ""}, MEND


def test_a_recording_has_refusals_too(laboratory):
    problem = ProblemChoice(name="nothing")
    question = AskRun(kind="run", problem=problem, stepper="rk4", steps_per_frame=1)
    ((ask, refused, _),) = room.answers_in(room.recorded([question], laboratory, silent))
    assert (ask, refused["kind"]) == (question, "refused")
    assert "'nothing' given" in refused["message"]


@pytest.mark.slow
def test_all_of_it_is_what_python_answers_today(shipped, laboratory):
    text = room.recorded(default_asks(), laboratory, silent)
    for (question, was, old), (_, is_now, new) in zip(shipped, room.answers_in(text), strict=True):
        assert (set(was), set(old)) == (set(is_now), set(new)), question
        for name in set(was) - ESTIMATES:
            same = was[name] == is_now[name]
            if np.asarray(was[name]).dtype == float:
                same = np.allclose(was[name], is_now[name], rtol=1e-3, atol=0.0)
            assert same, (question, name, MEND)
        for name, values in old.items():
            assert values.shape == new[name].shape
            if name not in ESTIMATES:
                size = float(np.max(np.abs(values), initial=0.0))
                np.testing.assert_allclose(values, new[name], rtol=1e-3, atol=1e-6 * size)


SCRIPT = re.compile(r'<script type="application/json" id="([^"]+)">(.*?)</script>', re.DOTALL)


def test_it_loads_nothing_and_its_certificate_can_be_read_without_a_script(recorded_file):
    tags = re.sub(SCRIPT, "", recorded_file)
    assert set(re.findall(r'(?:src|href)="([^"]*)"', tags)) == {"data:,"}
    assert "default-src 'none'" in tags
    assert not any(each in tags for each in ("url(", "lab-socket"))
    answers = room.answers_in(dict(SCRIPT.findall(recorded_file))["recordings/default.json"])
    (truth,) = (header for ask, header, _ in answers if ask.kind == "truth")
    shown = tags.partition('<div id="certificate">')[2].partition("</div>")[0]
    assert shown.count("<li>") == len(truth["certificate"]) > 0


def test_what_is_shown_first():
    rigid = ProblemChoice(name="inextensible-rope", frames=3)
    problem, steppers = room.shown_first(room.Laboratory(), room.link_of(rigid, None))
    assert problem == rigid
    assert "rattle" in steppers
    # Scenes say which plot they show.
    assert room.link_of(None, "why-euler-explodes")["choices"] == {"steps": "stability"}
    assert room.link_of(ROPE, "chaos")["choices"] == {"motion": "error"}


def test_the_command_writes_the_file_whole_or_refuses(tmp_path, monkeypatch, recorded_file):
    monkeypatch.setattr("ropeode.laboratory.page_with_answers", lambda *_: recorded_file)
    # It would switch on 64-bit types for all tests after this one.
    monkeypatch.setattr("ropeode.cli.lab.set_up_jax", lambda: None)
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(cli, ["lab", "--out", "lecture.html"])
    assert done.output == f"wrote lecture.html ({len(recorded_file.encode()) / 1e6:.1f} MB)\n"
    assert Path("lecture.html").read_text() == recorded_file
    Path("steps.py").write_text("def step(\n")
    for arguments, said in (
        (["lecture.pdf"], "a file name that ends in .html"),
        (["other.html", "--port", "80"], "only without --out"),
        (["other.html", "steps.py"], "'(' was never closed"),
    ):
        refused = CliRunner().invoke(cli, ["lab", "-o", *arguments])
        assert said in str(refused.exception)
    assert {each.name for each in tmp_path.iterdir()} == {"lecture.html", "steps.py"}
