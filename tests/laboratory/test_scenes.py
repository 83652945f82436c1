"""The scenes of the lab: what they say is what is computed."""

from __future__ import annotations

from pathlib import Path

import pytest

import ropeode
from ropeode import accuracy_table
from ropeode.case_studies import rope_report
from ropeode.laboratory.scenes import lessons, scenes, verdicts
from ropeode.steppers import as_stepper
from ropeode.study import rope_of
from tools.scene_verdicts import verdicts_of

DOCS = Path(ropeode.__file__).parent.parent / "docs"


def problem_of(choice):
    return rope_of(choice.name, choice.parameters).problem(choice.frames)


@pytest.mark.parametrize("scene", scenes(), ids=lambda scene: scene.name)
def test_a_scene_can_be_shown(scene):
    for words in (scene.title, scene.text):
        assert set(words) == {"en", "zh"}
    for language, stop in (("en", "."), ("zh", "。")):
        sentences = scene.text[language].splitlines()
        assert len(sentences) == 3
        assert all(each.endswith(stop) for each in sentences)
    assert (DOCS / f"{scene.page}.md").exists()
    problem = problem_of(scene.state.problem)
    for name in scene.state.steppers:
        assert as_stepper(name).refusal(problem) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    "lesson", [each for each in lessons() if "shows" in each], ids=lambda lesson: lesson["name"]
)
def test_a_lesson_shows_what_it_says(lesson):
    (scene,) = (each for each in scenes() if each.name == lesson["name"])
    table = accuracy_table(
        problem_of(scene.state.problem), scene.state.steppers, lesson["shows"]["ladder"]
    )
    found = {each.stepper: each.order for each in table.orders}
    for stepper, expected in lesson["shows"]["orders"].items():
        if isinstance(expected, str):
            assert found[stepper].verdict == expected
        else:
            assert found[stepper].verdict == "converges"
            assert found[stepper].observed == pytest.approx(expected, abs=0.1)
    if lesson["name"] == "round-off":
        # It grows again.
        errors = [row.error_max for row in table.rows if row.stepper == "stormer-verlet"]
        assert errors[-1] > 2.0 * min(errors)


@pytest.mark.slow
def test_verdicts_are_those_of_the_report():
    assert {int(number): each for number, each in verdicts_of(rope_report()).items()} == verdicts()
