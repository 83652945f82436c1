"""What the lab is opened with."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ropeode.errors import InputError
from ropeode.laboratory.messages import ProblemChoice, SceneState
from ropeode.laboratory.scenes import scenes
from ropeode.laboratory.setup import name_of_given
from ropeode.problems import PROBLEMS, Problem
from ropeode.references import Reference, problem_of
from ropeode.study import TableJob, read_spec
from ropeode.validation import unknown


def opened_with(where: str) -> tuple[Problem | Reference | None, ProblemChoice]:
    """The problem that the lab is opened with, and how the page asks for it.

    Arguments:
        where: as ``--problem`` of `ropeode table`: a name, ``FILE.py:NAME``, or a spec.

    Returns:
        The problem, None where it is one of the library's with other parameters; and the choice.

    Raises:
        InputError: it cannot be used.
        UserCodeError: the file raised.
    """
    if where.endswith(".toml"):
        given = TableJob(read_spec(Path(where)), folder=Path(where).parent).given
    else:
        given = TableJob({"problem": where}, folder=None).given
    return chosen(given)


def chosen(given: Problem | Reference) -> tuple[Problem | Reference | None, ProblemChoice]:
    """How the page asks for a problem, or for a reference.

    Returns:
        What is given, None where it is a problem of the library's; and the choice.
    """
    problem = problem_of(given)
    if isinstance(given, Problem) and (choice := _of_library(given)) is not None:
        return None, choice
    return given, ProblemChoice(name=name_of_given(problem), frames=problem.frames)


def _of_library(problem: Problem) -> ProblemChoice | None:
    """The choice in the library that makes this problem."""
    kind = problem.parameters.get("kind")
    if kind not in PROBLEMS:
        return None
    usual = PROBLEMS[kind]().parameters
    parameters = {
        name: value
        for name, value in problem.parameters.items()
        if name not in ("kind", "frames") and value != usual.get(name)
    }
    same = PROBLEMS[kind](frames=problem.frames, **parameters)
    if not (np.array_equal(same.y0, problem.y0) and np.array_equal(same.ts, problem.ts)):
        return None
    return ProblemChoice(name=kind, parameters=parameters, frames=problem.frames)


def link_of(problem: ProblemChoice | None, scene: str | None) -> dict[str, Any]:
    """What the page shows at first, as its link has it.

    Raises:
        InputError: there is no such scene.
    """
    link: dict[str, Any] = {}
    if scene is not None:
        state = _scene(scene)
        link = {
            "problem": state.problem.model_dump(),
            "steppers": state.steppers,
            "ladder": state.ladder,
            "steps": state.ladder[-1],
            "choices": {"steps" if state.plot in ("order", "stability") else "motion": state.plot},
            "lesson": scene,
        }
    if problem is not None:
        link["problem"] = problem.model_dump()
    return link


def _scene(name: str) -> SceneState:
    by_name = {each.name: each.state for each in scenes()}
    if name not in by_name:
        raise InputError(unknown("scene", name, by_name))
    return by_name[name]
