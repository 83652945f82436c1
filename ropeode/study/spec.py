"""The settings of a table, from a TOML file or from options of the command line."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, get_args

from pydantic import AfterValidator, BeforeValidator, PlainValidator

from ropeode.errors import InputError
from ropeode.files import read_toml
from ropeode.norms import NORMS
from ropeode.problems import ROPES, InextensibleRope, Problem, load_problem
from ropeode.problems.rope import Rope
from ropeode.progress import Progress
from ropeode.references import Level, Reference, problem_of
from ropeode.study.accuracy_table import (
    DEFAULT_STEPS_PER_FRAME,
    IN_TIME,
    AccuracyTable,
    StepsPerFrame,
    accuracy_table,
    check_steppers,
    check_steps,
)
from ropeode.validation import Input, Positive, WholePositive, bad_value, check_all, field, unknown


def _steppers(value: Any) -> tuple[str, ...] | None:
    if value is None:
        return None
    return tuple(stepper.label for stepper in check_steppers(value))


def _one_of(name: str, allowed: Iterable[str]) -> AfterValidator:
    """The check of a field that is one of these names, or None."""

    def check(value: str | None) -> str | None:
        if value is not None and value not in allowed:
            raise InputError(unknown(name, value, allowed))
        return value

    return AfterValidator(check)


class StudySpec(Input):
    """The fields that all kinds of spec files share.

    Arguments:
        problem: `rope`, another problem of the library, or FILE.py:NAME.
        kind: of the rope: `rope` or `inextensible-rope`.
        frames: how many frames are solved; by default 20 for the rope.
        steppers: names with options; by default those of `DEFAULT_STEPPERS` that
            can run on the problem.
        steps_per_frame: whole numbers.
        norm: one of `ropeode.norms.NORMS`.
        accuracy: as for `ropeode.reference`.
        rtol: as for `ropeode.reference`.
        level: as for `ropeode.reference`, like what follows.
        digits: of an extended reference; by default 18.
        time_limit: of the reference, in seconds; by default 60.

    Raises:
        InputError: one line for each that cannot be used.
    """

    problem: str = field("rope", allowed="a problem's name, or FILE.py:NAME", example='"rope"')
    kind: Annotated[str, _one_of("kind", ROPES)] = field(
        "rope", allowed="the kind of a rope", example='"inextensible-rope"'
    )
    frames: WholePositive | None = field(None, allowed="a whole number >= 1", example="20")
    steppers: Annotated[tuple[str, ...] | None, BeforeValidator(_steppers)] = field(
        None, allowed="names of steppers", example='["rk4"]'
    )
    steps_per_frame: Annotated[StepsPerFrame, PlainValidator(check_steps)] = field(
        check_steps(DEFAULT_STEPS_PER_FRAME),
        allowed="different whole numbers >= 1",
        example="[16, 32, 64]",
    )
    norm: Annotated[str | None, _one_of("norm", NORMS)] = field(
        None, allowed="the name of a norm", example='"position-max"'
    )
    accuracy: Positive | None = field(None, allowed="a finite number > 0", example="1e-6")
    rtol: Positive | None = field(None, allowed="a finite number > 0", example="1e-12")
    level: Annotated[str, _one_of("level", get_args(Level))] = field(
        "consensus", allowed="the level of a reference", example='"extended"'
    )
    digits: WholePositive | None = field(
        None, allowed="a whole number >= 1, with level 'extended'", example="18"
    )
    time_limit: Positive | None = field(None, allowed="a finite number > 0", example="60")

    @property
    def asked(self) -> dict[str, Any]:
        """The options of the reference that the spec sets, as `ropeode.reference` names them."""
        names = ("accuracy", "rtol", "level", "digits", "time_limit")
        return {name: value for name in names if (value := getattr(self, name)) is not None}

    def check_level(self) -> None:
        """Refuse digits at another level than `extended`.

        Raises:
            InputError: there are digits.
        """
        if self.level != "extended" and self.digits is not None:
            allowed = "none with level 'consensus'"
            raise bad_value("digits", self.digits, allowed, "add level = extended")


class TableSpec(StudySpec):
    """Everything in a table's spec file except the rope's own table.

    Arguments:
        steppers: themselves; `TableJob` makes them of whatever `ropeode.as_stepper` takes.
        reference: a file with a reference, or a name of the stored library; either says the
            problem as well.

    Raises:
        InputError: one line for each that cannot be used.
    """

    steppers: Any = field(
        None, allowed="names of steppers", example='["rk4", "steps.py:verlet", "diffrax:Heun"]'
    )
    reference: str | None = field(
        None, allowed="a file with a reference, or a name of the library", example='"rope.nc"'
    )


def commented_table() -> str:
    """A spec file in which comments say what each value means."""
    return resources.files("ropeode.study").joinpath("commented.toml").read_text("utf-8")


def read_spec(path: Path) -> dict[str, Any]:
    """A spec file as nested values, not yet checked.

    Raises:
        InputError: it cannot be read or is not TOML.
    """
    return read_toml("spec", path, "`ropeode spec` for one")


def kind_apart(values: Mapping[str, Any]) -> dict[str, Any]:
    """A spec's values where the name of a rope, which says its kind as well, is its kind.

    Raises:
        InputError: the spec names another kind as well.
    """
    rest = dict(values)
    name = rest.get("problem")
    if isinstance(name, str) and name in ROPES:
        kind = rest.pop("problem")
        if kind != "rope" and rest.setdefault("kind", kind) != kind:
            allowed = f"no other kind with problem {kind!r}"
            raise bad_value("kind", rest["kind"], allowed, "leave out one of them")
    return rest


def rope_of(kind: str, parameters: Any) -> Rope | InextensibleRope:
    """The rope that a spec's parameters describe; of a wrong kind, the usual one.

    Raises:
        InputError: one line for each parameter that cannot be used.
    """
    if not isinstance(parameters, Mapping):
        raise bad_value("rope", parameters, "a table of parameters", "write [rope] above them")
    rope = ROPES.get(kind, Rope)
    if rope is InextensibleRope and "stiffness" in parameters:
        allowed = "none with kind 'inextensible-rope', whose links do not stretch"
        fix = "leave it out, or choose kind 'rope'"
        raise bad_value("stiffness", parameters["stiffness"], allowed, fix)
    return rope(**parameters)


class TableJob:
    """A spec, checked as a whole and ready to run.

    Arguments:
        values: the spec's values; a table `rope` holds the rope's parameters.
        folder: that names of files start from.

    Raises:
        InputError: one line for each value that cannot be used.
        UserCodeError: the user's problem file raised.
    """

    def __init__(self, values: Mapping[str, Any], folder: Path | None = None):
        rest = kind_apart(values)
        rope_values, steppers = rest.pop("rope", {}), rest.pop("steppers", None)
        chosen, spec, self._rope = check_all(
            lambda: None if steppers is None else tuple(check_steppers(steppers, folder)),
            lambda: TableSpec(**rest),
            lambda: rope_of(str(rest.get("kind")), rope_values),
        )
        spec.check_level()
        self.spec: TableSpec = spec.model_copy(update={"steppers": chosen})
        self.folder = folder
        self._rope_given = bool(rope_values)
        self.given: Problem | Reference
        if self.spec.reference is None:
            self.given = self._problem(self.spec.frames)
        else:
            self.given = self._stored({*rest})

    def _problem(self, frames: int | None) -> Problem:
        spec = self.spec
        if spec.problem == "rope":
            return self._rope.problem(**({} if frames is None else {"frames": frames}))
        if self._rope_given or spec.kind != "rope":
            name = "rope" if self._rope_given else "kind"
            given = f"what describes a rope, with problem {spec.problem!r}"
            allowed = "what describes a rope with problem 'rope' only"
            raise bad_value(name, given, allowed, "leave out one of the two")
        return load_problem(spec.problem, folder=self.folder, frames=frames)

    def _stored(self, named: set[str]) -> Reference:
        """The stored reference; its problem must be the one that is described, if one is."""
        # Not above: HDF5 takes its time to load, and most tables need none of it.
        from ropeode.problems import PROBLEMS
        from ropeode.references import find, reference_from, stored_facts

        assert self.spec.reference is not None
        beside = (self.folder or Path()) / self.spec.reference
        facts = stored_facts(beside if os.path.exists(beside) else find(self.spec.reference))
        if not (self._rope_given or named & {"problem", "kind", "frames"}):
            return reference_from(facts)
        frames = self.spec.frames
        if frames is None and self.spec.problem in PROBLEMS:
            frames = facts.problem.parameters.get("frames")
        return reference_from(facts, self._problem(frames))

    @property
    def problem(self) -> Problem:
        """What is solved."""
        return problem_of(self.given)

    def run(self, progress: Progress, predict: bool | None = None) -> AccuracyTable:
        """Make the table; raises as `accuracy_table` does.

        Arguments:
            progress: called with what is being done and the fraction that is done.
            predict: the errors of all steppers, or of none; by default of those that somebody
                named, where that takes no longer than the runs.
        """
        spec = self.spec
        return accuracy_table(
            self.given,
            spec.steppers,
            spec.steps_per_frame,
            norm=spec.norm,
            # That of all default steppers would take longer than their runs.
            predict=(spec.steppers is not None and IN_TIME) if predict is None else predict,
            progress=progress,
            **spec.asked,
        )
