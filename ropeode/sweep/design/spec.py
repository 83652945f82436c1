"""The spec of a sweep: which cases there are, as read from a TOML file."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, PlainValidator

from ropeode.errors import InputError
from ropeode.norms import norm_for
from ropeode.problems import Problem
from ropeode.study import (
    StepsPerFrame,
    StudySpec,
    check_steps,
    default_steppers,
    kind_apart,
    read_spec,
)
from ropeode.sweep.design.cases import Case, Settings, Task
from ropeode.sweep.design.columns import COLUMNS, Column
from ropeode.sweep.design.content_hash import software
from ropeode.sweep.design.distributions import Distribution
from ropeode.sweep.design.problem_factory import problem_factory
from ropeode.sweep.design.steppers import StepperSource, stepper_from, stepper_sources
from ropeode.sweep.design.tables import NAMES, Tables
from ropeode.validation import bad_value, check_all, field

DEFAULT_STEPS_PER_FRAME = (16, 32, 64)
DEFAULT_ORDER_FACTORS = (1, 2, 4, 8)
# Problems that are built to see whether all steppers can run on them. Of further ones only the
# parameters are checked; what goes wrong with them later is a row that says so.
_MOST_BUILT = 64
# In one task. With more, a killed process would lose more work, and little would be gained.
MOST_PROBLEMS = 64
# In a sweep that keeps references, each in a file: most file systems suffer from more files.
MOST_KEPT = 100_000
# Of the states of one run of all problems of a task.
_MOST_BYTES = 2**26
# Problems that are sorted by shape at a time, so that memory is bounded.
_SORTED_AT_ONCE = 1024


def _factors(value: Any) -> tuple[int, ...]:
    if isinstance(value, (list, tuple)) and not value:
        return ()
    factors = check_steps(value)
    if len(factors) < 3 or 1 not in factors:
        raise ValueError("three or more are needed, 1 among them")
    return tuple(sorted(factors))


class SweepFields(StudySpec):
    """Everything in a sweep's spec file except its tables.

    Arguments:
        order_factors: the order at n steps per frame is observed from n times each of these;
            an empty list where no order is requested.
        largest_stable_dt: whether to compute it for each stepper on each problem.

    Raises:
        InputError: one line for each that cannot be used.
    """

    steppers: Any = field(None, allowed="names of steppers", example='["rk4"]')
    steps_per_frame: Annotated[StepsPerFrame, PlainValidator(check_steps)] = field(
        DEFAULT_STEPS_PER_FRAME, allowed="different whole numbers >= 1", example="[16, 32, 64]"
    )
    order_factors: Annotated[tuple[int, ...], BeforeValidator(_factors)] = field(
        DEFAULT_ORDER_FACTORS,
        allowed="an empty list, or different whole numbers >= 1",
        example="[1, 2, 4, 8]",
    )
    largest_stable_dt: bool = field(False, allowed="true or false", example="true")


class SweepSpec:
    """A sweep: a grid, a random design, or each draw of one at each point of the other.

    Cases are counted with the parameters that come first in the grid changing last, then seeds,
    draws, steppers and steps. Each is made from its number, so that memory does not grow with
    the size of the design.

    Arguments:
        values: the spec's values. A table `rope` holds parameters that all ropes share, a
            table `parameters` those of other problems; `grid` lists of values by parameter;
            `random` the count of draws, seeds, and a distribution by parameter.
        folder: from which relative names of files start.

    Raises:
        InputError: one line for each value that cannot be used.
        UserCodeError: the user's problem file raised.

    Examples:
        >>> from ropeode import SweepSpec
        >>> grid = {"damping": [0.0, 0.1], "num_nodes": [4, 8]}
        >>> spec = SweepSpec({"steppers": ["rk4"], "grid": grid})
        >>> spec.count, spec.values["steps_per_frame"]
        (12, [16, 32, 64])
    """

    def __init__(self, values: Mapping[str, Any], folder: Path | None = None):
        folder = (folder or Path()).resolve()
        rest = kind_apart(values)
        tables = {name: rest.pop(name, {}) for name in NAMES}
        checked: dict[str, Any] = {}

        def check_fields() -> None:
            checked["fields"] = SweepFields(**rest)
            checked["fields"].check_level()

        def check_steppers() -> None:
            given = rest.get("steppers")
            checked["steppers"] = None if given is None else stepper_sources(given, folder)

        check_all(check_fields, check_steppers, lambda: checked.update(tables=Tables(tables)))
        self.fields: SweepFields = checked["fields"]
        rope = self.fields.problem == "rope"
        if not rope and self.fields.kind != "rope":
            allowed = "none with a problem other than 'rope'"
            raise bad_value("kind", self.fields.kind, allowed, "leave it out")
        name = self.fields.kind if rope else self.fields.problem
        self._factory = problem_factory(name, folder)
        self._design = checked["tables"].design(self._factory, self.fields.frames)
        self._settings = self._checked(folder, checked["steppers"])

    @property
    def count(self) -> int:
        """The number of cases."""
        return self._design.count * self._per_problem

    @property
    def columns(self) -> dict[str, Column]:
        """The columns of its table: those of every sweep, and one for each parameter."""
        return {**COLUMNS, **self._settings.columns}

    @property
    def software(self) -> Mapping[str, str]:
        """The versions of the software that computes the rows."""
        return self._settings.software

    @property
    def values(self) -> dict[str, Any]:
        """The spec as plain JSON values, the same however it was written."""
        settings = self._settings
        files = {label: each.file for label, each in settings.steppers.items() if each.file}
        values = {
            **settings.identity,
            "steppers": [] if "stepper" in self._design.drawn else [*settings.steppers],
            **({"stepper_files": files} if files else {}),
            "steps_per_frame": self.fields.steps_per_frame,
            "norm": settings.norm,
            **settings.reference_options,
            "order_factors": settings.order_factors,
            "largest_stable_dt": settings.largest_stable_dt,
            **self._design.values,
        }
        return json.loads(json.dumps(values))

    def cases(self, start: int = 0, stop: int | None = None) -> Iterator[Case]:
        """Cases by their numbers, made one after the other.

        Arguments:
            start: the first.
            stop: the one after the last; by default all that are left.
        """
        stop = self.count if stop is None else min(stop, self.count)
        each = self._per_problem
        for index in range(start // each, math.ceil(stop / each)):
            for case in self._cases_of(index):
                if start <= case.number < stop:
                    yield case

    def tasks(self, first: int = 0) -> Iterator[Task]:
        """All cases in tasks, made one after the other; problems of one shape share tasks.

        Arguments:
            first: the task to begin with; the cases of those before are not made.
        """
        number, count = 0, self._design.count
        for start in range(0, count, _SORTED_AT_ONCE):
            shapes: dict[tuple[int, int, int], list[int]] = {}
            for index in range(start, min(start + _SORTED_AT_ONCE, count)):
                shapes.setdefault(self._design.shape(index), []).append(index)
            for (dim, nodes, frames), alike in shapes.items():
                # Positions and velocities at all samples.
                most = _MOST_BYTES // (16 * dim * nodes * (frames + 1))
                most = max(1, min(MOST_PROBLEMS, most))
                for at in range(0, len(alike), most):
                    if number >= first:
                        some = alike[at : at + most]
                        yield Task(number, tuple(c for i in some for c in self._cases_of(i)))
                    number += 1

    @property
    def _per_problem(self) -> int:
        """The number of cases of each problem."""
        steppers = 1 if "stepper" in self._design.drawn else len(self._settings.steppers)
        steps = 1 if "steps_per_frame" in self._design.drawn else len(self.fields.steps_per_frame)
        return steppers * steps

    def _cases_of(self, index: int) -> Iterator[Case]:
        """The cases of a problem."""
        given, seed, draw = self._design.point(index)
        settings = self._settings
        label = given.pop("stepper", None)
        steppers = settings.steppers if label is None else [label]
        n = given.pop("steps_per_frame", None)
        steps = self.fields.steps_per_frame if n is None else [n]
        parameters = self._factory.complete(given)
        problem_key = settings.problem_key(parameters)
        runs = [(stepper, n) for stepper in steppers for n in steps]
        for number, (stepper, n) in enumerate(runs, index * self._per_problem):
            yield Case(
                number=number,
                key=settings.case_key(problem_key, stepper, n, seed, draw),
                problem_key=problem_key,
                parameters=parameters,
                stepper=stepper,
                steps_per_frame=n,
                seed=seed,
                draw=draw,
                settings=settings,
            )

    def _checked(self, folder: Path, steppers: Mapping[str, StepperSource] | None) -> Settings:
        """The settings of all cases, after examples of the problems have been tried.

        Each value of the grid, each end of a distribution and each stepper is tried, with the
        first values of all other parameters.

        Raises:
            InputError: one line for each that cannot be used.
        """
        factory, fields = self._factory, self.fields
        examples = [*self._design.examples()]
        check_all(*(lambda each=each: factory.check(each) for each in examples))
        built: list[Problem] = []
        some = examples[:_MOST_BUILT]
        check_all(*(lambda each=each: built.append(factory.build(each)) for each in some))
        drawn = self._design.drawn
        if "stepper" in drawn:
            steppers = stepper_sources(drawn["stepper"].extremes, folder)
            drawn["stepper"] = Distribution(choice=tuple(steppers))
        elif steppers is None:
            steppers = stepper_sources(default_steppers(built[0]), folder)
        loaded = [stepper_from(source, folder) for source in steppers.values()]
        refusals = [refusal for p in built for each in loaded if (refusal := each.refusal(p))]
        if refusals:
            raise InputError(list(dict.fromkeys(refusals)))
        if fields.largest_stable_dt:
            built[0].require_mechanics("largest_stable_dt")
        return Settings(
            problem=factory.name,
            folder=folder,
            identity=factory.identity,
            columns=factory.columns(factory.complete(examples[0])),
            steppers=steppers,
            norm=norm_for(built[0], fields.norm).name,
            reference_options=fields.asked,
            order_factors=fields.order_factors,
            largest_stable_dt=fields.largest_stable_dt,
            keep_references=self._design.count <= MOST_KEPT,
            software=software(),
        )


def commented_sweep() -> str:
    """A spec file in which comments say what each value means."""
    return resources.files("ropeode.sweep.design").joinpath("commented.toml").read_text("utf-8")


def read_sweep(path: str | Path) -> SweepSpec:
    """A sweep from a spec file.

    Arguments:
        path: of a TOML file.

    Raises:
        InputError: it cannot be read, or one line for each value that cannot be used.
        UserCodeError: the user's problem file raised.

    Examples:
        >>> from pathlib import Path
        >>> from ropeode import read_sweep
        >>> written = Path("sweep.toml").write_text("grid = {damping = [0.0, 0.1]}")
        >>> read_sweep("sweep.toml").count
        30
    """
    path = Path(path)
    return SweepSpec(read_spec(path), path.parent)
