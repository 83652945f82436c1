"""What became of one submission, how its process says it, and how a folder keeps it."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import ConfigDict, TypeAdapter

from ropeode.files import write_whole
from ropeode.render import Block, Code, Grid, Heading, Paragraph

# The parts of a report, each after the name of its type.
Part = (
    tuple[Literal["Heading"], Heading]
    | tuple[Literal["Paragraph"], Paragraph]
    | tuple[Literal["Code"], Code]
    | tuple[Literal["Grid"], Grid]
)
Status = Literal[
    "checked",
    "syntax error",
    "no stepper",
    "refused",
    "raised",
    "crashed",
    "out of time",
    "out of memory",
    "fault of ropeode",
]


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What became of one submission.

    Arguments:
        name: of the submission.
        status: `checked`; or why it was not, to the end.
        verdict: `right`, `wrong` or `undetermined`; empty where there is none.
        order: the lowest that was observed; None where there is none.
        message: in one line, what is wrong.
        findings: the status of each check, by its name.
        report: in parts, as text: its process is not trusted with a page.
        orders: of each check of order its `convergence`, as in the schema `ropeode.check/1`.
        behaviour: the same for two submissions whose steps give the same results to the last bit;
            empty where that is not known.
        seconds: that it took.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    name: str
    status: Status
    verdict: Literal["right", "wrong", "undetermined", ""] = ""
    order: float | None = None
    message: str = ""
    findings: Mapping[str, str] = dataclasses.field(default_factory=dict)
    report: tuple[Part, ...] = ()
    orders: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    behaviour: str = ""
    seconds: float = 0.0

    @property
    def blocks(self) -> list[Block]:
        """The report, to be written in any form."""
        return [block for _, block in self.report]


def parts(*blocks: Block) -> tuple[Part, ...]:
    """A report as an outcome has it."""
    return tuple((type(block).__name__, block) for block in blocks)  # pyright: ignore


_ADAPTER = TypeAdapter(Outcome)
_COLOUR = re.compile("#[0-9a-f]{6}")


def as_json(outcome: Outcome) -> bytes:
    """An outcome as one line of JSON; what is no Unicode becomes question marks."""
    words = json.dumps(vars(outcome), default=_plain, ensure_ascii=False)
    return words.encode(errors="replace")


def _plain(value: Any) -> Any:
    return dict(value) if isinstance(value, Mapping) else list(value)


def from_json(words: str | bytes) -> Outcome | None:
    """The outcome that was written so; None where it is none, whoever wrote it."""
    try:
        outcome = _ADAPTER.validate_json(words)
    except ValueError:
        return None
    grids = [block for block in outcome.blocks if isinstance(block, Grid)]
    rows = [len(row) == len(grid.headers) for grid in grids for row in grid.rows]
    colours = [each for grid in grids for each in grid.colours.values()]
    return outcome if all(rows) and all(map(_COLOUR.fullmatch, colours)) else None


def keep(outcome: Outcome, key: str, folder: Path) -> None:
    """Keep an outcome for the next command with the same key."""
    contents = {"key": key, "outcome": json.loads(as_json(outcome))}
    write_whole(_file(outcome.name, folder), json.dumps(contents, indent=1))


def kept(name: str, key: str, folder: Path) -> Outcome | None:
    """The outcome that was kept; None where there is none, or another key's, or a damaged one."""
    try:
        contents = json.loads(_file(name, folder).read_bytes())
        return from_json(json.dumps(contents["outcome"])) if contents["key"] == key else None
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return None


def _file(name: str, folder: Path) -> Path:
    return folder / f"{name}.json"
