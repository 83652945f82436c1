"""What a table is made from, as a TOML file or as options of the command line."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, get_args

from pydantic import AfterValidator, BeforeValidator, PlainValidator

from ropeode.errors import InputError
from ropeode.files import read_text
from ropeode.norms import NORMS
from ropeode.problems.checks import run as run_checks
from ropeode.problems.files import load_problem
from ropeode.problems.inextensible_rope import InextensibleRope
from ropeode.problems.library import PROBLEMS, ROPES
from ropeode.problems.problem import Problem
from ropeode.problems.rope import Rope
from ropeode.progress import Progress
from ropeode.references.certificate import Level
from ropeode.references.reference import Reference, problem_of
from ropeode.steppers.base import Stepper
from ropeode.study.accuracy_table import (
    DEFAULT_STEPS_PER_FRAME,
    AccuracyTable,
    StepsPerFrame,
    accuracy_table,
    check_steppers,
    check_steps,
)
from ropeode.validation import Input, Positive, WholePositive, complaint, field, unknown

COMMENTED_SPEC = resources.files("ropeode.study").joinpath("spec.toml").read_text("utf-8")


def _steppers(value: Any) -> tuple[str, ...] | None:
    if value is None:
        return None
    return tuple(stepper.label for stepper in check_steppers(value))


def _themselves(value: Any) -> tuple[Stepper, ...] | None:
    return None if value is None else tuple(check_steppers(value))


def _one_of(name: str, allowed: Iterable[str]) -> AfterValidator:
    """The check of a field that is one of these names, or None."""

    def check(value: str | None) -> str | None:
        if value is not None and value not in allowed:
            raise InputError(unknown(name, value, allowed))
        return value

    return AfterValidator(check)


class StudySpec(Input):
    """What spec files of all kinds say.

    Arguments:
        problem: `rope`, another problem of the library, or FILE.py:NAME.
        kind: of the rope: `rope` or `inextensible-rope`.
        frames: how many frames are solved; where nothing is given, 20 for the rope.
        steppers: names with options; where none are given, those of `DEFAULT_STEPPERS` that
            can run on the problem.
        steps_per_frame: whole numbers.
        norm: one of `ropeode.norms.NORMS`.
        accuracy: as for `ropeode.reference`.
        rtol: as for `ropeode.reference`.
        level: as for `ropeode.reference`, like what follows.
        digits: of an extended reference; 18 where nothing is given.
        time_limit: of an extended reference, in seconds; 60 where nothing is given.

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
    time_limit: Positive | None = field(
        None, allowed="a finite number > 0, with level 'extended'", example="60"
    )

    @property
    def asked(self) -> dict[str, Any]:
        """What is asked of the reference, as `ropeode.reference` takes it."""
        names = ("accuracy", "rtol", "level", "digits", "time_limit")
        given = {name: getattr(self, name) for name in names}
        return {name: value for name, value in given.items() if value is not None}

    def check_level(self) -> None:
        """See that nothing is given that only another level has.

        Raises:
            InputError: something is.
        """
        if self.level == "extended":
            return
        faults = [
            complaint(name, value, "none with level 'consensus'", "add level = extended")
            for name in ("digits", "time_limit")
            if (value := getattr(self, name)) is not None
        ]
        if faults:
            raise InputError(faults)


class TableSpec(StudySpec):
    """Everything in a table's spec file except the rope's own table.

    Arguments:
        steppers: themselves, from whatever `ropeode.as_stepper` takes.
        reference: a file with a reference, or a name of the stored library; either says the
            problem as well.
        dense: whether a reference that is written is to have states between the samples.

    Raises:
        InputError: one line for each that cannot be used.
    """

    steppers: Annotated[Any, BeforeValidator(_themselves)] = field(
        None, allowed="names of steppers", example='["rk4", "steps.py:verlet", "diffrax:Heun"]'
    )
    reference: str | None = field(
        None, allowed="a file with a reference, or a name of the library", example='"rope.nc"'
    )
    dense: bool = field(False, allowed="true or false", example="true")


def read_spec(path: Path) -> dict[str, Any]:
    """A spec file as nested values, not yet checked.

    Raises:
        InputError: it cannot be read or is not TOML.
    """
    try:
        return tomllib.loads(read_text("spec", path))
    except tomllib.TOMLDecodeError as error:
        raise InputError(
            complaint("spec", str(path), f"a TOML file ({error})", "see `ropeode spec` for one")
        ) from error


def kind_apart(values: Mapping[str, Any]) -> dict[str, Any]:
    """A spec's values where the name of a rope, which says its kind as well, is its kind.

    Raises:
        InputError: another kind is given beside it.
    """
    rest = dict(values)
    if rest.get("problem") in ROPES:
        kind = rest.pop("problem")
        if kind != "rope" and rest.setdefault("kind", kind) != kind:
            allowed = f"no other kind with problem {kind!r}"
            raise InputError(complaint("kind", rest["kind"], allowed, "leave out one of them"))
    return rest


def rope_of(kind: str, parameters: Any) -> Rope | InextensibleRope:
    """The rope that a spec's parameters describe; of a wrong kind, the usual one.

    Raises:
        InputError: one line for each parameter that cannot be used.
    """
    if not isinstance(parameters, Mapping):
        raise InputError(
            complaint("rope", parameters, "a table of parameters", "write [rope] above them")
        )
    made = ROPES.get(kind, Rope)
    if made is InextensibleRope and "stiffness" in parameters:
        allowed = "none with kind 'inextensible-rope', whose links do not stretch"
        fix = "leave it out, or choose kind 'rope'"
        raise InputError(complaint("stiffness", parameters["stiffness"], allowed, fix))
    return made(**parameters)


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
        rope_values = rest.pop("rope", {})
        found: dict[str, Any] = {}

        def check_names_of_steppers() -> None:
            if (given := rest.pop("steppers", None)) is not None:
                found["steppers"] = check_steppers(given, folder)

        def check_spec() -> None:
            if "steppers" in found:
                rest["steppers"] = found["steppers"]
            found["spec"] = TableSpec(**rest)

        def check_rope() -> None:
            found["rope"] = rope_of(str(rest.get("kind")), rope_values)

        run_checks(check_names_of_steppers, check_spec, check_rope)
        self.spec: TableSpec = found["spec"]
        self.spec.check_level()
        self.folder = folder
        self.given: Problem | Reference
        if self.spec.reference is None:
            self.given = self._problem(found["rope"], bool(rope_values), folder, self.spec.frames)
        else:
            self.given = self._stored(found["rope"], bool(rope_values), {*rest}, folder)

    def _problem(
        self,
        rope: Rope | InextensibleRope,
        rope_given: bool,
        folder: Path | None,
        frames: int | None,
    ) -> Problem:
        spec = self.spec
        if spec.problem == "rope":
            return rope.problem(**({} if frames is None else {"frames": frames}))
        if rope_given or spec.kind != "rope":
            raise InputError(
                complaint(
                    "rope" if rope_given else "kind",
                    f"what describes a rope, with problem {spec.problem!r}",
                    "what describes a rope with problem 'rope' only",
                    "leave out one of the two",
                )
            )
        return load_problem(spec.problem, folder=folder, frames=frames)

    def _stored(
        self, rope: Rope | InextensibleRope, rope_given: bool, named: set[str], folder: Path | None
    ) -> Reference:
        """The stored reference; its problem must be the one that is described, if one is."""
        # Not above: HDF5 takes its time to load, and most tables need none of it.
        from ropeode.references.files.library import find
        from ropeode.references.files.store import reference_from, stored_facts

        assert self.spec.reference is not None
        beside = (folder or Path()) / self.spec.reference
        facts = stored_facts(beside if beside.exists() else find(self.spec.reference))
        if not (rope_given or named & {"problem", "kind", "frames"}):
            return reference_from(facts)
        frames = self.spec.frames
        if frames is None and self.spec.problem in PROBLEMS:
            frames = facts.problem["parameters"].get("frames")
        return reference_from(facts, self._problem(rope, rope_given, folder, frames))

    @property
    def problem(self) -> Problem:
        """What is solved."""
        return problem_of(self.given)

    def run(self, progress: Progress) -> AccuracyTable:
        """Make the table; raises as `accuracy_table` does."""
        spec = self.spec
        return accuracy_table(
            self.given,
            spec.steppers,
            spec.steps_per_frame,
            norm=spec.norm,
            progress=progress,
            **spec.asked,
        )
