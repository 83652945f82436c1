"""The accuracy table as a table of a paper: step sizes down, steppers across."""

from __future__ import annotations

from collections.abc import Sequence

from ropeode.errors import InputError
from ropeode.render import latex, table_words
from ropeode.study import AccuracyTable, Row, StepperOrder
from ropeode.validation import bad_value, unknown

# What can stand in the cells, by the words of the other formats.
LATEX_COLUMNS = tuple(header.lower().replace(" ", "-") for header in table_words.RUN_HEADERS[2:])
_OF_ORDERS, _ERRORS = LATEX_COLUMNS[0], LATEX_COLUMNS[:3]
_NOT_IN_LABELS = set("\\{}%#~^$&, \t\n")


def latex_table(
    table: AccuracyTable,
    columns: Sequence[str] = (_OF_ORDERS,),
    caption: str | None = None,
    label: str | None = None,
) -> str:
    r"""A float to be pasted: a table for each of the columns, orders below the largest errors.

    Arguments:
        table: from `ropeode.accuracy_table`.
        columns: some of `COLUMNS`.
        caption: in LaTeX; by default the problem, the error and the reference's bound.
        label: for ``\ref``; none by default.

    Raises:
        InputError: there is no such column, or the label has signs that LaTeX forbids.
    """
    check_layout(columns, label)
    parts = []
    for column in columns:
        parts += [rf"\emph{{{latex.text(column.replace('-', ' '))}}}\\[1ex]"] * (len(columns) > 1)
        headers, rows, rules = _matrix(table, column)
        parts.append("\n\n\\medskip\n".join(latex.tabulars(headers, rows, {0}, rules=rules)))
        parts.append("\n\\medskip")
    lines = [
        latex.NEEDS,
        latex.comment(table_words.reference_words(table)),
        *(latex.comment(_found(table, each)) for each in table.orders),
        r"\begin{table}",
        r"\centering",
        rf"\caption{{{caption if caption is not None else latex.text(_caption(table, columns))}}}",
        *([] if label is None else [rf"\label{{{label}}}"]),
        latex.SMALL + r"\par\medskip" + "\n",
        *parts[:-1],
        r"\end{table}",
    ]
    return "\n".join(lines) + "\n"


def check_layout(columns: Sequence[str], label: str | None) -> None:
    """Refuse what `latex_table` cannot use, before anything is computed.

    Raises:
        InputError: there is no such column, or the label has signs that LaTeX forbids.
    """
    faults = [
        unknown("column", each, LATEX_COLUMNS) for each in columns if each not in LATEX_COLUMNS
    ]
    if faults:
        raise InputError(faults)
    if not columns or len(set(columns)) < len(columns):
        raise bad_value("columns", ",".join(columns), "one or more, each once", f"try {_OF_ORDERS}")
    if label is not None and (not label or _NOT_IN_LABELS & set(label)):
        raise bad_value("label", label, "letters, digits, ':' and '-'", "for example tab:rope")


def _matrix(
    table: AccuracyTable, column: str
) -> tuple[list[str], list[tuple[str, ...]], tuple[int, ...]]:
    """Headers, rows, and the rows above which there is a line."""
    steppers = [each.stepper for each in table.orders]
    runs = {(row.dt, row.stepper): row for row in table.rows}
    dts = sorted({dt for dt, _ in runs}, reverse=True)
    rows = [
        (_dt_words(dt), *(_cell(runs.get((dt, name)), column) for name in steppers)) for dt in dts
    ]
    if column != _OF_ORDERS:
        return ["Δt", *steppers], rows, ()
    orders = [each.order for each in table.orders]
    ends = [("", "") if o.ci95 is None else [f"{each:.2f}" for each in o.ci95] for o in orders]
    observed = [
        f"{o.observed:.2f}" if o.observed is not None and o.verdict == "converges" else o.verdict
        for o in orders
    ]
    low, high = zip(*ends, strict=True)
    below = [("order", *observed), ("95% low", *low), ("95% high", *high)]
    return ["Δt", *steppers], [*rows, *below], (len(rows),)


def _dt_words(dt: float) -> str:
    """As a fraction, which is short, where it is one."""
    parts = round(1 / dt)
    return f"1/{parts}" if parts > 1 and dt == 1 / parts else f"{dt:.4g}"


def _cell(row: Row | None, column: str) -> str:
    if row is None:
        return ""
    if row.status != "ok" and column in _ERRORS:
        return row.status
    if column == "rhs-evals":
        return str(row.rhs_evaluations or "-")
    if column == "seconds":
        return f"{row.seconds:.2g}"
    errors = dict(zip(_ERRORS, (row.error_max, row.error_final, row.error_rms), strict=True))
    error = errors[column]
    return f"< {row.resolution:.1e}" if error is None else f"{error:.1e}"


def _caption(table: AccuracyTable, columns: Sequence[str]) -> str:
    bound = table.reference.bound(table.norm)[table.reference.trusted - 1]
    shown = f" Shown: {columns[0].replace('-', ' ')}." if len(columns) == 1 else ""
    remarks = [f" {e.stepper} {table_words.order_remark(e)}." for e in table.orders if not e.solves]
    return (
        f"{table_words.title(table)}. {table_words.error_words(table)}{shown} Estimated bound of "
        f"the reference: {bound:.1e}.{''.join(remarks)}"
    )


def _found(table: AccuracyTable, each: StepperOrder) -> str:
    """What the order rests on."""
    cells = zip(table_words.ORDER_HEADERS, table_words.order_cells(table, each), strict=True)
    _, *facts = (f"{name} {cell}" for name, cell in cells)
    more = filter(None, (each.order.why, table_words.left_out_words(table, each)))
    return f"{each.stepper}: {', '.join([*facts, *more])}"
