"""What a command is asked to compute, from a spec file and options."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ropeode.cli.options import given_values

if TYPE_CHECKING:
    from ropeode.study.spec import TableJob


def job_from(spec: Path | None, options: Mapping[str, str | None]) -> TableJob:
    """What the spec file asks for, where there is one, and the options, which come first.

    Arguments:
        spec: the file.
        options: from click, None where nothing was typed.

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
