"""What can be chosen: problems, their parameters, and steppers."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from importlib import metadata

from ropeode.errors import InputError
from ropeode.laboratory.answers import Answer
from ropeode.laboratory.controls import parameters_of
from ropeode.laboratory.limits import MOST_FRAMES
from ropeode.laboratory.messages import AskLibrary, Library, ProblemFacts, StepperFacts
from ropeode.laboratory.scenes import scenes
from ropeode.laboratory.setup import Laboratory, first_steppers, name_of_given
from ropeode.problems import PROBLEMS, Problem
from ropeode.progress import Progress
from ropeode.references import problem_of
from ropeode.render import problem_words
from ropeode.steppers import (
    STEPPER_LIBRARIES,
    STEPPERS,
    Stepper,
    as_stepper,
    library_solvers,
    options,
)

# Longer than the default, which suits a test: what is seen in it is worth watching.
_FRAMES = {"rope": 40, "inextensible-rope": 40, "pendulum": 40, "double-pendulum": 40}


def answer(ask: AskLibrary, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    steppers = _steppers()
    problems = []
    for index, kind in enumerate(PROBLEMS):
        progress(f"the problem {kind}", index / len(PROBLEMS))
        problems.append(_of_library(kind))
    if laboratory.given is not None:
        given = problem_of(laboratory.given)
        problems.insert(
            0, _facts(given, name_of_given(given), given.frames, given.frames, steppers)
        )
    own = tuple(each.facts for each in laboratory.own.values())
    message = Library(
        version=metadata.version("ropeode"),
        problems=tuple(problems),
        steppers=tuple(_declared(name, each) for name, each in steppers.items()),
        own=own,
        scenes=scenes(),
    )
    return message, {}


@functools.cache
def _of_library(kind: str) -> ProblemFacts:
    problem = PROBLEMS[kind]()
    return _facts(problem, kind, _FRAMES.get(kind, problem.frames), MOST_FRAMES, _steppers())


def _facts(
    problem: Problem, name: str, frames: int, most: int, steppers: Mapping[str, Stepper]
) -> ProblemFacts:
    from_library = problem.parameters.get("kind") == name
    return ProblemFacts(
        name=name,
        words=problem.name if from_library else problem_words(problem),
        parameters=parameters_of(problem) if from_library else (),
        frames=frames,
        most_frames=most,
        steppers=tuple(n for n, each in steppers.items() if each.refusal(problem) is None),
        default_steppers=first_steppers(problem),
    )


@functools.cache
def _steppers() -> dict[str, Stepper]:
    """All that can be named, by name."""
    return {**{name: cls() for name, cls in STEPPERS.items()}, **dict(_of_libraries())}


def _of_libraries() -> Iterator[tuple[str, Stepper]]:
    for library in STEPPER_LIBRARIES:
        for name in library_solvers(library):
            try:
                stepper = as_stepper(f"{library}:{name}")
            except InputError:
                # It has no steps of one size, or is not for ordinary differential equations.
                continue
            yield stepper.label, stepper


def _declared(name: str, stepper: Stepper) -> StepperFacts:
    cls = STEPPERS.get(name)
    return StepperFacts(
        name=name,
        family=stepper.family,
        options=options(cls) if cls else {},
        source=stepper.source,
        symplectic=bool(stepper.symplectic),
    )
