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
from ropeode.problems.checks import run as run_checks
from ropeode.problems.problem import Problem
from ropeode.study.accuracy_table import StepsPerFrame, check_steps, default_steppers
from ropeode.study.spec import StudySpec, kind_apart, read_spec
from ropeode.sweep.design.cases import Case, Settings, Task
from ropeode.sweep.design.columns import COLUMNS, Column
from ropeode.sweep.design.content_hash import software
from ropeode.sweep.design.distributions import Distribution
from ropeode.sweep.design.problem_factory import problem_factory
from ropeode.sweep.design.steppers import StepperSource, stepper_from, stepper_sources
from ropeode.sweep.design.tables import NAMES, OF_RUNS, Tables, repeated
from ropeode.validation import bad_value, complaint, field

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
# Parameters that determine the size of arrays. In a user's problem others may as well; then a
# task is run in parts.
_SHAPES = ("frames", "num_nodes", "num_masses", "start")
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

        run_checks(check_fields, check_steppers, lambda: checked.update(tables=Tables(tables)))
        self.fields: SweepFields = checked["fields"]
        rope = self.fields.problem == "rope"
        if not rope and self.fields.kind != "rope":
            allowed = "none with a problem other than 'rope'"
            raise bad_value("kind", self.fields.kind, allowed, "leave it out")
        name = self.fields.kind if rope else self.fields.problem
        self._factory = problem_factory(name, folder)
        self._set_design(checked["tables"])
        self._settings = self._checked(folder, checked["steppers"])

    @property
    def count(self) -> int:
        """The number of cases."""
        return self._problems * self._per_problem

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
        return json.loads(
            json.dumps(
                {
                    **settings.identity,
                    "steppers": [] if "stepper" in self._drawn else [*settings.steppers],
                    **({"stepper_files": files} if files else {}),
                    "steps_per_frame": self.fields.steps_per_frame,
                    "norm": settings.norm,
                    **settings.reference_options,
                    "order_factors": settings.order_factors,
                    "largest_stable_dt": settings.largest_stable_dt,
                    "fixed": self._fixed,
                    "grid": self._grid,
                    "seeds": self._seeds,
                    "count": self._draws,
                    "random": {name: each.as_written for name, each in self._drawn.items()},
                }
            )
        )

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
        shape_drawn = any(name in self._drawn for name in _SHAPES)
        number = 0
        for start in range(0, self._problems, _SORTED_AT_ONCE):
            shapes: dict[tuple[int, int, int], list[int]] = {}
            for index in range(start, min(start + _SORTED_AT_ONCE, self._problems)):
                given, *_ = self._given(index, draw_them=shape_drawn)
                shapes.setdefault(self._shape(given), []).append(index)
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
    def _problems(self) -> int:
        """The number of problems."""
        return math.prod(map(len, self._grid.values())) * max(1, len(self._seeds) * self._draws)

    @property
    def _per_problem(self) -> int:
        """The number of cases of each problem."""
        steppers = 1 if "stepper" in self._drawn else len(self._settings.steppers)
        steps = 1 if "steps_per_frame" in self._drawn else len(self.fields.steps_per_frame)
        return steppers * steps

    def _given(
        self, index: int, draw_them: bool = True
    ) -> tuple[dict[str, Any], int | None, int | None]:
        """What the spec says of a problem, maybe with a stepper and steps; its seed and draw."""
        rest, given, seed, draw = index, {**self._fixed}, None, None
        if self._seeds:
            rest, draw = divmod(rest, self._draws)
            rest, at = divmod(rest, len(self._seeds))
            seed = self._seeds[at]
        for name, values in reversed(self._grid.items()):
            rest, at = divmod(rest, len(values))
            given[name] = values[at]
        if draw_them and seed is not None and draw is not None:
            for name, each in self._drawn.items():
                given[name] = each.value(seed, draw, name, self._entries(each, given))
        return self._pins_at_rest(given), seed, draw

    def _cases_of(self, index: int) -> Iterator[Case]:
        """The cases of a problem."""
        given, seed, draw = self._given(index)
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

    def _entries(self, distribution: Distribution, given: Mapping[str, Any]) -> int | None:
        """The number of entries of a list that is drawn; None for what is not a list."""
        if distribution.for_each is None:
            return None
        nodes = given.get("num_nodes", self._factory.defaults.get("num_nodes"))
        return int(nodes) - (distribution.for_each == "spring")

    def _pins_at_rest(self, given: dict[str, Any]) -> dict[str, Any]:
        """The same with drawn velocities of pinned nodes set to zero."""
        distribution = self._drawn.get("initial_velocity")
        if distribution and distribution.for_each == "node" and "initial_velocity" in given:
            velocity = given["initial_velocity"]
            for node in given.get("pinned", self._factory.defaults.get("pinned", ())):
                if 0 <= node < len(velocity):
                    velocity[node] = [0.0] * len(velocity[node])
        return given

    def _shape(self, given: Mapping[str, Any]) -> tuple[int, int, int]:
        """Components of a position, nodes or masses, and frames; 1 for each that is unknown."""
        given = {**self._factory.defaults, **given}

        def whole(name: str) -> int:
            # A value that cannot be used is reported when the problem is built.
            value = given.get(name)
            return int(value) if isinstance(value, (int, float)) and value >= 1 else 1

        start = given.get("start")
        dim = len(start) if isinstance(start, (list, tuple)) else 1
        return dim, max(whole("num_nodes"), whole("num_masses")), whole("frames")

    def _set_design(self, tables: Tables) -> None:
        """Take the tables over, after the names in them have been checked."""
        factory, grid, drawn = self._factory, tables.grid, tables.drawn
        fixed = tables.fixed(factory)
        if self.fields.frames is not None:
            if "frames" in {**fixed, **grid, **drawn}:
                raise InputError(repeated("frames"))
            fixed["frames"] = self.fields.frames
        parameters = {name: each for name, each in drawn.items() if name not in OF_RUNS}
        run_checks(
            lambda: factory.check_names(fixed, "fixed"),
            lambda: factory.check_names(grid, "grid"),
            lambda: factory.check_names(parameters, "random"),
            lambda: factory.check_required({**fixed, **grid, **drawn}),
            tables.check_runs,
            lambda: self._check_lists(drawn),
        )
        self._fixed, self._drawn = fixed, drawn
        self._seeds = tables.draws.seeds if drawn else ()
        self._draws = tables.draws.count
        # Parameters that determine shapes change last, so that few shapes alternate.
        self._grid = dict(sorted(grid.items(), key=lambda item: item[0] not in _SHAPES))

    def _check_lists(self, drawn: Mapping[str, Distribution]) -> None:
        if "num_nodes" in self._factory.defaults:
            return
        faults = [
            complaint(f"random.{name}", each.for_each, "no for_each without nodes", "leave it out")
            for name, each in drawn.items()
            if each.for_each is not None
        ]
        if faults:
            raise InputError(faults)

    def _checked(self, folder: Path, steppers: Mapping[str, StepperSource] | None) -> Settings:
        """The settings of all cases, after examples of the problems have been tried.

        Each value of the grid, each end of a distribution and each stepper is tried, with the
        first values of all other parameters.

        Raises:
            InputError: one line for each that cannot be used.
        """
        factory, fields = self._factory, self.fields
        examples = [*self._examples()]
        run_checks(*(lambda each=each: factory.check(each) for each in examples))
        built: list[Problem] = []
        some = examples[:_MOST_BUILT]
        run_checks(*(lambda each=each: built.append(factory.build(each)) for each in some))
        if "stepper" in self._drawn:
            steppers = stepper_sources(self._drawn["stepper"].extremes, folder)
            self._drawn["stepper"] = Distribution(choice=tuple(steppers))
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
            keep_references=self._problems <= MOST_KEPT,
            software=software(fields.level),
        )

    def _examples(self) -> Iterator[dict[str, Any]]:
        """Parameters that stand for all others: each value once, with the first of the rest."""
        drawn = {name: each for name, each in self._drawn.items() if name not in OF_RUNS}
        first = {**self._fixed, **{name: values[0] for name, values in self._grid.items()}}
        ends = {name: each.extremes[0] for name, each in drawn.items()}

        def example(given: dict[str, Any], ends: Mapping[str, Any]) -> dict[str, Any]:
            for name, end in ends.items():
                entries = self._entries(drawn[name], given)
                given[name] = end if entries is None else [end] * entries
            return self._pins_at_rest(given)

        yield example({**first}, ends)
        for name, values in self._grid.items():
            for value in values[1:]:
                yield example({**first, name: value}, ends)
        for name, each in drawn.items():
            for end in each.extremes[1:]:
                yield example({**first}, {**ends, name: end})


def commented_sweep() -> str:
    """A spec file in which comments say what each value means."""
    return resources.files("ropeode.sweep.design").joinpath("commented.toml").read_text("utf-8")


def read_sweep(path: Path) -> SweepSpec:
    """A sweep from a spec file.

    Arguments:
        path: of a TOML file.

    Raises:
        InputError: it cannot be read, or one line for each value that cannot be used.
        UserCodeError: the user's problem file raised.
    """
    return SweepSpec(read_spec(path), Path(path).parent)
