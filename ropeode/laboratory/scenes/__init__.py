"""The scenes of the lab: eight lessons, and the figures of the published report."""

from __future__ import annotations

import functools
import json
import tomllib
from importlib import resources
from typing import Any

from ropeode.case_studies import Figure, all_figures
from ropeode.laboratory.messages import ProblemChoice, SceneFacts, SceneState
from ropeode.problems import InextensibleRope

# Of a figure's scene; the report watches its ropes for thousands.
_FRAMES = 200
_STEPPED_BY_NONE = "none"


@functools.cache
def scenes() -> tuple[SceneFacts, ...]:
    """All of them, lessons first."""
    return (*map(_lesson, lessons()), *map(_figure, all_figures().values()))


def lessons() -> list[dict[str, Any]]:
    """The lessons as `lessons.toml` has them, with what each one shows."""
    return tomllib.loads(_text("lessons.toml"))["scenes"]


def _text(name: str) -> str:
    return resources.files(__name__).joinpath(name).read_text("utf-8")


def _lesson(lesson: dict[str, Any]) -> SceneFacts:
    return SceneFacts(**{name: each for name, each in lesson.items() if name != "shows"})


@functools.cache
def verdicts() -> dict[int, dict[str, str]]:
    """What became of each figure's claim, as `ropeode report` found it: `verdict`, `measured`."""
    return {int(number): found for number, found in json.loads(_text("verdicts.json")).items()}


def _figure(figure: Figure) -> SceneFacts:
    found = verdicts()[figure.figure]
    name = figure.run_as
    rigid = bool(figure.meanings) and figure.setting("words").rope is InextensibleRope
    parameters = {"num_nodes": figure.num_nodes, "damping": figure.damping}
    return SceneFacts(
        name=f"figure-{figure.figure}",
        title={"en": f"Figure {figure.figure}: {figure.words}", "zh": f"图 {figure.figure}"},
        text={
            "en": f"The report says: {figure.words}.\nRun again, the claim {found['verdict']}.\n"
            f"Measured (here are the first {_FRAMES} frames): {found['measured']}.",
            "zh": f"报告说（英文）：{figure.words}。\n"
            f"重新计算，这一说法{_in_chinese(found['verdict'])}。\n"
            f"测得（英文；此处为前 {_FRAMES} 帧）：{found['measured']}。",
        },
        page="validation/report",
        state=SceneState(
            problem=ProblemChoice(
                name=InextensibleRope.kind if rigid else "rope",
                parameters=parameters,
                frames=_FRAMES,
            ),
            steppers=() if name is None else (name,),
            ladder=(figure.steps_per_frame,),
            plot="error",
        ),
    )


def _in_chinese(verdict: str) -> str:
    holds, _, frame = verdict.partition(" until frame ")
    words = {"holds": "成立", "does not hold": "不成立"}[holds]
    return f"到第 {frame} 帧为止{words}" if frame else words
