"""The cases of a sweep, made one by one from their numbers."""

from __future__ import annotations

import dataclasses
import functools
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from ropeode.errors import InputError
from ropeode.sweep.design.columns import Column
from ropeode.sweep.design.content_hash import digest, surroundings
from ropeode.sweep.design.distributions import Distribution
from ropeode.sweep.design.problem_factory import Maker, column_values


@dataclasses.dataclass(frozen=True)
class Settings:
    """What is asked of every case.

    Arguments:
        norm: as for `ropeode.accuracy_table`.
        asked: of the reference, as `ropeode.reference` takes it.
        order_factors: the order at n steps is observed from n times each of these; none
            where no order is asked for.
        largest_stable_dt: whether it is asked for.
    """

    norm: str | None
    asked: Mapping[str, Any]
    order_factors: tuple[int, ...]
    largest_stable_dt: bool


@dataclasses.dataclass(frozen=True)
class Case:
    """A row to be computed: one problem, one stepper, one number of steps.

    Arguments:
        number: where it stands in the sweep, from 0 on; no part of the key.
        key: sha256 of everything that determines the row.
        problem: its name, as the spec says it.
        problem_key: sha256 of everything that determines the problem's reference.
        parameters: of the problem, all of them, as plain JSON values.
        stepper: its name with options.
        steps_per_frame: equal steps in each frame.
        seed: of the random design; None without one.
        draw: which one of the seed; None without a random design.
        settings: what is asked of it.
        in_columns: the parameters as they stand in columns of their own.
    """

    number: int
    key: str
    problem: str
    problem_key: str
    parameters: Mapping[str, Any]
    stepper: str
    steps_per_frame: int
    seed: int | None
    draw: int | None
    settings: Settings
    in_columns: Mapping[str, Any]

    def values(self) -> dict[str, Any]:
        """The input columns of its row."""
        return {
            "key": self.key,
            "problem": self.problem,
            "seed": self.seed,
            "draw": self.draw,
            "stepper": self.stepper,
            "steps_per_frame": self.steps_per_frame,
            "norm": self.settings.norm,
            "parameters": json.dumps(self.parameters, sort_keys=True),
            **self.in_columns,
        }


class Point(NamedTuple):
    """Where in a design a problem stands.

    Fields:
        index: of the problem.
        parameters: that are given, not yet in their normal form.
        seed: of the random design; None without one.
        draw: likewise.
        steppers: to run on it.
        steps_per_frame: to run them with.
    """

    index: int
    parameters: dict[str, Any]
    seed: int | None
    draw: int | None
    steppers: Sequence[str]
    steps_per_frame: Sequence[int]


@dataclasses.dataclass(frozen=True)
class Design:
    """A grid, a random design, or each draw of one at each point of the other.

    Problems are counted with the axes that come first in `grid` changing last, then seeds,
    then draws; steppers and steps are counted within a problem.

    Arguments:
        maker: of the problems.
        fixed: parameters that all of them share.
        grid: the values of each parameter that has several.
        drawn: the distribution of each that is drawn, and maybe of `stepper` and
            `steps_per_frame`.
        seeds: of the draws; none without any.
        draws: of each seed.
        steppers: their names; not used where they are drawn.
        steps_per_frame: likewise.
        settings: what is asked of each case.
        columns: of the parameters.
    """

    maker: Maker
    fixed: Mapping[str, Any]
    grid: Mapping[str, Sequence[Any]]
    drawn: Mapping[str, Distribution]
    seeds: Sequence[int]
    draws: int
    steppers: Sequence[str]
    steps_per_frame: Sequence[int]
    settings: Settings
    columns: Mapping[str, Column]

    @property
    def problems(self) -> int:
        """How many problems there are."""
        return math.prod(map(len, self.grid.values())) * max(1, len(self.seeds) * self.draws)

    @property
    def per_problem(self) -> int:
        """How many cases each problem has."""
        steppers = 1 if "stepper" in self.drawn else len(self.steppers)
        return steppers * (1 if "steps_per_frame" in self.drawn else len(self.steps_per_frame))

    def point(self, index: int) -> Point:
        """Where a problem stands, by its number."""
        point = self.place(index)
        given, seed, draw = point.parameters, point.seed, point.draw
        steppers, steps = self.steppers, self.steps_per_frame
        if seed is not None and draw is not None:
            for name, distribution in self.drawn.items():
                value = distribution.value(seed, draw, name, self.entries(distribution, given))
                if name == "stepper":
                    steppers = (value,)
                elif name == "steps_per_frame":
                    steps = (value,)
                else:
                    given[name] = value
        return Point(index, self.held(given), seed, draw, steppers, steps)

    def place(self, index: int) -> Point:
        """The same before anything is drawn."""
        rest, given, seed, draw = index, {**self.fixed}, None, None
        if self.seeds:
            rest, draw = divmod(rest, self.draws)
            rest, at = divmod(rest, len(self.seeds))
            seed = self.seeds[at]
        for name, values in reversed([*self.grid.items()]):
            rest, at = divmod(rest, len(values))
            given[name] = values[at]
        return Point(index, given, seed, draw, self.steppers, self.steps_per_frame)

    def entries(self, distribution: Distribution, given: Mapping[str, Any]) -> int | None:
        """How many entries a list has that is drawn; None for what is no list."""
        if distribution.for_each is None:
            return None
        nodes = given.get("num_nodes", self.maker.defaults.get("num_nodes"))
        return int(nodes) - (distribution.for_each == "spring")

    def held(self, given: dict[str, Any]) -> dict[str, Any]:
        """Parameters with no velocity drawn for a node that is pinned."""
        drawn = self.drawn.get("initial_velocity")
        if drawn is not None and drawn.for_each == "node" and "initial_velocity" in given:
            velocity = given["initial_velocity"]
            for node in given.get("pinned", self.maker.defaults.get("pinned", ())):
                if 0 <= node < len(velocity):
                    velocity[node] = [0.0] * len(velocity[node])
        return given

    def cases_of(self, point: Point) -> Iterator[Case]:
        """The cases of a problem."""
        try:
            parameters = self.maker.normal(point.parameters)
        except InputError:
            # A case like others until its problem is built, and then a row that says why not.
            parameters = self.maker.as_given(point.parameters)
        in_columns = column_values(self.columns, parameters)
        key = problem_key(self.maker.identity, parameters, self.settings)
        number = point.index * self.per_problem
        for stepper in point.steppers:
            for steps in point.steps_per_frame:
                yield Case(
                    number=number,
                    key=case_key(key, stepper, steps, point.seed, point.draw, self.settings),
                    problem=self.maker.name,
                    problem_key=key,
                    parameters=parameters,
                    stepper=stepper,
                    steps_per_frame=steps,
                    seed=point.seed,
                    draw=point.draw,
                    settings=self.settings,
                    in_columns=in_columns,
                )
                number += 1


def problem_key(
    identity: Mapping[str, Any], parameters: Mapping[str, Any], settings: Settings
) -> str:
    """The hash of everything that determines a problem and its reference."""
    asked = dict(settings.asked)
    return digest(
        [identity, parameters, asked, _surroundings_digest(str(asked.get("level", "consensus")))]
    )


def case_key(
    problem_key: str,
    stepper: str,
    steps_per_frame: int,
    seed: int | None,
    draw: int | None,
    settings: Settings,
) -> str:
    """The hash of everything that determines a row.

    Where it stands in the random design is told in the row, and is part of it.
    """
    rest = [settings.norm, list(settings.order_factors), settings.largest_stable_dt]
    return digest([problem_key, stepper, steps_per_frame, seed, draw, *rest])


@functools.lru_cache(maxsize=2)
def _surroundings_digest(level: str) -> str:
    return digest(dict(surroundings(level)))
