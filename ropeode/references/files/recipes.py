"""Recipes of the stored library: the problem, the options, and published values."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator

from ropeode.errors import InputError
from ropeode.files import parse_toml, read_text
from ropeode.norms import NORMS, distance
from ropeode.problems import PROBLEMS, Problem
from ropeode.references.options import ReferenceOptions
from ropeode.references.reference import Reference
from ropeode.validation import Input, Positive, field, unknown


def _library_problem(value: str) -> str:
    if value not in PROBLEMS:
        raise InputError(unknown("problem", value, PROBLEMS))
    return value


class Published(Input):
    """Published values of a solution.

    Arguments:
        source: where.
        values: positions (or the state) at the last sample, in the order of the array.
        uncertainty: their largest error, in the same units: the rounding of their last digit,
            and the effect of rounding the problem's decimal numbers to float64.
    """

    source: str = field(..., allowed="a text", example='"a paper"')
    values: tuple[Any, ...] = field(..., allowed="a list of numbers", example="[1.0, 2.0]")
    uncertainty: Positive = field(..., allowed="a finite number > 0", example="1e-14")


class Recipe(ReferenceOptions):
    """A problem of the library, and the options of its reference.

    Arguments:
        title: one line.
        problem: its name.
        parameters: of the problem.
        published: values from the literature, where there are any.
        others: the `ReferenceOptions`.

    Raises:
        InputError: one line for each that cannot be used.
    """

    title: str = field(..., allowed="a text", example='"The default rope"')
    problem: Annotated[str, AfterValidator(_library_problem)] = field(
        ..., allowed="the name of a problem of the library", example='"rope"'
    )
    parameters: dict[str, Any] = field(..., allowed="a table", example="{ frames = 20 }")
    published: Published | None = field(
        None, allowed="a table", example='{ source = "...", values = [1.0], uncertainty = 1e-14 }'
    )

    def build(self) -> Problem:
        """The problem."""
        return PROBLEMS[self.problem](**self.parameters)

    @property
    def options(self) -> ReferenceOptions:
        """The options of its reference."""
        names = ReferenceOptions.model_fields
        return ReferenceOptions(**{name: getattr(self, name) for name in names})

    def published_error(self, reference: Reference) -> float | None:
        """The distance of the last sample from the published values; None if there are none."""
        if self.published is None:
            return None
        problem, last = reference.problem, reference.states[-1:]
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

    Raises:
        InputError: it cannot be read or is no recipe.
    """
    text = read_text("recipe", path)
    recipe = Recipe(**parse_toml("recipe", path, text, "those in reference/"))
    return recipe, hashlib.sha256(text.encode()).hexdigest()
