"""What a sweep is made from, as a TOML file."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator

from ropeode.errors import InputError
from ropeode.norms import norm_for
from ropeode.problems.checks import run as run_checks
from ropeode.problems.problem import Problem
from ropeode.steppers import as_stepper
from ropeode.study.accuracy_table import check_steppers, check_steps, default_steppers
from ropeode.study.spec import StudySpec, kind_apart, read_spec
from ropeode.sweep.design.cases import Case, Design, Settings
from ropeode.sweep.design.columns import COLUMNS, Column
from ropeode.sweep.design.content_hash import surroundings
from ropeode.sweep.design.distributions import Distribution, check_count, check_seeds
from ropeode.sweep.design.problem_factory import FileMaker, Maker, RopeMaker, maker_for
from ropeode.sweep.execution.tasks import MOST_KEPT, SHAPES, Task, batched
from ropeode.validation import complaint, field

DEFAULT_STEPS_PER_FRAME = (16, 32, 64)
DEFAULT_ORDER_FACTORS = (1, 2, 4, 8)
# What may be drawn beside parameters.
_RUNS = ("stepper", "steps_per_frame")
# Problems that are built to see whether all steppers can run on them. More are checked by
# their parameters alone, and what then goes wrong is a row that says so.
_MOST_BUILT = 64


def _steps(value: Any) -> tuple[int, ...]:
    return tuple(check_steps(value))


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
            an empty list where no order is asked for.
        largest_stable_dt: whether that of each stepper on each problem is to be found.

    Raises:
        InputError: one line for each that cannot be used.
    """

    steps_per_frame: Annotated[tuple[int, ...], BeforeValidator(_steps)] = field(
        DEFAULT_STEPS_PER_FRAME, allowed="different whole numbers >= 1", example="[16, 32, 64]"
    )
    order_factors: Annotated[tuple[int, ...], BeforeValidator(_factors)] = field(
        DEFAULT_ORDER_FACTORS,
        allowed="an empty list, or different whole numbers >= 1",
        example="[1, 2, 4, 8]",
    )
    largest_stable_dt: bool = field(False, allowed="true or false", example="true")


class SweepSpec:
    """A sweep, checked as a whole.

    Arguments:
        values: the spec's values. A table `rope` holds parameters that all ropes share, a
            table `parameters` those of other problems; `grid` lists of values by parameter;
            `random` the count of draws, seeds, and a distribution by parameter.
        folder: that the problem's file name starts from.

    Raises:
        InputError: one line for each value that cannot be used.
        UserCodeError: the user's problem file raised.
    """

    def __init__(self, values: Mapping[str, Any], folder: Path | None = None):
        self._folder = (folder or Path()).resolve()
        rest = kind_apart(values)
        tables = {name: rest.pop(name, {}) for name in ("rope", "parameters", "grid", "random")}
        found: dict[str, Any] = {}

        def check_fields() -> None:
            found["fields"] = SweepFields(**rest)
            found["fields"].check_level()

        def check_tables() -> None:
            found["tables"] = _Tables(tables)

        run_checks(check_fields, check_tables)
        self.fields: SweepFields = found["fields"]
        name = self.fields.kind if self.fields.problem == "rope" else self.fields.problem
        if self.fields.problem != "rope" and self.fields.kind != "rope":
            allowed = "none with another problem than 'rope'"
            raise InputError(complaint("kind", self.fields.kind, allowed, "leave it out"))
        self._maker = maker_for(name, self._folder)
        self._design = self._designed(found["tables"])

    @property
    def count(self) -> int:
        """How many cases there are."""
        return self._design.problems * self._design.per_problem

    @property
    def columns(self) -> dict[str, Column]:
        """The columns of its table: those of every sweep, and one for each parameter."""
        return {**COLUMNS, **self._design.columns}

    @property
    def values(self) -> dict[str, Any]:
        """What is asked for, as plain JSON values, in one form however it was written."""
        design, settings = self._design, self._design.settings
        return json.loads(
            json.dumps(
                {
                    **self._maker.identity,
                    "steppers": design.steppers,
                    "steps_per_frame": design.steps_per_frame,
                    "norm": settings.norm,
                    **settings.asked,
                    "order_factors": settings.order_factors,
                    "largest_stable_dt": settings.largest_stable_dt,
                    "fixed": design.fixed,
                    "grid": design.grid,
                    "seeds": design.seeds,
                    "count": design.draws,
                    "random": {name: _said(each) for name, each in design.drawn.items()},
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
        each = self._design.per_problem
        for index in range(start // each, math.ceil(stop / each)):
            for case in self._design.cases_of(self._design.point(index)):
                if start <= case.number < stop:
                    yield case

    def tasks(self, first: int = 0) -> Iterator[Task]:
        """All cases in tasks, made one after the other.

        Arguments:
            first: the task to begin with; the cases of those before are not made.
        """
        settings = self._design.settings
        around = surroundings(str(settings.asked["level"]))
        digest = self._maker.digest if isinstance(self._maker, FileMaker) else None
        keep = self._design.problems <= MOST_KEPT
        for cases in batched(self._design, first):
            yield Task(self._folder, around, digest, keep, cases)

    def _designed(self, tables: _Tables) -> Design:
        fields, maker = self.fields, self._maker
        fixed = tables.fixed(maker)
        if fields.frames is not None:
            if "frames" in {**fixed, **tables.grid, **tables.drawn}:
                raise InputError(_twice("frames"))
            fixed["frames"] = fields.frames
        run_checks(
            lambda: maker.check_names(fixed, "fixed"),
            lambda: maker.check_names(tables.grid, "grid"),
            lambda: maker.check_names(
                {name: each for name, each in tables.drawn.items() if name not in _RUNS}, "random"
            ),
            lambda: self._check_complete({**fixed, **tables.grid, **tables.drawn}),
            lambda: tables.check_steppers(),
            lambda: self._check_lists(tables.drawn),
        )
        # What says how large arrays are changes last, so that few shapes alternate.
        grid = dict(sorted(tables.grid.items(), key=lambda item: item[0] not in SHAPES))
        designed = Design(
            maker=maker,
            fixed=fixed,
            grid=grid,
            drawn=tables.drawn,
            seeds=tables.seeds,
            draws=tables.count,
            steppers=fields.steppers or (),
            steps_per_frame=fields.steps_per_frame,
            settings=Settings(
                norm=fields.norm,
                asked=fields.asked,
                order_factors=fields.order_factors,
                largest_stable_dt=fields.largest_stable_dt,
            ),
            columns={},
        )
        return _checked(designed)

    def _check_complete(self, given: Mapping[str, Any]) -> None:
        faults = [
            complaint(name, None, f"a value: {self._maker.name!r} has no default for it", "give it")
            for name in self._maker.needed
            if name not in given
        ]
        if faults:
            raise InputError(faults)

    def _check_lists(self, drawn: Mapping[str, Distribution]) -> None:
        if "num_nodes" in self._maker.defaults:
            return
        faults = [
            complaint(f"random.{name}", each.for_each, "no for_each without nodes", "leave it out")
            for name, each in drawn.items()
            if each.for_each is not None
        ]
        if faults:
            raise InputError(faults)


class _Tables:
    """The tables of a spec, each checked on its own.

    Raises:
        InputError: one line for each value that cannot be used.
    """

    def __init__(self, given: Mapping[str, Any]):
        self.rope: dict[str, Any] = {}
        self.parameters: dict[str, Any] = {}
        self.grid: dict[str, tuple[Any, ...]] = {}
        self.drawn: dict[str, Distribution] = {}
        self.seeds: tuple[int, ...] = ()
        self.count = 1
        faults = [
            complaint(name, table, "a table", f"write [{name}] above its values")
            for name, table in given.items()
            if not isinstance(table, Mapping)
        ]
        if faults:
            raise InputError(faults)
        self.rope, self.parameters = dict(given["rope"]), dict(given["parameters"])
        run_checks(
            lambda: _check_plain("rope", self.rope),
            lambda: _check_plain("parameters", self.parameters),
            *(
                lambda name=name, values=values: self._set_grid(name, values)
                for name, values in given["grid"].items()
            ),
            *(
                lambda name=name, value=value: self._set_random(name, value)
                for name, value in given["random"].items()
            ),
        )
        self._check_together(given["random"])

    def _set_grid(self, name: str, values: Any) -> None:
        fix = f"for example {name} = [0.0, 0.1] below [grid]"
        if name in _RUNS or name == "steppers":
            top = "steppers" if name == "stepper" else name
            raise InputError(complaint(f"grid.{name}", values, "parameters", f"write {top} above"))
        if not isinstance(values, (list, tuple)) or not values:
            raise InputError(complaint(f"grid.{name}", values, "a list of values", fix))
        _check_plain("grid", {name: list(values)})
        if any(value in values[:at] for at, value in enumerate(values)):
            allowed = "different values"
            raise InputError(complaint(f"grid.{name}", values, allowed, "drop repeated ones"))
        self.grid[name] = tuple(values)

    def _set_random(self, name: str, value: Any) -> None:
        try:
            if name == "count":
                self.count = check_count(value)
            elif name == "seeds":
                self.seeds = check_seeds(value)
            else:
                self._set_drawn(name, value)
        except InputError:
            raise
        except ValueError as error:
            example = {"count": "100", "seeds": "[0, 1]"}.get(name, "{ uniform = [0.0, 0.1] }")
            allowed = {
                "count": "a whole number from 1 to 2^32",
                "seeds": "different whole numbers >= 0",
            }
            words = f"{allowed.get(name, 'a distribution')} ({error})"
            raise InputError(
                complaint(f"random.{name}", value, words, f"for example {name} = {example}")
            ) from None

    def _set_drawn(self, name: str, value: Any) -> None:
        if not isinstance(value, Mapping):
            raise ValueError("it is no table")
        try:
            drawn = Distribution(**value)
        except InputError as error:
            raise InputError([f"random.{name}.{line}" for line in error.problems]) from None
        _check_plain("random", {name: drawn.extremes})
        if name == "steppers":
            raise ValueError("one is drawn at a time: write stepper")
        self.drawn[name] = drawn

    def _check_together(self, random: Mapping[str, Any]) -> None:
        faults = [
            _twice(name)
            for name in {**self.rope, **self.parameters, **self.grid, **self.drawn}
            if sum(name in t for t in (self.rope, self.parameters, self.grid, self.drawn)) > 1
        ]
        if self.drawn and "count" not in random:
            faults.append(complaint("random.count", None, "how many are drawn", "add count = 100"))
        if random and not self.drawn:
            example = "damping = { uniform = [0.0, 0.1] }"
            faults.append(
                complaint("random", [*random], "a parameter to draw", f"for example {example}")
            )
        if faults:
            raise InputError(faults)
        if self.drawn and not self.seeds:
            self.seeds = (0,)

    def fixed(self, maker: Maker) -> dict[str, Any]:
        """The parameters that all problems share.

        Raises:
            InputError: they are in the table of another kind of problem.
        """
        right, wrong = (
            ("rope", "parameters")
            if isinstance(maker, RopeMaker)
            else (
                "parameters",
                "rope",
            )
        )
        if given := getattr(self, wrong):
            raise InputError(
                complaint(wrong, given, f"none with {maker.name!r}", f"write [{right}] above them")
            )
        return dict(getattr(self, right))

    def check_steppers(self) -> None:
        """See that what is drawn of steppers and steps can be used, and has one form.

        Raises:
            InputError: one line for each that cannot.
        """
        if (drawn := self.drawn.get("stepper")) is not None:
            if drawn.choice is None or drawn.for_each is not None:
                fix = 'for example stepper = { choice = ["rk4"] }'
                raise InputError(
                    complaint("random.stepper", _said(drawn), "a choice of names", fix)
                )
            labels = tuple(each.label for each in check_steppers(drawn.choice))
            self.drawn["stepper"] = Distribution(choice=labels)
        if (drawn := self.drawn.get("steps_per_frame")) is not None:
            if not (drawn.choice or drawn.integers) or drawn.for_each is not None:
                fix = "for example steps_per_frame = { integers = [16, 64] }"
                allowed = "whole numbers"
                raise InputError(complaint("random.steps_per_frame", _said(drawn), allowed, fix))
            ends = check_steps(list(dict.fromkeys(drawn.extremes)))
            if drawn.choice:
                self.drawn["steps_per_frame"] = Distribution(choice=tuple(ends))


def _checked(design: Design) -> Design:
    """The design with what it says of its problems filled in: steppers, norm, columns.

    Each value of the grid, each end of a distribution and each stepper is tried, with the
    first values of all other parameters.

    Raises:
        InputError: one line for each that cannot be used.
    """
    maker = design.maker
    tried = [*_tried(design)]
    run_checks(*(lambda each=each: maker.check(each) for each in tried))
    built: list[Problem] = []
    run_checks(*(lambda each=each: built.append(maker.build(each)) for each in tried[:_MOST_BUILT]))
    steppers = tuple(design.steppers)
    if not steppers and "stepper" not in design.drawn:
        steppers = tuple(as_stepper(name).label for name in default_steppers(built[0]))
    drawn = design.drawn.get("stepper")
    every = [as_stepper(name) for name in (drawn.extremes if drawn else steppers)]
    refusals = [refusal for p in built for each in every if (refusal := each.refusal(p))]
    if refusals:
        raise InputError(list(dict.fromkeys(refusals)))
    if design.settings.largest_stable_dt:
        built[0].require_mechanics("largest_stable_dt")
    norm = norm_for(built[0], design.settings.norm)
    return dataclasses.replace(
        design,
        steppers=steppers,
        settings=dataclasses.replace(design.settings, norm=norm.name),
        columns=maker.columns(maker.normal(tried[0])),
    )


def _tried(design: Design) -> Iterator[dict[str, Any]]:
    """Parameters that stand for all others: each value once, with the first of the rest."""
    drawn = {name: each for name, each in design.drawn.items() if name not in _RUNS}
    first = {**design.fixed, **{name: values[0] for name, values in design.grid.items()}}
    ends = {name: each.extremes[0] for name, each in drawn.items()}

    def whole(given: dict[str, Any], ends: Mapping[str, Any]) -> dict[str, Any]:
        for name, end in ends.items():
            entries = design.entries(drawn[name], given)
            given[name] = end if entries is None else [end] * entries
        return design.held(given)

    yield whole({**first}, ends)
    for name, values in design.grid.items():
        for value in values[1:]:
            yield whole({**first, name: value}, ends)
    for name, each in drawn.items():
        for end in each.extremes[1:]:
            yield whole({**first}, {**ends, name: end})


def read_sweep(path: Path) -> SweepSpec:
    """A sweep from a spec file.

    Arguments:
        path: of a TOML file.

    Raises:
        InputError: it cannot be read, or one line for each value that cannot be used.
        UserCodeError: the user's problem file raised.
    """
    return SweepSpec(read_spec(path), Path(path).parent)


def _check_plain(table: str, values: Mapping[str, Any]) -> None:
    """See that values are numbers, words, true or false, and lists of them.

    Raises:
        InputError: one is not.
    """

    def plain(value: Any) -> bool:
        if isinstance(value, (list, tuple)):
            return all(map(plain, value))
        if isinstance(value, float):
            return math.isfinite(value)
        return isinstance(value, (str, int))

    allowed = "finite numbers, words, true or false, and lists of them"
    if faults := [
        complaint(f"{table}.{name}", value, allowed, "write it as one of them")
        for name, value in values.items()
        if not plain(value)
    ]:
        raise InputError(faults)


def _said(drawn: Distribution) -> dict[str, Any]:
    """A distribution as it is written."""
    return drawn.model_dump(exclude_none=True)


def _twice(name: str) -> str:
    allowed = "one place for each parameter"
    return complaint(name, "in two tables", allowed, "take it out of one of them")


COMMENTED_SWEEP = """\
# What `ropeode sweep THIS-FILE -o FOLDER` computes: every stepper with every number of steps on
# every problem of a design. A case that is in the folder already is not computed again, so
# that a sweep can be extended: more values, draws, seeds, steppers or steps.

# "rope", another problem of the library (pendulum, kepler, lorenz, van-der-pol, ...), or your
# own: "FILE.py:NAME", where NAME is a function of parameters that returns a Problem.
problem = "rope"

# With problem "rope": nodes joined by springs ("rope") or by rigid links ("inextensible-rope",
# without a stiffness).
kind = "rope"

# `ropeode steppers` lists them with their options, as in "stormer-verlet:start=rest". By
# default those of `ropeode table` that can run on the problem.
steppers = ["semi-implicit-euler", "rk4"]

# Step sizes: dt = frame / steps_per_frame.
steps_per_frame = [16, 32, 64]

# The order at n steps per frame is observed from runs with n times each of these. [] for none.
order_factors = [1, 2, 4, 8]

# Whether the largest step size is to be found with which a rope can hang still.
largest_stable_dt = false

# How an error is measured: position-max, position-rms, velocity-max or velocity-rms; for
# problems that are not mechanical state-max or state-rms.
norm = "position-max"

# The largest error bound of a reference that is still trusted; by default 1e-8 of how far
# the nodes move.
# accuracy = 1e-6

# Relative tolerance of the references; by default as tight as gains anything.
# rtol = 1e-12

# "consensus" of float64 solvers, or "extended" precision, which needs heyoka:
# pip install '.[extended]'.
level = "consensus"

# With level "extended": to how many digits two runs are to agree, and how many seconds they have.
# digits = 18
# time_limit = 60

# What all ropes share; what is not said here has its default. For other problems: [parameters].
[rope]
gravity = [0.0, -1.0]
initial_velocity = [0.0, 0.0]

# Every combination of these values. Any parameter of the problem may stand here.
[grid]
num_nodes = [8, 16]
damping = [0.01, 0.1]
frames = [20]

# Each combination is taken with each draw: `count` draws for each seed. A draw is
# { uniform = [0.0, 0.1] }, { log_uniform = [10.0, 1000.0] }, { integers = [4, 32] } or
# { choice = [1.0, 2.0] }. Ends that are lists are those of each component. With
# for_each = "node" or "spring" a list is drawn, with an entry for each of them.
[random]
count = 2
seeds = [0]
stiffness = { log_uniform = [50.0, 200.0] }
node_mass = { uniform = [0.5, 2.0], for_each = "node" }
"""
