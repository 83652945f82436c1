"""The settings of a command, from a spec file and options."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ropeode.cli.options import given_values

if TYPE_CHECKING:
    from ropeode.study.spec import TableJob


def job_from(spec: Path | None, options: Mapping[str, str | None]) -> TableJob:
    """The job that a spec file and options describe; options override the file.

    Arguments:
        spec: the file, or None.
        options: from click; None for those that the user left out.

    Raises:
        InputError: one line for each value that cannot be used.
    """
    from ropeode.study.spec import TableJob, read_spec

    values: dict[str, Any] = read_spec(spec) if spec else {}
    given, rope = given_values(options)
    values |= given
    if rope:
        values["rope"] = {**values.get("rope", {}), **rope}
    return TableJob(values, folder=None if "problem" in given or not spec else spec.parent)
