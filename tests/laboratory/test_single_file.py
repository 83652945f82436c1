"""The lab in one file: what is in it, and what a reader's keys can ask of it."""

from __future__ import annotations

import re
from pathlib import Path

from click.testing import CliRunner

from ropeode.cli import cli
from ropeode.laboratory import (
    Laboratory,
    answers_in,
    asks_of,
    link_of,
    shown_first,
)
from ropeode.laboratory.messages import ProblemChoice
from tests.laboratory.conftest import ROPE

SCRIPT = re.compile(r'<script type="application/json" id="([^"]+)">(.*?)</script>', re.DOTALL)


def test_it_loads_nothing_and_its_certificate_can_be_read_without_a_script(recorded_file):
    tags = re.sub(SCRIPT, "", recorded_file)
    assert set(re.findall(r'(?:src|href)="([^"]*)"', tags)) == {"data:,"}
    assert "default-src 'none'" in tags
    assert not any(each in tags for each in ("url(", "lab-socket"))
    answers = answers_in(dict(SCRIPT.findall(recorded_file))["recordings/default.json"])
    (truth,) = (header for ask, header, _ in answers if ask.kind == "truth")
    shown = tags.partition('<div id="certificate">')[2].partition("</div>")[0]
    assert shown.count("<li>") == len(truth["certificate"]) > 0


def test_it_asks_for_every_order_that_the_keys_can_reach():
    questions = list(asks_of(Laboratory(), ROPE, ("rk4",), (16,)))
    assert len({each.model_dump_json() for each in questions}) == len(questions)
    # From 16, up to two presses of - and five of =, in any order.
    reached = {
        tuple(2**k for k in range(low, high + 1)) for low in (2, 3, 4) for high in range(4, 10)
    }
    assert {each.steps_per_frame for each in questions if each.kind == "order"} == reached
    runs = [each.steps_per_frame for each in questions if each.kind == "run"]
    assert runs == [4, 8, 16, 32, 64, 128, 256, 512]


def test_what_is_shown_first():
    rigid = ProblemChoice(name="inextensible-rope", frames=3)
    problem, steppers = shown_first(Laboratory(), link_of(rigid, None))
    assert problem == rigid
    assert "rattle" in steppers
    # Scenes say which plot they show.
    assert link_of(None, "why-euler-explodes")["choices"] == {"steps": "stability"}
    assert link_of(ROPE, "chaos")["choices"] == {"motion": "error"}


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
