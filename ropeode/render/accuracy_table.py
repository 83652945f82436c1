"""The accuracy table: runs, and the orders that they show."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ropeode.errors import InputError
from ropeode.render import latex, table_words
from ropeode.render.markup import Block, Grid, Heading, Paragraph, plain
from ropeode.render.results import blocks, line, rows
from ropeode.study import AccuracyTable, Row, StepperOrder
from ropeode.study.error_constant import ErrorConstant
from ropeode.validation import bad_value, counted, unknown

# What can stand in the cells of a table of a paper, by the words of the other formats.
LATEX_COLUMNS = tuple(header.lower().replace(" ", "-") for header in table_words.RUN_HEADERS[2:])
_OF_ORDERS, _ERRORS = LATEX_COLUMNS[0], LATEX_COLUMNS[:3]
_NOT_IN_LABELS = set("\\{}%#~^$&, \t\n")


@line.register
def _(table: AccuracyTable) -> str:
    orders = ", ".join(
        f"{each.stepper} {table_words.observed_words(each.order)}" for each in table.orders
    )
    problem = table_words.problem_words(table.problem)
    return f"{problem}; {counted(len(table.rows), 'run')}; orders: {orders}"


@blocks.register
def _(table: AccuracyTable) -> list[Block]:
    runs = [(row.stepper, *table_words.run_cells(row)) for row in table.rows]
    sentences = {
        "left out": [table_words.left_out_words(table, each) for each in table.orders],
        "remarks": [_remarks(each) for each in table.orders],
        "theory": [table_words.constant_words(table, each) or "" for each in table.orders],
    }
    said = {name: words for name, words in sentences.items() if any(words)}
    facts = [table_words.order_cells(table, each) for each in table.orders]
    orders = [(*cells, *words) for cells, *words in zip(facts, *said.values(), strict=True)]
    first = len(table_words.ORDER_HEADERS)
    long = frozenset(range(first, first + len(said)))
    return [
        Heading(table_words.title(table)),
        Paragraph(table_words.error_words(table)),
        Grid(("stepper", *table_words.RUN_HEADERS), runs, left=frozenset({0})),
        Paragraph(f"Observed orders ({table_words.RUN_HEADERS[2]}, as dt goes to 0):"),
        Grid((*table_words.ORDER_HEADERS, *said), orders, left=long | {0, first - 1}, long=long),
        Paragraph(table_words.reference_words(table)),
    ]


def _remarks(each: StepperOrder) -> str:
    return "; ".join(filter(None, (table_words.order_remark(each), each.order.why)))


@rows.register
def _(table: AccuracyTable) -> list[dict[str, Any]]:
    """One for each run, with the order of its stepper and the reference's bound."""
    orders = {each.stepper: each for each in table.orders}
    lines = []
    for row in table.rows:
        each = orders[row.stepper]
        low, high = each.order.ci95 or (None, None)
        lines.append(
            {
                **vars(row),
                "expected_order": each.expected,
                "observed_order": each.order.observed,
                "order_low": low,
                "order_high": high,
                "verdict": each.order.verdict,
                "used_for_order": row.dt in each.order.used,
                "error_predicted": _error_predicted(row.dt, each.constant),
                "reference_bound": float(table.reference.bound(table.norm)[-1]),
            }
        )
    return lines


def _error_predicted(dt: float, constant: ErrorConstant | None) -> float | None:
    """The leading term of the error of a run."""
    if constant is None or constant.predicted is None or constant.order is None:
        return None
    return constant.predicted * dt**constant.order


def latex_table(
    table: AccuracyTable,
    columns: Sequence[str] = (_OF_ORDERS,),
    caption: str | None = None,
    label: str | None = None,
) -> str:
    r"""A float to be pasted: step sizes down, steppers across, and the evidence as comments.

    Arguments:
        table: from `ropeode.accuracy_table`.
        columns: some of `LATEX_COLUMNS`; each has a table, orders below the largest errors.
        caption: in LaTeX; by default the problem, the error and the reference's bound.
        label: for ``\ref``; none by default.

    Raises:
        InputError: there is no such column, or the label has signs that LaTeX forbids.
    """
    check_layout(columns, label)
    _, _, _, *evidence = blocks(table)
    if caption is None:
        bound = table.reference.bound(table.norm)[table.reference.trusted - 1]
        shown = f" Shown: {_name(columns[0])}." if len(columns) == 1 else ""
        others = [
            f" {e.stepper} {table_words.order_remark(e)}." for e in table.orders if not e.solves
        ]
        words = (
            f"{table_words.title(table)}. {table_words.error_words(table)}{shown} Estimated bound "
            f"of the reference: {bound:.1e}."
        )
        caption = latex.text(words + "".join(others))
    parts = []
    for column in columns:
        heading = rf"\emph{{{latex.text(_name(column))}}}\\[1ex]" + "\n"
        tabulars = latex.tabulars(*_matrix(table, column))
        parts.append(heading * (len(columns) > 1) + "\n\n\\medskip\n".join(tabulars))
    lines = [
        latex.NEEDS,
        *(f"% {line}".rstrip() for line in plain(evidence).splitlines()),
        r"\begin{table}",
        r"\centering",
        rf"\caption{{{caption}}}",
        *([] if label is None else [rf"\label{{{label}}}"]),
        latex.SMALL + r"\par\medskip" + "\n",
        "\n\n\\medskip\n".join(parts),
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


def _matrix(table: AccuracyTable, column: str) -> tuple[Any, ...]:
    """One of `LATEX_COLUMNS` of all runs, as `latex.tabulars` takes a table."""
    steppers = [each.stepper for each in table.orders]
    runs = {(row.dt, row.stepper): row for row in table.rows}
    dts = sorted({dt for dt, _ in runs}, reverse=True)
    rows = [[_size(dt), *(_cell(runs.get((dt, name)), column) for name in steppers)] for dt in dts]
    rules: tuple[int, ...] = ()
    if column == _OF_ORDERS:
        rules = (len(rows),)
        orders = [each.order for each in table.orders]
        ends = [order.ci95 and [f"{end:.2f}" for end in order.ci95] for order in orders]
        rows += [
            ["order", *(table_words.observed_words(order, digits=2) for order in orders)],
            ["95% low", *(each[0] if each else "" for each in ends)],
            ["95% high", *(each[1] if each else "" for each in ends)],
        ]
    return ["Δt", *steppers], rows, {0}, (), rules


def _size(dt: float) -> str:
    """As a fraction, which is short, where it is one."""
    parts = round(1 / dt)
    return f"1/{parts}" if parts > 1 and dt == 1 / parts else f"{dt:.4g}"


def _cell(row: Row | None, column: str) -> str:
    if row is None:
        return ""
    if row.status != "ok" and column in _ERRORS:
        return row.status
    cells = table_words.run_cells(row, digits=1)[2:]
    return dict(zip(LATEX_COLUMNS, cells, strict=True))[column]


def _name(column: str) -> str:
    return column.replace("-", " ")
