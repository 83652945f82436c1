"""The texts of the page: the same in all languages, and none is missing."""

import itertools
import json
import re
from pathlib import Path
from typing import get_args

import ropeode.laboratory
from ropeode.analysis import REASONS
from ropeode.analysis import Verdict as OrderVerdict
from ropeode.checking import Status, Verdict
from ropeode.laboratory import parameters_of
from ropeode.norms import norm_for
from ropeode.problems import PROBLEMS
from ropeode.steppers import STEPPERS, options

PAGE = Path(ropeode.laboratory.__file__).parent / "page"
ENGLISH, CHINESE = (
    json.loads((PAGE / "words" / f"{code}.json").read_text()) for code in ("en", "zh")
)


def test_both_languages_have_the_same_texts_with_the_same_values():
    assert list(ENGLISH) == list(CHINESE)
    for key, text in ENGLISH.items():
        assert text
        assert CHINESE[key]
        places = [sorted(re.findall(r"\{\w+\}", each)) for each in (text, CHINESE[key])]
        assert places[0] == places[1], key


def test_every_text_that_the_page_names_exists():
    sources = "\n".join(each.read_text() for each in [*PAGE.rglob("*.js"), PAGE / "index.html"])
    named = {
        *re.findall(r'\bsay\(\s*"([^"]+)"', sources),
        *re.findall(r'data-(?:words|label)="([^"]+)"', sources),
        *(f"problem.{name}" for name in PROBLEMS),
    }
    assert len(named) > 60
    assert sorted(named - set(ENGLISH)) == []


def test_fixed_words_of_python_are_translated():
    problems = [make() for make in PROBLEMS.values()]
    parameters = [each for problem in problems for each in parameters_of(problem)]
    switches = options(STEPPERS["stormer-verlet"]).values()
    said = {
        *(f"parameter.{each.name}" for each in parameters),
        *(f"unit.{each.unit}" for each in parameters if each.unit),
        *(f"norm.{norm_for(problem).words}" for problem in problems),
        *(f"plots.verdict.{verdict}" for verdict in get_args(OrderVerdict)),
        *(f"plots.why.{why}" for why in REASONS if why != "unsolved"),
        *(f"found.{status}" for status in get_args(Status) if status != "note"),
        *(f"own.{verdict}" for verdict in get_args(Verdict)),
        *(f"why.verlet.{start}.{damping}" for start, damping in itertools.product(*switches)),
    }
    assert sorted(said - set(ENGLISH)) == []
