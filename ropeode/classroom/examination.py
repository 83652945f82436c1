"""What is asked of every submission, and one of them, examined in this process alone."""

from __future__ import annotations

import abc
import dataclasses
import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar

from ropeode.checking import CheckReport, OutOfTime
from ropeode.classroom.outcome import Outcome, Status, parts
from ropeode.errors import InputError, RopeodeError, UserCodeError, users_traceback
from ropeode.json_form import json_of
from ropeode.render import Block, Code, Heading, Paragraph
from ropeode.render import blocks as blocks_of
from ropeode.sandbox import Limits

# What an exception says may be as long as its code likes; so many letters are kept.
_MOST_LETTERS = 20_000


@dataclasses.dataclass(frozen=True)
class Asked(abc.ABC):
    """What is asked, as plain values: another process reads it.

    Arguments:
        memory_mib: memory that a submission may hold, in MiB.
    """

    memory_mib: float

    # The status of a submission that is not there, or not of the form that is asked for.
    refused: ClassVar[Status]
    # Modules that are imported when they are first needed; here before the first submission.
    ahead: ClassVar[tuple[str, ...]]

    @property
    @abc.abstractmethod
    def limits(self) -> Limits:
        """Of a submission."""

    @abc.abstractmethod
    def report(
        self, where: Sequence[str], folder: Path, scratch: Path, say: Callable[[str], None]
    ) -> tuple[CheckReport, str]:
        """The report on a submission, and its behaviour as `Outcome` has it.

        Arguments:
            where: its files, from the folder on, as `Submission` has them.
            folder: of all submissions.
            scratch: holds what was laid ready for all of them.
            say: is called with what is being done.

        Raises:
            RopeodeError: there is none; says why.
        """

    def cut_off(self, where: Sequence[str], how: str, during: str) -> CheckReport | None:
        """The report on a submission that ended its process; None where it is not to blame.

        Arguments:
            where: as for `report`.
            how: in words, such as "ended its process (exit code 0)".
            during: what was being done.
        """
        return None


def examined(
    name: str,
    where: Sequence[str],
    folder: Path,
    asked: Asked,
    scratch: Path,
    say: Callable[[str], None],
) -> Outcome:
    """What becomes of a submission.

    Arguments:
        name: of the submission.
        where: its files, from the folder on.
        folder: of all submissions.
        asked: of each.
        scratch: holds what was laid ready for all of them.
        say: is called with what is being done.
    """
    started = time.perf_counter()
    try:
        report, behaviour = asked.report(where, folder, scratch, say)
        outcome = outcome_of(name, report, behaviour=behaviour)
    except OutOfTime as error:
        outcome = without_report(name, "out of time", error, folder)
    except UserCodeError as error:
        syntax = isinstance(error.__cause__, SyntaxError)
        outcome = without_report(name, "syntax error" if syntax else "raised", error, folder)
    except InputError as error:
        outcome = without_report(name, asked.refused, error, folder)
    except RopeodeError as error:
        outcome = without_report(name, "raised", error, folder)
    except Exception as error:
        # Nobody is wrong because of this.
        words = f"{type(error).__name__}: {error}; please report it"
        outcome = without_report(name, "fault of ropeode", RopeodeError(words), folder)
    return dataclasses.replace(outcome, seconds=time.perf_counter() - started)


def outcome_of(name: str, report: CheckReport, status: Status = "checked", **more: Any) -> Outcome:
    """The outcome of a submission that has a report."""
    return Outcome(
        name=name,
        status=status,
        verdict=report.verdict,
        order=_observed(report),
        message=_reason(report),
        findings={each.check: each.status for each in report.findings},
        report=parts(*blocks_of(report)),
        orders={
            each.check: json_of(each.convergence)
            for each in report.findings
            if each.convergence is not None
        },
        **more,
    )


def without_report(name: str, status: Status, error: RopeodeError, folder: Path) -> Outcome:
    """The outcome of a submission that could not be checked."""
    here = f"{folder}{os.sep}"
    said = str(error).replace(here, "")[:_MOST_LETTERS]
    lines = [" ".join(line.split()) for line in said.splitlines()]
    blocks: list[Block] = [Heading(f"Check of {name}")]
    if isinstance(error, UserCodeError) and error.__cause__ is not None:
        traceback = users_traceback(error.__cause__).replace(here, "")
        blocks.append(Code(traceback[:_MOST_LETTERS]))
    blocks += [Paragraph(f"Not checked: {line}") for line in lines]
    return Outcome(
        name,
        status,
        message=" ".join(lines),
        report=parts(*blocks),
    )


def _observed(report: CheckReport) -> float | None:
    """The lowest order that a check of order observed."""
    found = [
        order.observed
        for finding in report.findings
        if finding.convergence is not None
        for order in finding.convergence.orders.values()
        if order.observed is not None
    ]
    return round(min(found), 2) if found else None


def _reason(report: CheckReport) -> str:
    """What is wrong, in one line: the cause where it is known, or the first finding."""
    known = [each for each in report.diagnosis if each.cause not in ("unknown", "unfinished")]
    if known:
        return known[0].line
    findings = report.failed or report.undetermined
    return f"{findings[0].check}: {findings[0].line}" if findings else ""
