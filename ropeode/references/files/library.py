"""The stored library: references that come with the package, by name, and their recipes."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import AfterValidator

from ropeode.errors import InputError
from ropeode.files import parse_toml, read_text
from ropeode.norms import NORMS, distance
from ropeode.problems import PROBLEMS, Problem
from ropeode.references.files.checksum import verify_checksum
from ropeode.references.files.store import load_reference
from ropeode.references.options import ReferenceOptions
from ropeode.references.reference import Reference
from ropeode.validation import Input, Positive, bad_value, field, unknown

MANIFEST = "manifest.json"
_PACKAGE = Path(__file__).resolve().parents[2]


class Entry(NamedTuple):
    """An entry of the manifest: one stored reference.

    Fields:
        title: one line.
        problem: its kind.
        samples: inside the trust horizon, the start included.
        end: time of the last of them.
        level: of the certificate.
        bound: estimated error bound there, of positions or the state.
        horizon: first sample time outside the trust horizon; None if there is none.
        sha256: of the data file, without the checksum at its end.
        recipe_sha256: of the recipe.
    """

    title: str
    problem: str
    samples: int
    end: float
    level: str
    bound: float
    horizon: float | None
    sha256: str
    recipe_sha256: str


def folder() -> Path:
    """The folder of the stored library: in the installed package, or at the top of a checkout."""
    installed = _PACKAGE / "stored_library"
    return installed if installed.is_dir() else _PACKAGE.parent / "reference"


def entries() -> dict[str, Entry]:
    """The entries of the manifest, by name.

    Raises:
        InputError: the manifest cannot be read.
    """
    text = read_text("stored library", folder() / MANIFEST)
    manifest: dict[str, Any] = json.loads(text)
    return {name: Entry(**entry) for name, entry in manifest.items()}


def find(name: str | Path) -> Path:
    """The file of a reference: a file of this name, or else that of the library's entry.

    Arguments:
        name: of a file, or of an entry.

    Raises:
        InputError: there is neither, or the checksum of the library's file is not the manifest's.
    """
    path = Path(name)
    # Not `path.exists()`, which raises where a name is too long.
    if os.path.exists(path) or path.suffix == ".nc":
        return path
    return _stored_file("reference", str(name), "FILE.nc")


def load(name: str) -> Reference:
    """A reference of the stored library; checks its file.

    Arguments:
        name: of an entry; `ropeode reference list` lists them.

    Raises:
        InputError: there is none of this name, or its file is not as it was written.

    Examples:
        >>> from ropeode import load
        >>> load("kepler")
        <Reference: Kepler, 90 frames; heyoka Taylor, 124 bits, estimated bound 1.1e-16,
        trusted to the end>
    """
    # Not `find`: a file of the same name in the current folder is another matter.
    return load_reference(_stored_file("name", str(name)))


def _stored_file(what: str, name: str, *others: str) -> Path:
    """The file of an entry; the message for an unknown name offers `others` too."""
    stored_entries = entries()
    if name not in stored_entries:
        raise InputError(unknown(what, name, [*stored_entries, *others]))
    stored = folder() / f"{name}.nc"
    if verify_checksum(stored) != stored_entries[name].sha256:
        allowed = "the file that the library's manifest names (its sha256 differs)"
        raise bad_value("reference", str(stored), allowed, "install ropeode again")
    return stored


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
