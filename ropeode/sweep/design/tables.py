"""The tables of a sweep's spec: shared parameters, a grid, and a random design."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping
from typing import Any

from ropeode.errors import InputError
from ropeode.study import check_steps
from ropeode.sweep.design.distributions import Distribution, Draws
from ropeode.sweep.design.points import OF_RUNS, SHAPES, Design
from ropeode.sweep.design.problem_factory import ProblemFactory, RopeFactory
from ropeode.validation import bad_value, check_all, complaint

NAMES = ("rope", "parameters", "grid", "random")


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
