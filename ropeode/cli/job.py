"""The settings of a command, from a spec file and options."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ropeode.cli.options import given_values

if TYPE_CHECKING:
    from ropeode.study import TableJob


def job_from(spec: Path | None, options: Mapping[str, Any]) -> TableJob:
    """The job that a spec file and options describe; options override the file.

    Arguments and errors are those of `values_from`.
    """
    from ropeode.study import TableJob

    return TableJob(*values_from(spec, options))


def values_from(
    spec: Path | None, options: Mapping[str, Any]
) -> tuple[dict[str, Any], Path | None]:
    """The values of a spec file and of options, and the folder that names of files start from.

    Arguments:
        spec: the file, or None; the problem may name one then.
        options: what was typed, by the names that click has for the options of `table_options`.

    Raises:
        InputError: one line for each value that cannot be used.
    """
    from ropeode.study import read_spec

    given, rope = given_values(options)
    if not spec and given.get("problem", "").endswith(".toml"):
        spec = Path(given.pop("problem"))
    values: dict[str, Any] = read_spec(spec) if spec else {}
    if "reference" in given and os.path.exists(given["reference"]):
        # Relative to the current folder, not to that of the spec.
        given["reference"] = str(Path(given["reference"]).resolve())
    values |= given
    if rope and isinstance(values.setdefault("rope", {}), dict):
        values["rope"] |= rope
    return values, None if "problem" in given or not spec else spec.parent
