"""What can be chosen: problems, their parameters, and steppers."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Iterator
from typing import Any

from ropeode.errors import InputError
from ropeode.laboratory.answers import Answer
from ropeode.laboratory.limits import MOST_FRAMES, MOST_NODES
from ropeode.laboratory.messages import (
    AskLibrary,
    Library,
    ParameterFacts,
    ProblemFacts,
    StepperFacts,
)
from ropeode.laboratory.scenes import scenes
from ropeode.laboratory.setup import Laboratory, first_steppers, name_of_given
from ropeode.problems import PROBLEMS, ROPES, Problem
from ropeode.progress import Progress
from ropeode.references import problem_of
from ropeode.render import argument_words, problem_words
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
# How far a slider goes to both sides of a default above zero, and of zero.
_FACTOR, _AROUND_ZERO = 100.0, 1.0
_UNITS = {
    "node_mass": "mass",
    "stiffness": "mass/frame²",
    "damping": "mass/frame",
    "gravity": "length/frame²",
    "start": "length",
    "end": "length",
    "initial_velocity": "length/frame",
    "angle": "rad",
    "angles": "rad",
    "velocities": "rad/frame",
    "periods": "periods",
}
# Ends of sliders that the rule of `_slider` would set where nothing is to be seen.
_ENDS = {
    "num_nodes": (2, 64),
    "num_masses": (1, 64),
    "damping": (0.0, 0.2),
    "eccentricity": (0.0, 0.9),
    "angle": (-3.14, 3.14),
}


def library(ask: AskLibrary, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    problems = []
    for index, kind in enumerate(PROBLEMS):
        progress(f"the problem {kind}", index / len(PROBLEMS))
        problems.append(_of_library(kind))
    if laboratory.given is not None:
        given = problem_of(laboratory.given)
        frames = {"frames": given.frames, "most_frames": given.frames}
        named = {"name": name_of_given(given), "words": problem_words(given), "parameters": ()}
        problems.insert(0, _facts(given, **named, **frames))
    message = Library(
        problems=tuple(problems),
        steppers=tuple(_declared(name, each) for name, each in _steppers().items()),
        own=tuple(each.facts for each in laboratory.own.values()),
        scenes=scenes(),
    )
    return message, {}


@functools.cache
def _of_library(kind: str) -> ProblemFacts:
    problem = PROBLEMS[kind]()
    frames = {"frames": _FRAMES.get(kind, problem.frames), "most_frames": MOST_FRAMES}
    parameters = tuple(parameters_of(problem))
    return _facts(problem, name=kind, words=problem.name, parameters=parameters, **frames)


def _facts(problem: Problem, **facts: Any) -> ProblemFacts:
    steppers = tuple(name for name, each in _steppers().items() if each.refusal(problem) is None)
    return ProblemFacts(steppers=steppers, default_steppers=first_steppers(problem), **facts)


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
    )


def parameters_of(problem: Problem) -> Iterator[ParameterFacts]:
    """The parameters of a problem of the library but its number of frames, with its own values.

    Arguments:
        problem: made with all its defaults.
    """
    kind = problem.parameters["kind"]
    words, allowed = argument_words(ROPES.get(kind, PROBLEMS[kind])), _allowed(kind)
    for name, value in problem.parameters.items():
        if name in ("kind", "frames"):
            continue
        whole = isinstance(value, int)
        low, high, logarithmic = _slider(name, value, "> 0" in allowed[name])
        yield ParameterFacts(
            name=name,
            default=value,
            allowed=allowed[name],
            whole=whole,
            low=low,
            high=high,
            logarithmic=logarithmic,
            unit=_UNITS.get(name, ""),
            words=words.get(name, name.replace("_", " ")),
        )


def _slider(name: str, value: Any, positive: bool) -> tuple[float | None, float | None, bool]:
    """Its ends, and whether it moves in powers of ten; without ends for what is no number."""
    if name in _ENDS:
        return *_ENDS[name], False
    if not isinstance(value, (int, float)):
        return None, None, False
    if isinstance(value, int):
        return 1, min(MOST_NODES, 4 * value), False
    if positive:
        return value / _FACTOR, value * _FACTOR, True
    if value == 0:
        return -_AROUND_ZERO, _AROUND_ZERO, False
    return min(0.0, 2.0 * value), max(0.0, 2.0 * value), False


def _allowed(kind: str) -> dict[str, str]:
    """What is allowed for each parameter, in words."""
    if kind in ROPES:
        fields = ROPES[kind].model_fields
        extra = {name: each.json_schema_extra for name, each in fields.items()}
        return {n: str(e["allowed"]) for n, e in extra.items() if isinstance(e, dict)}
    hints = inspect.get_annotations(inspect.unwrap(PROBLEMS[kind]), eval_str=True)
    return {n: each.__metadata__[-1] for n, each in hints.items() if hasattr(each, "__metadata__")}
