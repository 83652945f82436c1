"""The points of a sweep's design: the parameters of its problems, each made from its number."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from ropeode.sweep.design.distributions import Distribution, Draws
from ropeode.sweep.design.problem_factory import ProblemFactory

# May be drawn although they are not parameters of the problem.
OF_RUNS = ("stepper", "steps_per_frame")
# Parameters that determine the size of arrays. In a user's problem others may as well; then a
# task is run in parts.
SHAPES = ("frames", "num_nodes", "num_masses", "start")


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
