"""Recipes of the stored library: what is solved, how, and what others have found."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator

from ropeode.errors import InputError
from ropeode.files import read_text
from ropeode.norms import NORMS, distance
from ropeode.problems.library import PROBLEMS
from ropeode.problems.problem import Problem
from ropeode.references.certificate import Level
from ropeode.references.ladder import Progress
from ropeode.references.reference import Reference, reference
from ropeode.validation import Input, Positive, WholePositive, complaint, field, unknown


def _known(value: str) -> str:
    if value not in PROBLEMS:
        raise InputError(unknown("problem", value, PROBLEMS))
    return value


class Published(Input):
    """What others have published of a solution.

    Arguments:
        source: where.
        values: positions (or the state) at the last sample, in the order of the array.
        uncertainty: how far they are off at most, in the same units: what their digits leave
            open, and what rounding the problem's decimal numbers to float64 does.
    """

    source: str = field(..., allowed="a text", example='"a paper"')
    values: tuple[Any, ...] = field(..., allowed="a list of numbers", example="[1.0, 2.0]")
    uncertainty: Positive = field(..., allowed="a finite number > 0", example="1e-14")


class Recipe(Input):
    """A problem of the library, and what is asked of its reference.

    Arguments:
        title: one line.
        problem: its name.
        parameters: of the problem.
        level: as for `ropeode.reference`, like what follows.
        accuracy: where it is not the default.
        digits: of an extended reference.
        time_limit: of an extended reference, in seconds.
        published: what others have found.

    Raises:
        InputError: one line for each that cannot be used.
    """

    title: str = field(..., allowed="a text", example='"The default rope"')
    problem: Annotated[str, AfterValidator(_known)] = field(
        ..., allowed="the name of a problem of the library", example='"rope"'
    )
    parameters: dict[str, Any] = field(..., allowed="a table", example="{ frames = 20 }")
    level: Level = field("consensus", allowed="consensus or extended", example='"extended"')
    accuracy: Positive | None = field(None, allowed="a finite number > 0", example="1e-6")
    digits: WholePositive | None = field(None, allowed="a whole number >= 1", example="24")
    time_limit: Positive | None = field(None, allowed="a finite number > 0", example="600")
    published: Published | None = field(
        None, allowed="a table", example='{ source = "...", values = [1.0], uncertainty = 1e-14 }'
    )

    def build(self) -> Problem:
        """The problem."""
        return PROBLEMS[self.problem](**self.parameters)

    def make(
        self, problem: Problem | None = None, progress: Progress = lambda text: None
    ) -> Reference:
        """The reference.

        Arguments:
            problem: with other sample times, where they are not the recipe's own.
            progress: called with a few words before each run.

        Raises:
            ReferenceRefused: there is none.
        """
        asked: Mapping[str, Any] = {"digits": self.digits, "time_limit": self.time_limit}
        return reference(
            problem or self.build(),
            self.accuracy,
            level=self.level,
            progress=progress,
            **{name: value for name, value in asked.items() if value is not None},
        )

    def off_published(self, known: Reference) -> float | None:
        """How far the last sample is from what others have found; None if they have not.

        Arguments:
            known: the recipe's reference.
        """
        if self.published is None:
            return None
        problem, last = known.problem, known.states[-1:]
        quantity = problem.quantities[0]
        theirs = last.copy()
        values = np.asarray(self.published.values, dtype=np.float64)
        if problem.mechanics is None:
            theirs[0] = values.reshape(theirs[0].shape)
        else:
            theirs[0, 0] = values.reshape(theirs[0, 0].shape)
        return float(distance(problem, NORMS[f"{quantity}-max"], last, theirs)[0])


def read_recipe(path: Path) -> tuple[Recipe, str]:
    """A recipe, and the sha256 of its file.

    Arguments:
        path: of a TOML file.

    Raises:
        InputError: it cannot be read or is no recipe.
    """
    text = read_text("recipe", path)
    try:
        recipe = Recipe(**tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise InputError(
            complaint("recipe", str(path), f"a TOML file ({error})", "see those in reference/")
        ) from error
    return recipe, hashlib.sha256(text.encode()).hexdigest()
