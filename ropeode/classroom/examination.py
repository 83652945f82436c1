"""One submission, checked in this process, which runs nothing else."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.checking.check import check_stepper
from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import generic, undamped
from ropeode.checking.report import CheckReport
from ropeode.checking.time_limit import OutOfTime, kept_output, within
from ropeode.classroom.outcome import Outcome
from ropeode.errors import InputError, RopeodeError, UserCodeError, users_traceback
from ropeode.precision import in_float64
from ropeode.render import check as of_check
from ropeode.render.data import plain
from ropeode.render.markup import Block, Code, Heading, Paragraph, html_part, markdown
from ropeode.steppers import as_stepper
from ropeode.steppers.base import Stepper

# Steps that tell whether two submissions behave alike.
_STEPS, _SEED = 24, 20
# A feedback page has headings of its own above the report.
_LEVEL = 2


def examined(
    name: str, where: str, folder: Path, asked: Mapping[str, Any], say: Callable[[str], None]
) -> Outcome:
    """What becomes of a submission.

    Arguments:
        name: of the submission.
        where: its stepper, from the folder on.
        folder: of all submissions.
        asked: the arguments of `check_stepper`.
        say: is called with what is being done.
    """
    started = time.perf_counter()
    own = folder / where.rpartition(".py")[0]
    if "/" in where:
        # What stands beside it in its own subfolder can be imported and read.
        sys.path.insert(0, str(own.parent))
        os.chdir(own.parent)
    try:
        say("the import")
        with kept_output():
            stepper = as_stepper(where, folder=folder)
        report = check_stepper(stepper, **asked, progress=lambda text, _: say(text))
        say("a comparison with others")
        outcome = outcome_of(name, report, behaviour=_behaviour(stepper, asked["time_limit"]))
    except OutOfTime as error:
        outcome = without_report(name, "out of time", error, folder)
    except UserCodeError as error:
        syntax = isinstance(error.__cause__, SyntaxError)
        outcome = without_report(name, "syntax error" if syntax else "raised", error, folder)
    except InputError as error:
        outcome = without_report(name, "no stepper", error, folder)
    except RopeodeError as error:
        outcome = without_report(name, "raised", error, folder)
    except Exception as error:
        # Nobody is wrong because of this.
        words = f"{type(error).__name__}: {error}; please report it"
        outcome = without_report(name, "fault of ropeode", RopeodeError(words), folder)
    return dataclasses.replace(outcome, seconds=time.perf_counter() - started)


def outcome_of(name: str, report: CheckReport, status: str = "checked", **more: Any) -> Outcome:
    """The outcome of a submission that has a report."""
    blocks = of_check.blocks(report)
    return Outcome(
        name=name,
        status=status,
        verdict=report.verdict,
        order=_observed(report),
        message=_reason(report),
        findings={each.check: each.status for each in report.findings},
        page=html_part(blocks, _LEVEL),
        text=markdown(blocks, _LEVEL),
        orders={
            each["check"]: plain(each["convergence"])
            for each in of_check.as_dict(report)["findings"]
            if each["convergence"] is not None
        },
        **more,
    )


def without_report(name: str, status: str, error: RopeodeError, folder: Path) -> Outcome:
    """The outcome of a submission that could not be checked."""
    message = " ".join(str(error).replace(f"{folder}{os.sep}", "").split())
    blocks: list[Block] = [Heading(f"Check of {name}")]
    if error.__cause__ is not None:
        blocks.append(Code(users_traceback(error.__cause__).replace(f"{folder}{os.sep}", "")))
    blocks.append(Paragraph(f"Not checked: {message}"))
    return Outcome(
        name,
        status,
        message=message,
        page=html_part(blocks, _LEVEL),
        text=markdown(blocks, _LEVEL),
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


def _behaviour(stepper: Stepper, limit: float) -> str:
    """A digest of single steps from fixed random states; empty where a step is not repeatable."""
    examination = Examination(stepper)

    @in_float64
    def steps() -> str:
        random, digest = np.random.default_rng(_SEED), hashlib.sha256()
        for number in range(_STEPS):
            rope = examination.told(generic() if number % 2 else undamped())
            free = rope.args.free[:, None]
            still = np.stack([np.ones_like(free), free])
            moved = rope.y0 + 0.3 * still * random.standard_normal(rope.y0.shape)
            dt = float(random.uniform(0.001, 0.1))
            digest.update(examination.one_step(rope.changed(y0=moved), dt).tobytes())
        return digest.hexdigest()

    try:
        with kept_output():
            once, again = (within(limit, "a comparison with others", steps) for _ in range(2))
    except RopeodeError:
        return ""
    return once if once == again else ""
