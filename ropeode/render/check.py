"""The report on a stepper or on trajectories: the verdict, what explains it, the evidence."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ropeode.analysis import UNSOLVED
from ropeode.checking import CheckReport, Claims, Convergence, Quantity
from ropeode.render.markup import Block, Code, Grid, Heading, Paragraph
from ropeode.render.results import blocks, line, rows
from ropeode.theory import Diagnosis
from ropeode.validation import counted

_MARKS = {"pass": "ok", "fail": "WRONG", "undetermined": "?", "note": "-", "skip": "skip"}
_COLOURS = {"ok": "#00703c", "WRONG": "#c00000", "?": "#b25d00"}
_HEADERS = ("", "check", "finding")
_NO_ORDER = {"does not converge": "none", "undetermined": "undetermined"}


@rows.register
def _(report: CheckReport) -> list[dict[str, Any]]:
    return [
        {
            "label": report.label,
            "check": finding.check,
            "status": finding.status,
            "finding": finding.line,
        }
        for finding in report.findings
    ]


@line.register
def _(report: CheckReport) -> str:
    return f"{report.label}: {verdict(report)}"


@blocks.register
def _(report: CheckReport) -> list[Block]:
    findings = [(_MARKS[each.status], each.check, each.line) for each in report.findings]
    left, long = frozenset({0, 1, 2}), frozenset({2})
    page: list[Block] = [
        Heading(check_title(report)),
        Paragraph(check_summary(report)),
        *(Paragraph("\n".join(_lines_of(each))) for each in report.diagnosis),
        Grid(
            _HEADERS, findings, left, long, _COLOURS, folded=counted(len(report.findings), "check")
        ),
    ]
    if convergence := shown(report):
        page += [Paragraph(_errors_title(convergence)), _errors_grid(convergence)]
    for note in report.notes:
        words, code = _apart(note)
        page += [Paragraph(f"Note: {words}"), *([Code(code)] if code else [])]
    return page


def diagnosis_lines(report: CheckReport) -> list[str]:
    """Each cause of failures, and how it is mended where that is known."""
    return [text for each in report.diagnosis for text in _lines_of(each)]


def _lines_of(diagnosis: Diagnosis) -> list[str]:
    words = f"Diagnosis ({diagnosis.cause}): {diagnosis.line}"
    return [words, *([f"Fix: {diagnosis.remedy}"] if diagnosis.remedy else [])]


def _apart(note: str) -> tuple[str, str]:
    """The sentence of a note, and the lines of Python that may follow it."""
    words, _, code = note.partition("\n\n")
    return words, code


def check_title(report: CheckReport) -> str:
    """The stepper and the claims."""
    return f"Check of {report.label}: {claims_words(report.claims)}"


def claims_words(claims: Claims) -> str:
    """The claims, as part of a sentence."""
    words = []
    if claims.method is not None:
        words.append(f"claimed to be {claims.method}")
    if claims.order is not None:
        words.append(f"claimed to be of order {claims.order}")
    if claims.damped_order is not None:
        words.append(f"of order {claims.damped_order} with damping")
    for claim, what in (
        (claims.symplectic, "be symplectic"),
        (claims.reversible, "be reversible"),
        (claims.conserves_energy, "conserve energy"),
    ):
        if claim is not None:
            words.append(f"claimed to {what}" if claim else f"claimed not to {what}")
    return ", ".join(words) or "nothing is claimed, so orders and structure are only measured"


def check_summary(report: CheckReport) -> str:
    """The verdict, and the order that decided it: what a reader looks for first."""
    return " ".join(filter(None, (verdict(report), _order_words(report))))


def _order_words(report: CheckReport) -> str:
    """The orders that were found and are expected, of the first check of order that failed.

    Where none failed they are those of the first that passed; empty if there is none.
    """
    passed = (
        each.convergence
        for each in report.findings
        # What passes without an order is right for another reason, which its line says.
        if each.status == "pass" and each.convergence and each.convergence.has_orders
    )
    convergence = shown(report) or next(passed, None)
    if convergence is None or convergence.expected is None:
        return ""
    found = {
        quantity: _NO_ORDER.get(order.verdict) or f"{order.observed:.2f}"
        for quantity, order in convergence.orders.items()
    }
    words = ", ".join(f"{order} in {quantity}" for quantity, order in found.items())
    if len({*found.values()}) == 1:
        words = next(iter(found.values()))
    expected = f"expected {convergence.expected}"
    return f"On the problem {convergence.problem!r} its order is {words}; {expected}."


def verdict(report: CheckReport) -> str:
    """The verdict in one sentence; it counts every check that was asked for."""
    count = dict.fromkeys(_MARKS, 0)
    for finding in report.findings:
        count[finding.status] += 1
    checks = counted(len(report.findings), "check")
    if report.failed:
        names = ", ".join(each.check for each in report.failed)
        verb = "fails" if count["fail"] == 1 else "fail"
        if report.otherwise_right and count["pass"]:
            return (
                f"Wrong in an edge case, otherwise right: {count['fail']} of {checks} {verb} "
                f"({names}), {count['pass']} passed."
            )
        return f"Wrong: {count['fail']} of {checks} {verb} ({names})."
    if report.undetermined:
        names = ", ".join(each.check for each in report.undetermined)
        return (
            f"Undetermined: the evidence of {len(report.undetermined)} of {checks} is too thin for "
            f"a verdict ({names}); none failed."
        )
    if not report.passed:
        return f"No verdict: none of {checks} can pass or fail without a claim."
    others = "".join(
        f"; {count[status]} {words}"
        for status, words in (("note", "only measured (no claim)"), ("skip", "not applicable"))
        if count[status]
    )
    return (
        f"Right: {count['pass']} of {checks} passed, none failed{others} ({report.seconds:.1f} s)."
    )


def shown(report: CheckReport) -> Convergence | None:
    """The errors to show: of the first order that failed. JSON has those of all orders."""
    failed = (each.convergence for each in report.failed if each.convergence is not None)
    return next(failed, None)


def _errors_title(convergence: Convergence) -> str:
    return f"Largest errors on the problem {convergence.problem!r}, as dt goes to 0:"


def _errors_grid(convergence: Convergence) -> Grid:
    quantities = convergence.quantities
    runs = [
        (
            f"{dt:.4g}",
            *(_error(each.errors[i], each, dt) for each in quantities.values()),
            _not_used({name: _left_out(each, dt) for name, each in quantities.items()}),
        )
        for i, dt in enumerate(convergence.dts)
    ]
    headers = ("dt", *quantities, "not used")
    if not any(run[-1] for run in runs):
        headers, runs = headers[:-1], [run[:-1] for run in runs]
    return Grid(headers, runs, left=frozenset({1 + len(quantities)}))


def _not_used(reasons: Mapping[str, str]) -> str:
    """Once where it is the same for all quantities."""
    if len({*reasons.values()}) == 1:
        return next(iter(reasons.values()))
    return "; ".join(f"{why} ({quantity})" for quantity, why in reasons.items() if why)


def _error(error: float | None, quantity: Quantity, dt: float) -> str:
    if error is None:
        return UNSOLVED if _left_out(quantity, dt) == UNSOLVED else "diverged"
    return f"< {quantity.resolution:.1e}" if error < quantity.resolution else f"{error:.3e}"


def _left_out(quantity: Quantity, dt: float) -> str:
    return next((point.reason for point in quantity.order.left_out if point.dt == dt), "")
