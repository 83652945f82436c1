"""The report on a stepper, in every format."""

from __future__ import annotations

import csv
import io
import json
import textwrap
from typing import Any

from tabulate import tabulate

from ropeode.checking.report import CheckReport, Claims, Convergence
from ropeode.render import markup
from ropeode.render.data import without_infinities
from ropeode.render.markup import Block, Grid, Heading, Paragraph
from ropeode.render.plain_text import WIDTH, wrapped

SCHEMA = "ropeode.check/1"
_MARKS = {"pass": "ok", "fail": "WRONG", "note": "-", "skip": "skip"}
_HEADERS = ("", "check", "finding")


def as_text(report: CheckReport) -> str:
    """One line or a few for each check, the errors behind what failed, and the verdict."""
    width = max(len(finding.check) for finding in report.findings)
    lines = [*wrapped(title(report)), ""]
    for finding in report.findings:
        head = f"{_MARKS[finding.status]:5}  {finding.check:{width}}  "
        first, *others = _hanging(finding.line, len(head))
        lines += [head + first, *others]
    if found := shown(report):
        lines += ["", *wrapped(_errors_title(found)), *_plain_grid(found)]
    for diagnosis in report.diagnosis:
        lines += ["", *wrapped(f"Diagnosis ({diagnosis.cause}): {diagnosis.line}")]
    for note in report.notes:
        lines += ["", *wrapped(f"Note: {note}")]
    return "\n".join([*lines, "", *wrapped(verdict(report)), ""])


def as_markdown(report: CheckReport) -> str:
    """A pipe table, and the errors behind what failed."""
    return markup.markdown(blocks(report))


def as_latex(report: CheckReport) -> str:
    """Tabulars in the style of the booktabs package."""
    return markup.latex(blocks(report))


def as_html(report: CheckReport) -> str:
    """A page that needs nothing beside it."""
    return markup.html_page(blocks(report))


def as_csv(report: CheckReport) -> str:
    """One line for each check."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("label", "check", "status", "finding"))
    for finding in report.findings:
        writer.writerow((report.label, finding.check, finding.status, finding.line))
    return text.getvalue()


def as_json(report: CheckReport) -> str:
    """Schema `ropeode.check/1`; numbers that do not exist are null."""
    return json.dumps(without_infinities(as_dict(report)), indent=2, allow_nan=False) + "\n"


def as_dict(report: CheckReport) -> dict[str, Any]:
    """The report as nested plain values."""
    return {
        "schema": SCHEMA,
        "label": report.label,
        "claims": vars(report.claims),
        "passed": report.passed,
        "findings": [
            {
                "check": finding.check,
                "status": finding.status,
                "finding": finding.line,
                "evidence": dict(finding.evidence),
                "convergence": _convergence_dict(finding.convergence),
            }
            for finding in report.findings
        ],
        "diagnosis": [
            {"cause": each.cause, "finding": each.line, "evidence": dict(each.evidence)}
            for each in report.diagnosis
        ],
        "notes": list(report.notes),
        "seconds": report.seconds,
    }


def _convergence_dict(found: Convergence | None) -> dict[str, Any] | None:
    if found is None:
        return None
    return {
        "problem": found.problem,
        "expected": found.expected,
        "dt": list(found.dts),
        "quantities": {
            quantity: {
                "errors": list(found.errors[quantity]),
                "resolution": found.resolution[quantity],
                "limit_off": found.limits.get(quantity, (None, None))[0],
                "limit_allowed": found.limits.get(quantity, (None, None))[1],
                "observed": order.observed,
                "ci95": order.ci95,
                "verdict": order.verdict,
                "why": order.why,
                "used": list(order.used),
                "left_out": [vars(point) for point in order.left_out],
            }
            for quantity, order in found.orders.items()
        },
    }


def blocks(report: CheckReport) -> list[Block]:
    """The report as headings, paragraphs and tables."""
    rows = [(_MARKS[each.status], each.check, each.line) for each in report.findings]
    made: list[Block] = [
        Heading(title(report)),
        Paragraph(verdict(report)),
        Grid(_HEADERS, rows, left=frozenset({0, 1, 2}), long=frozenset({2})),
    ]
    if found := shown(report):
        made += [Paragraph(_errors_title(found)), _errors_grid(found)]
    made += [Paragraph(f"Diagnosis ({each.cause}): {each.line}") for each in report.diagnosis]
    return [*made, *(Paragraph(f"Note: {note}") for note in report.notes)]


def title(report: CheckReport) -> str:
    """What was checked, and against which claims."""
    return f"Check of {report.label}: {claims_words(report.claims)}"


def claims_words(claims: Claims) -> str:
    """What is claimed."""
    words = []
    if claims.method is not None:
        words.append(f"claimed to be {claims.method}")
    if claims.order is not None:
        words.append(f"claimed to be of order {claims.order}")
    for claim, what in (
        (claims.symplectic, "be symplectic"),
        (claims.reversible, "be reversible"),
        (claims.conserves_energy, "conserve energy"),
    ):
        if claim is not None:
            words.append(f"claimed to {what}" if claim else f"claimed not to {what}")
    return ", ".join(words) or "nothing is claimed of it, so what is found is not judged by a claim"


def verdict(report: CheckReport) -> str:
    """The end of the matter, in one sentence."""
    judged = [each for each in report.findings if each.status in ("pass", "fail")]
    if report.failed:
        names = ", ".join(each.check for each in report.failed)
        return f"Wrong: {len(report.failed)} of {len(judged)} checks fail ({names})."
    if not report.passed:
        return "No verdict: no check could be judged."
    return f"Right, as far as {_counted(len(judged))} can tell ({report.seconds:.1f} s)."


def _counted(checks: int) -> str:
    return "one check" if checks == 1 else f"{checks} checks"


def shown(report: CheckReport) -> Convergence | None:
    """The errors that are shown, of the first order that failed; JSON has those of all."""
    found = [each.convergence for each in report.failed if each.convergence is not None]
    return found[0] if found else None


def _errors_title(found: Convergence) -> str:
    return f"Largest errors on {found.problem!r}, as dt goes to 0"


def _errors_grid(found: Convergence) -> Grid:
    quantities = list(found.errors)
    rows = [
        (
            f"{dt:.4g}",
            *(_error(found.errors[q][i], found.resolution[q]) for q in quantities),
            "; ".join(filter(None, (_left_out(found, q, dt) for q in quantities))),
        )
        for i, dt in enumerate(found.dts)
    ]
    headers = ("dt", *quantities, "not used")
    if not any(row[-1] for row in rows):
        headers, rows = headers[:-1], [row[:-1] for row in rows]
    return Grid(headers, rows, left=frozenset({1 + len(quantities)}))


def _plain_grid(found: Convergence) -> list[str]:
    grid = _errors_grid(found)
    lines = tabulate(
        [grid.headers, *grid.rows],
        tablefmt="plain",
        disable_numparse=True,
        colalign=["left" if i in grid.left else "right" for i in range(len(grid.headers))],
    ).splitlines()
    return [line.rstrip() for line in lines]


def _error(error: float | None, resolution: float) -> str:
    if error is None:
        return "diverged"
    return f"< {resolution:.1e}" if error < resolution else f"{error:.3e}"


def _left_out(found: Convergence, quantity: str, dt: float) -> str:
    return next((point.reason for point in found.orders[quantity].left_out if point.dt == dt), "")


def _hanging(text: str, indent: int) -> list[str]:
    """The lines of a paragraph that stands to the right of something."""
    first, *others = textwrap.wrap(text, WIDTH - indent) or [""]
    return [first, *(" " * indent + line for line in others)]
