"""The tables of a sweep's spec, and its points: the parameters of each problem by its number.

The tables hold shared parameters, a grid, and a random design.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from ropeode.errors import InputError
from ropeode.study import check_steps
from ropeode.sweep.design.distributions import Distribution, Draws
from ropeode.sweep.design.problem_factory import ProblemFactory, RopeFactory
from ropeode.validation import bad_value, check_all, complaint

NAMES = ("rope", "parameters", "grid", "random")
# May be drawn although they are not parameters of the problem.
OF_RUNS = ("stepper", "steps_per_frame")
# Parameters that determine the size of arrays. In a user's problem others may as well; then a
# task is run in parts.
SHAPES = ("frames", "num_nodes", "num_masses", "start")


class Tables:
    """The tables of a spec, each checked on its own.

    Arguments:
        tables: by name, all of `NAMES`.

    Raises:
        InputError: one line for each value that cannot be used.
    """

    def __init__(self, tables: Mapping[str, Any]):
        self.grid: dict[str, tuple[Any, ...]] = {}
        self.drawn: dict[str, Distribution] = {}
        faults = [
            complaint(name, table, "a table", f"write [{name}] above its values")
            for name, table in tables.items()
            if not isinstance(table, Mapping)
        ]
        if faults:
            raise InputError(faults)
        self.shared = {name: dict(tables[name]) for name in ("rope", "parameters")}
        random = dict(tables["random"])
        draws = {name: random.pop(name) for name in Draws.model_fields if name in random}
        check_all(
            *(lambda item=item: _check_plain(*item) for item in self.shared.items()),
            *(lambda item=item: self._set_grid(*item) for item in tables["grid"].items()),
            *(lambda item=item: self._set_drawn(*item) for item in random.items()),
            lambda: self._set_draws(draws),
        )
        self._check_together(draws)
        # A list is drawn with one entry for each node, so the number of nodes is drawn before.
        self.drawn = dict(sorted(self.drawn.items(), key=lambda item: bool(item[1].for_each)))

    def _set_grid(self, name: str, values: Any) -> None:
        fix = f"for example {name} = [0.0, 0.1] below [grid]"
        if name in (*OF_RUNS, "steppers"):
            top = "steppers" if name == "stepper" else name
            fix = f"write {top} above all tables"
            raise bad_value(f"grid.{name}", values, "parameters of the problem", fix)
        if not isinstance(values, (list, tuple)) or not values:
            raise bad_value(f"grid.{name}", values, "a list of values", fix)
        _check_plain("grid", {name: list(values)})
        if any(value in values[:at] for at, value in enumerate(values)):
            fix = "remove the repeated ones"
            raise bad_value(f"grid.{name}", values, "different values", fix)
        self.grid[name] = tuple(values)

    def _set_draws(self, values: Mapping[str, Any]) -> None:
        with _in_table("random."):
            self.draws = Draws(**values)

    def _set_drawn(self, name: str, value: Any) -> None:
        what = f"random.{name}"
        if name == "steppers":
            raise bad_value(what, value, "one stepper for each draw", "name it stepper")
        if not isinstance(value, Mapping):
            fix = f"for example {name} = {{ uniform = [0.0, 0.1] }}"
            raise bad_value(what, value, "a distribution, which is a table", fix)
        with _in_table(f"{what}."):
            self.drawn[name] = Distribution(**value)
        _check_plain("random", {name: self.drawn[name].extremes})

    def _check_together(self, draws: Mapping[str, Any]) -> None:
        places = [*self.shared.values(), self.grid, self.drawn]
        names = [name for place in places for name in place]
        faults = [_repeated(name) for name in dict.fromkeys(names) if names.count(name) > 1]
        if self.drawn and "count" not in draws:
            allowed = "the number of draws for each seed"
            faults.append(complaint("random.count", None, allowed, "add count = 100"))
        if draws and not self.drawn:
            fix = "for example damping = { uniform = [0.0, 0.1] }"
            faults.append(complaint("random", [*draws], "at least one parameter to draw", fix))
        if faults:
            raise InputError(faults)

    def design(self, factory: ProblemFactory, frames: int | None) -> Design:
        """The design that the tables describe.

        Arguments:
            factory: of the problems.
            frames: of all problems; None where a table may say it.

        Raises:
            InputError: one line for each value that does not fit these problems.
        """
        right, wrong = "rope", "parameters"
        if not isinstance(factory, RopeFactory):
            right, wrong = wrong, right
        if misplaced := self.shared[wrong]:
            allowed = f"no such table with {factory.name!r}"
            raise bad_value(wrong, misplaced, allowed, f"write [{right}] above them")
        fixed = dict(self.shared[right])
        if frames is not None:
            if "frames" in {**fixed, **self.grid, **self.drawn}:
                raise InputError(_repeated("frames"))
            fixed["frames"] = frames
        parameters = {name: each for name, each in self.drawn.items() if name not in OF_RUNS}
        check_all(
            lambda: factory.check_names(fixed, "fixed"),
            lambda: factory.check_names(self.grid, "grid"),
            lambda: factory.check_names(parameters, "random"),
            lambda: factory.check_required({**fixed, **self.grid, **self.drawn}),
            self._check_runs,
            lambda: self._check_lists("num_nodes" in factory.defaults),
        )
        # Parameters that determine shapes change last, so that few shapes alternate.
        grid = dict(sorted(self.grid.items(), key=lambda item: item[0] not in SHAPES))
        return Design(factory, fixed, grid, self.drawn, self.draws)

    def _check_runs(self) -> None:
        """See that the drawn steppers are a choice, and the drawn steps whole numbers."""
        stepper, steps = (self.drawn.get(name) for name in OF_RUNS)
        if stepper and (stepper.choice is None or stepper.for_each is not None):
            fix = 'for example stepper = { choice = ["rk4"] }'
            raise bad_value("random.stepper", stepper.as_written, "a choice of names", fix)
        if steps:
            if not (steps.choice or steps.integers) or steps.for_each is not None:
                fix = "for example steps_per_frame = { integers = [16, 64] }"
                raise bad_value("random.steps_per_frame", steps.as_written, "whole numbers", fix)
            extremes = list(steps.extremes)
            different = [n for at, n in enumerate(extremes) if n not in extremes[:at]]
            checked = check_steps(different)
            if steps.choice:
                self.drawn["steps_per_frame"] = Distribution(choice=tuple(checked))

    def _check_lists(self, have_nodes: bool) -> None:
        faults = [
            complaint(f"random.{name}", each.for_each, "no for_each without nodes", "leave it out")
            for name, each in self.drawn.items()
            if each.for_each is not None and not have_nodes
        ]
        if faults:
            raise InputError(faults)


@contextlib.contextmanager
def _in_table(name: str) -> Iterator[None]:
    """Put the name of a table before the names of the fields that cannot be used."""
    try:
        yield
    except InputError as error:
        raise InputError(name + line for line in error.problems) from None


def _repeated(name: str) -> str:
    """The complaint about a parameter that stands in two tables."""
    allowed = "one place for each parameter"
    return complaint(name, "in two tables", allowed, "remove it from one of them")


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


class Point(NamedTuple):
    """What the spec says of a problem.

    Fields:
        given: parameters by name, maybe with a stepper and steps.
        seed: of the random design; None without one.
        draw: its number with this seed; likewise.
    """

    given: dict[str, Any]
    seed: int | None = None
    draw: int | None = None


@dataclasses.dataclass(frozen=True)
class Design:
    """A grid of parameters, a random design, or each draw of one at each point of the other.

    Arguments:
        factory: of the problems.
        fixed: the parameters that all problems share.
        grid: values by parameter; the first parameter changes last.
        drawn: distributions by parameter, or by one of `OF_RUNS`.
        draws: how many there are.
    """

    factory: ProblemFactory
    fixed: dict[str, Any]
    grid: dict[str, tuple[Any, ...]]
    drawn: dict[str, Distribution]
    draws: Draws

    @property
    def count(self) -> int:
        """The number of points."""
        draws = len(self.draws.seeds) * self.draws.count if self.drawn else 1
        return math.prod(map(len, self.grid.values())) * draws

    @property
    def values(self) -> dict[str, Any]:
        """The design as a spec has it."""
        return {
            "fixed": self.fixed,
            "grid": self.grid,
            "seeds": self.draws.seeds if self.drawn else (),
            "count": self.draws.count,
            "random": {name: each.as_written for name, each in self.drawn.items()},
        }

    def point(self, index: int) -> Point:
        """The point with this number, from 0 on."""
        given, seed, draw = self._on_grid(index)
        if seed is not None and draw is not None:
            for name, each in self.drawn.items():
                given[name] = each.value(seed, draw, name, self._entries(each, given))
        return Point(self._pins_at_rest(given), seed, draw)

    def _on_grid(self, index: int) -> Point:
        """A point, and nothing that is drawn."""
        rest, given, seed, draw = index, {**self.fixed}, None, None
        if self.drawn:
            seeds = self.draws.seeds
            rest, draw = divmod(rest, self.draws.count)
            rest, at = divmod(rest, len(seeds))
            seed = seeds[at]
        for name, values in reversed(self.grid.items()):
            rest, at = divmod(rest, len(values))
            given[name] = values[at]
        return Point(given, seed, draw)

    def shape(self, index: int) -> tuple[int, int, int]:
        """Components of a position, nodes or masses, and frames; 1 for each that is unknown."""
        point = self.point(index) if self._draws_shapes else self._on_grid(index)
        given = {**self.factory.defaults, **point.given}

        def whole(name: str) -> int:
            # A value that cannot be used is reported when the problem is built.
            value = given.get(name)
            return int(value) if isinstance(value, (int, float)) and value >= 1 else 1

        start = given.get("start")
        dim = len(start) if isinstance(start, (list, tuple)) else 1
        return dim, max(whole("num_nodes"), whole("num_masses")), whole("frames")

    @functools.cached_property
    def _draws_shapes(self) -> bool:
        return any(name in self.drawn for name in SHAPES)

    def examples(self) -> Iterator[dict[str, Any]]:
        """Parameters that stand for all others: each value once, with the first of the rest."""
        drawn = {name: each for name, each in self.drawn.items() if name not in OF_RUNS}
        first = {**self.fixed, **{name: values[0] for name, values in self.grid.items()}}
        ends = {name: each.extremes[0] for name, each in drawn.items()}

        def example(given: dict[str, Any], ends: Mapping[str, Any]) -> dict[str, Any]:
            for name, end in ends.items():
                entries = self._entries(drawn[name], given)
                given[name] = end if entries is None else [end] * entries
            return self._pins_at_rest(given)

        yield example({**first}, ends)
        for name, values in self.grid.items():
            for value in values[1:]:
                yield example({**first, name: value}, ends)
        for name, each in drawn.items():
            for end in each.extremes[1:]:
                yield example({**first}, {**ends, name: end})

    def _entries(self, distribution: Distribution, given: Mapping[str, Any]) -> int | None:
        """The number of entries of a list that is drawn; None for what is not a list."""
        if distribution.for_each is None:
            return None
        nodes = given.get("num_nodes", self.factory.defaults.get("num_nodes"))
        return int(nodes) - (distribution.for_each == "spring")

    def _pins_at_rest(self, given: dict[str, Any]) -> dict[str, Any]:
        """The same with drawn velocities of pinned nodes set to zero."""
        distribution = self.drawn.get("initial_velocity")
        if distribution and distribution.for_each == "node" and "initial_velocity" in given:
            velocity = given["initial_velocity"]
            for node in given.get("pinned", self.factory.defaults.get("pinned", ())):
                if 0 <= node < len(velocity):
                    velocity[node] = [0.0] * len(velocity[node])
        return given
