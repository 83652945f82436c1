"""What the lab was opened with, and what its answers have computed lately."""

from __future__ import annotations

import dataclasses
from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Any

from ropeode.errors import InputError
from ropeode.laboratory import limits
from ropeode.laboratory.certified_motion import CertifiedMotion, certified_motion
from ropeode.laboratory.messages import OwnStepper, ProblemChoice
from ropeode.laboratory.recent import Recent
from ropeode.laboratory.scenes import scenes
from ropeode.problems import PROBLEMS, Problem
from ropeode.progress import Progress
from ropeode.references import Reference, problem_of
from ropeode.simulation import Method, Trajectory, method_of
from ropeode.steppers import STEPPER_LIBRARIES, STEPPERS, Stepper, as_stepper
from ropeode.study import Row, TableJob, problem_class, read_spec
from ropeode.validation import bad_value, unknown

_MOST_BYTES = 2**26
# A row, a method: numbers that nobody sees, but for their count.
_SMALL = 2**12
# Those that a newcomer sees first, where they can run on the problem and are meant for it.
_FIRST = ("explicit-euler", "semi-implicit-euler", "rk4", "constraint-verlet", "rattle")
# Beside them where the problem is not mechanical, and may well be stiff.
_IMPLICIT = ("diffrax:ImplicitEuler",)


@dataclasses.dataclass(frozen=True)
class Own:
    """A stepper of the user's own.

    Arguments:
        facts: as the page is told.
        stepper: the newest version that works; None where there is none.
    """

    facts: OwnStepper
    stepper: Stepper | None


class Laboratory:
    """What all answers share.

    Arguments:
        given: a problem that the lab was opened with, or a reference of it; the page finds it as
            `name_of_given` beside those of the library.
        own: steppers of the user's own by name; replaced when their file changes.

    Raises:
        InputError: the problem is too large.
    """

    def __init__(
        self, given: Problem | Reference | None = None, own: Mapping[str, Own] | None = None
    ) -> None:
        if given is not None:
            limits.check_given(problem_of(given))
        self.given = given
        self.own: Mapping[str, Own] = own or {}
        self._motions = Recent[CertifiedMotion](_MOST_BYTES, lambda each: each.nbytes)
        self._runs = Recent[Trajectory](_MOST_BYTES, lambda each: each.states.nbytes)
        self._rows = Recent[Row](_MOST_BYTES, lambda _: _SMALL)
        self._methods = Recent[Method](_MOST_BYTES, lambda _: 2**20)

    def problem(self, choice: ProblemChoice) -> Problem:
        """The problem that was chosen; raises as `source`."""
        return problem_of(self.source(choice))

    def source(self, choice: ProblemChoice) -> Problem | Reference:
        """The problem that was chosen, or its reference, where the lab was opened with one.

        Raises:
            InputError: there is none of the name, or its parameters cannot be used.
        """
        if self.given is not None and choice.name == name_of_given(problem_of(self.given)):
            frames = problem_of(self.given).frames
            if choice.frames != frames or choice.parameters:
                allowed = f"{frames} frames and no parameters, as the lab was opened with"
                given = {"frames": choice.frames, **choice.parameters}
                raise bad_value("problem", given, allowed, "open the lab with another problem")
            return self.given
        if choice.name not in PROBLEMS:
            raise InputError(unknown("problem", choice.name, PROBLEMS))
        limits.check_sizes(choice.parameters, choice.frames)
        if "frames" in choice.parameters:
            allowed = "parameters of the problem without frames, which stand beside them"
            raise bad_value("parameters", "frames", allowed, "leave it out")
        try:
            return PROBLEMS[choice.name](frames=choice.frames, **choice.parameters)
        except TypeError as error:
            # A word that is no name, such as "self".
            raise bad_value("parameters", list(choice.parameters), f"names ({error})", "") from None

    def stepper(self, name: str, version: str | None) -> Stepper:
        """A stepper by its name: of the user's own, of ropeode with options, or of a library.

        Arguments:
            name: as the library has it. No file is opened.
            version: of the user's file, for a stepper from it.

        Raises:
            InputError: there is none.
        """
        if name in self.own:
            found = self.own[name]
            if found.stepper is None or found.facts.version != version:
                allowed = f"the version {found.facts.version} of the file, which has changed"
                raise bad_value("version", version, allowed, "ask again")
            return found.stepper
        first, _, rest = name.partition(":")
        if first not in STEPPERS and not (first in STEPPER_LIBRARIES and rest):
            raise InputError(unknown("stepper", name, [*STEPPERS, *self.own]))
        return as_stepper(name)

    def motion(self, choice: ProblemChoice, progress: Progress) -> CertifiedMotion:
        """The certified reference of the problem.

        Raises:
            ReferenceRefused: it has none.
        """
        source = self.source(choice)
        key = problem_of(source)
        return self._motions.get(key, lambda: self._certified(source, progress))

    def _certified(self, source: Problem | Reference, progress: Progress) -> CertifiedMotion:
        problem = problem_of(source)
        methods = [self.method(problem, name, None) for name in first_steppers(problem)]
        motion = certified_motion(source, methods, progress)
        # What it compiles would make the first run late.
        motion.differences(motion.finer.states, 1)
        return motion

    def method(self, problem: Problem, name: str, version: str | None) -> Method:
        """A stepper, ready to run on a problem.

        Raises:
            InputError: it cannot.
            UserCodeError: the user's own step raised.
        """
        stepper = self.stepper(name, version)
        return self._methods.get((problem, name, version), lambda: method_of(stepper, problem))

    def run(
        self, motion: CertifiedMotion, method: Method, steps_per_frame: int, progress: Progress
    ) -> Trajectory:
        """A run, sampled between the frames as well."""
        key = _allowed(motion, method, steps_per_frame)
        return self._runs.get(key, lambda: motion.run(method, steps_per_frame, progress))

    def row(
        self, motion: CertifiedMotion, method: Method, steps_per_frame: int, progress: Progress
    ) -> Row:
        """The row of the accuracy table."""
        key = _allowed(motion, method, steps_per_frame)
        return self._rows.get(key, lambda: motion.row(method, steps_per_frame, progress))


def _allowed(motion: CertifiedMotion, method: Method, steps: int) -> Hashable:
    """What a run is kept by; raises if it would take too long."""
    limits.check_work(motion.problem, method.stepper, steps, method.trial.compiled)
    return motion.problem, method, method.stepper.label, steps


def name_of_given(problem: Problem) -> str:
    """The name of a problem that the lab was opened with, which is none of the library's."""
    return f"{problem.name} (given)" if problem.name in PROBLEMS else problem.name


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
    if isinstance(given, Problem) and (choice := choice_of(given)) is not None:
        return None, choice
    return given, ProblemChoice(name=name_of_given(problem), frames=problem.frames)


def choice_of(problem: Problem) -> ProblemChoice | None:
    """How the library makes this problem; None if it does not.

    Parameters are what their maker says that they are.
    """
    kind = problem.parameters.get("kind")
    if not isinstance(kind, str) or kind not in PROBLEMS:
        return None
    usual = PROBLEMS[kind]().parameters
    try:
        parameters = {
            name: value
            for name, value in problem.parameters.items()
            if name not in ("kind", "frames") and value != usual.get(name)
        }
        same = PROBLEMS[kind](frames=problem.frames, **parameters)
    except (InputError, TypeError, ValueError):
        return None
    if same != problem:
        return None
    return ProblemChoice(name=kind, parameters=parameters, frames=problem.frames)


def first_steppers(problem: Problem) -> tuple[str, ...]:
    """The steppers that a newcomer sees first."""
    return tuple(
        name
        for name in _FIRST + (_IMPLICIT if problem.mechanics is None else ())
        if (stepper := as_stepper(name)).refusal(problem) is None
        and stepper.solves(problem_class(problem))
    )


def link_of(problem: ProblemChoice | None, scene: str | None) -> dict[str, Any]:
    """What the page shows at first, as its link has it.

    Raises:
        InputError: there is no such scene.
    """
    link: dict[str, Any] = {}
    if scene is not None:
        states = {each.name: each.state for each in scenes()}
        if scene not in states:
            raise InputError(unknown("scene", scene, states))
        state = states[scene]
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
