"""Markdown from a result file. It knows no times by itself, and needs no JAX."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from math import log
from typing import Any, NamedTuple

from tabulate import tabulate

from against.reasons import REASONS

PARTS = {
    "stepping": "one rope, the same steps",
    "true error": "one rope, the same true error",
    "many ropes": "many ropes",
    "references": "references, the same true error",
    "study": "a convergence study",
}

Row = dict[str, Any]
Case = dict[str, Any]


class Ratio(NamedTuple):
    """A row's time over that of ropeode in the same round."""

    median: float
    low: float
    high: float


def ratio(row: Row, base: Row) -> Ratio:
    """Of the rounds that both have; of medians where one was run but once."""
    pairs = list(zip(row["values"], base["values"], strict=False))
    if len(pairs) < 2:
        only = statistics.median(row["values"]) / statistics.median(base["values"])
        return Ratio(only, only, only)
    found = [value / own for value, own in pairs]
    return Ratio(statistics.median(found), min(found), max(found))


def short(number: float) -> str:
    """Three digits, without an exponent where that can be read."""
    if number >= 99.95:
        return f"{number:.0f}"
    return f"{number:#.3g}".rstrip(".") if number >= 1e-3 else f"{number:.1e}"


def spread(low: float, high: float) -> str:
    return f"{short(low)} to {short(high)}" if low < high else "one run"


def shown(case: Case) -> list[tuple[Row, Row | None]]:
    """The rows of a case: of each solver that with the faster right-hand side, and the other."""
    found: dict[tuple[str, str], list[Row]] = {}
    for row in case["rows"]:
        found.setdefault((row["by"], row["how"]), []).append(row)
    pairs = []
    for rows in found.values():
        first, *others = sorted(rows, key=lambda row: statistics.median(row["values"]))
        pairs.append((first, others[0] if others else None))
    return pairs


def times(row: Row, base: Row) -> list[str]:
    """Median, spread, ratio and its spread."""
    of = ratio(row, base)
    return [
        short(statistics.median(row["values"])),
        spread(min(row["values"]), max(row["values"])),
        "1" if row is base else short(of.median),
        "" if row is base else spread(of.low, of.high),
    ]


def markdown(headers: list[str], rows: list[list[str]], words: int) -> str:
    """A table whose first columns are words; nothing where there is nothing to tell."""
    if not rows:
        return ""
    align = ["left"] * words + ["right"] * (len(headers) - words)
    cells = [[cell.replace("|", r"\|") for cell in row] for row in rows]
    return tabulate(cells, headers, tablefmt="pipe", disable_numparse=True, colalign=align)


def of_part(results: dict[str, Any], part: str) -> list[Case]:
    return [case for case in results["cases"] if case["part"] == part]


def stepping(results: dict[str, Any], part: str = "stepping") -> str:
    """One table: a line for each case and peer."""
    rows, unit = [], ""
    for case in of_part(results, part):
        base, unit = case["rows"][0], case["unit"]
        for number, (row, _) in enumerate(shown(case)):
            name = "" if number else case["case"]
            rows.append([name, row["by"], row["how"], *times(row, base)])
    headers = ["case", "by", "how", unit, "min to max", "/ ropeode", "min to max"]
    return markdown(headers, rows, words=3)


def many(results: dict[str, Any]) -> str:
    """Many ropes at once."""
    return stepping(results, "many ropes")


def true_error(results: dict[str, Any]) -> str:
    """Constant steps of different methods, to one true error."""
    rows = []
    for case in of_part(results, "true error"):
        base = case["rows"][0]
        for row in case["rows"]:
            told = [f"{row['true_error']:.1e}", str(row["steps"])]
            rows.append([row["by"], row["how"], *told, *times(row, base)])
    headers = ["by", "how", "true error", "steps", "ms", "min to max", "/ ropeode", "min to max"]
    return markdown(headers, rows, words=2)


def references(results: dict[str, Any]) -> str:
    """A table for each problem and accuracy."""
    parts = []
    for case in of_part(results, "references"):
        base, rows = case["rows"][0], []
        for row, slower in shown(case):
            bound = f", bound {row['bound']:.1e}" if "bound" in row else ""
            other = ""
            if slower:
                other = f"{slower['rhs']} {short(statistics.median(slower['values']))}"
            counted, compiled = row.get("evaluations"), row.get("compile_seconds")
            rows.append(
                [
                    f"{row['by']}, {row['how']}{bound}",
                    row["rhs"] or "-",
                    f"{row['tolerance']:.0e}",
                    f"{row['true_error']:.1e}",
                    *times(row, base),
                    other or "-",
                    "-" if counted is None else str(counted),
                    "-" if not compiled else short(compiled),
                ]
            )
        headers = ["by", "rhs", "rtol", "true error", "ms", "min to max", "/ ropeode"]
        headers += ["min to max", "other rhs, ms", "rhs evals", "compile, s"]
        missed = ""
        if case["missed"]:
            missed = f"\n\nNot reached at any tolerance: {', '.join(case['missed'])}."
        parts.append(f"**{case['case']}**\n\n{markdown(headers, rows, words=2)}{missed}")
    return "\n\n".join(parts)


def study(results: dict[str, Any]) -> str:
    """The times of a convergence study, what each tells, and what is true."""
    parts = []
    for case in of_part(results, "study"):
        base = case["rows"][0]
        rows = [
            [row["by"], row["how"], *times(row, base), str(row.get("evaluations", "-"))]
            for row in case["rows"]
        ]
        headers = ["by", "how", case["unit"], "min to max", "/ ropeode", "min to max", "rhs evals"]
        parts.append(f"**{case['case']}**\n\n{markdown(headers, rows, words=2)}")
        parts.append(_reports(case))
        parts.append(_orders(case))
    return "\n\n".join(parts)


def _reports(case: Case) -> str:
    rows = []
    for report in case["reports"]:
        told, true = report["ropeode"], report["ropeode_true"]
        line = [str(report["steps_per_frame"])]
        line.append(f"< {report['ropeode_resolution']:.1e}" if told is None else f"{told:.3e}")
        line.append(f"{true:.3e}")
        if "nodepy" in report:
            off = report["nodepy"] / report["nodepy_true"] - 1
            line += [f"{report['nodepy']:.3e}", f"{report['nodepy_true']:.3e}", f"{off:+.1%}"]
        rows.append(line)
    headers = ["steps/frame", "ropeode tells", "true", "NodePy tells", "true", "off by"]
    return markdown(headers[: len(rows[0])], rows, words=0)


def _orders(case: Case) -> str:
    order = case["order"]
    if order["observed"] is None:
        text = f"ropeode: {order['verdict']}, {order['why']}."
    else:
        low, high = order["ci95"]
        text = (
            f"ropeode: {order['verdict']}, order {order['observed']:.3f} [{low:.3f}, {high:.3f}] "
            f"from {len(order['used'])} step sizes"
        )
        reasons = [f"dt {left['dt']:.4g}: {left['reason']}" for left in order["left_out"]]
        text += f"; left out: {', '.join(reasons)}." if reasons else "."
    if "nodepy" not in case["reports"][0]:
        return text
    slopes = _slopes(case)
    return (
        f"{text}\n\nNodePy gives no order. The slopes between neighbours in its plot are "
        f"{', '.join(f'{slope:.2f}' for slope in slopes)}."
    )


def _slopes(case: Case) -> list[float]:
    """Of NodePy's errors over the step sizes, between neighbours."""
    pairs = zip(case["reports"], case["reports"][1:], strict=False)
    return [
        log(a["nodepy"] / b["nodepy"]) / log(b["steps_per_frame"] / a["steps_per_frame"])
        for a, b in pairs
    ]


class Beside(NamedTuple):
    """What a peer took in a case, beside ropeode."""

    part: str
    peer: str
    case: str
    ratio: Ratio


def beside(results: dict[str, Any]) -> list[Beside]:
    """Each peer in each case; of references each solver, with the faster right-hand side."""
    return [
        Beside(
            case["part"],
            row["by"] if case["part"] != "references" else f"{row['by']} {row['how']}",
            case["case"],
            ratio(row, case["rows"][0]),
        )
        for case in results["cases"]
        for row, _ in shown(case)
        if row["by"] != "ropeode"
    ]


def losses(results: dict[str, Any]) -> str:
    """Where a peer takes less time than ropeode: in how many cases, by how much, and why.

    Raises:
        SystemExit: nobody has said why.
    """
    found: dict[tuple[str, str], list[float]] = {}
    for each in beside(results):
        found.setdefault((each.part, each.peer), []).append(each.ratio.median)
    lines = []
    for key, ratios in found.items():
        lost = [ratio for ratio in ratios if ratio < 1]
        if not lost:
            continue
        if key not in REASONS:
            raise SystemExit(f"{key}: faster than ropeode, and against/reasons.py does not say why")
        part, peer = key
        low, high = short(min(lost)), short(max(lost))
        lines.append(
            f"- **{peer}**, {PARTS[part]}: faster in {len(lost)} of {len(ratios)} cases, "
            f"{low if low == high else f'{low} to {high}'} of ropeode's time. {REASONS[key]}"
        )
    return "\n".join(lines) or "Nowhere in this run."


def made(results: dict[str, Any]) -> str:
    """With what, and what has been left out."""
    about = results["made"]
    packages = ", ".join(f"{name} {version}" for name, version in about["versions"].items())
    text = f"{about['date']}, {about['processor']}, {about['cores']} cores; {packages}."
    for line in results["left_out"]:
        text += f"\n\nLeft out: {line}."
    return text


TABLES: dict[str, Callable[[dict[str, Any]], str]] = {
    "made": made,
    "losses": losses,
    "stepping": stepping,
    "many": many,
    "true-error": true_error,
    "references": references,
    "study": study,
}
