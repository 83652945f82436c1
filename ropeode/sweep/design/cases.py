"""Cases, the rows to be computed, and tasks, the cases that are computed together."""

from __future__ import annotations

import dataclasses
import functools
import json
from collections.abc import Container, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ropeode.sweep.design.columns import Column
from ropeode.sweep.design.content_hash import digest
from ropeode.sweep.design.problem_factory import column_values
from ropeode.sweep.design.steppers import StepperSource


@dataclasses.dataclass(frozen=True)
class Settings:
    """What all cases of a sweep share; it travels to the workers with each task.

    Arguments:
        problem: its name, as in the spec.
        folder: from which relative file names start.
        identity: of the problem, as `ProblemFactory.identity` has it.
        columns: of the problem's parameters.
        steppers: by label.
        norm: in which errors are measured.
        reference_options: as `ropeode.reference` takes them.
        order_factors: the order at n steps is observed from n times each of these; empty
            where no order is requested.
        largest_stable_dt: whether it is requested.
        keep_references: whether references are kept in the sweep's folder. All cases of a
            problem are in one task, so a reference is needed again only if the sweep is
            extended or the task was interrupted.
        software: that computes the rows, see `content_hash.software`.
    """

    problem: str
    folder: Path
    identity: Mapping[str, str]
    columns: Mapping[str, Column]
    steppers: Mapping[str, StepperSource]
    norm: str
    reference_options: Mapping[str, Any]
    order_factors: tuple[int, ...]
    largest_stable_dt: bool
    keep_references: bool
    software: Mapping[str, str]

    def problem_key(self, parameters: Mapping[str, Any]) -> str:
        """The hash of everything that determines a problem and its reference."""
        options = dict(self.reference_options)
        return digest([dict(self.identity), parameters, options, self._software_digest])

    def case_key(self, problem_key: str, stepper: str, steps: int, *draw: int | None) -> str:
        """The hash of everything that determines a row; the row tells seed and draw too."""
        file = self.steppers[stepper].file
        identity = [stepper.rpartition(":")[2], file] if file else stepper
        rest = [self.norm, list(self.order_factors), self.largest_stable_dt]
        return digest([problem_key, identity, steps, *draw, *rest])

    @functools.cached_property
    def _software_digest(self) -> str:
        return digest(dict(self.software))


@dataclasses.dataclass(frozen=True)
class Case:
    """A row to be computed: one problem, one stepper, one number of steps.

    Arguments:
        number: its place in the sweep, from 0 on; not part of the key.
        key: sha256 of everything that determines the row.
        problem_key: sha256 of everything that determines the problem and its reference.
        parameters: of the problem, all of them, as plain JSON values.
        stepper: its label.
        steps_per_frame: equal steps in each frame.
        seed: of the random design; None without one.
        draw: its number with this seed; None without a random design.
        settings: that all cases share.
    """

    number: int
    key: str
    problem_key: str
    parameters: Mapping[str, Any]
    stepper: str
    steps_per_frame: int
    seed: int | None
    draw: int | None
    settings: Settings

    def inputs(self) -> dict[str, Any]:
        """The input columns of its row."""
        return {
            "key": self.key,
            "problem": self.settings.problem,
            "seed": self.seed,
            "draw": self.draw,
            "stepper": self.stepper,
            "steps_per_frame": self.steps_per_frame,
            "norm": self.settings.norm,
            "parameters": json.dumps(self.parameters, sort_keys=True),
            **column_values(self.settings.columns, self.parameters),
        }


class Task(NamedTuple):
    """Cases that one process computes together.

    Fields:
        number: the task's place in the sweep, from 0 on.
        cases: of problems of one shape, with all their steppers and steps.
    """

    number: int
    cases: tuple[Case, ...]

    def without(self, keys: Container[str]) -> Task | None:
        """The task without the cases that have these keys; None if no case is left."""
        left = tuple(case for case in self.cases if case.key not in keys)
        return self._replace(cases=left) if left else None
