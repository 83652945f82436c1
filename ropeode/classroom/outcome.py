"""What became of one submission, and how a folder keeps it."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ropeode.files import write_whole


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What became of one submission, as plain JSON values.

    Arguments:
        name: of the submission.
        status: `checked`; or why it was not, to the end: `syntax error`, `no stepper`, `raised`,
            `crashed`, `out of time`, `out of memory`, `fault of ropeode`.
        verdict: `right`, `wrong` or `undetermined`; empty where there is none.
        order: the lowest that was observed; None where there is none.
        message: in one line, what is wrong.
        findings: the status of each check, by its name.
        page: the report as part of an HTML page.
        text: the report in Markdown.
        orders: of each check of order its `convergence`, as in the schema `ropeode.check/1`.
        behaviour: the same for two submissions whose steps give the same results to the last bit;
            empty where that is not known.
        seconds: that it took.
    """

    name: str
    status: str
    verdict: str = ""
    order: float | None = None
    message: str = ""
    findings: Mapping[str, str] = dataclasses.field(default_factory=dict)
    page: str = ""
    text: str = ""
    orders: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    behaviour: str = ""
    seconds: float = 0.0


def keep(outcome: Outcome, key: str, folder: Path) -> None:
    """Keep an outcome for the next command with the same key."""
    contents = {"key": key, **dataclasses.asdict(outcome)}
    write_whole(_file(outcome.name, folder), json.dumps(contents, indent=1))


def kept(name: str, key: str, folder: Path) -> Outcome | None:
    """The outcome that was kept; None where there is none, or another key's, or a damaged one."""
    try:
        contents = json.loads(_file(name, folder).read_bytes())
        return Outcome(**contents) if contents.pop("key") == key else None
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None


def _file(name: str, folder: Path) -> Path:
    return folder / f"{name}.json"
