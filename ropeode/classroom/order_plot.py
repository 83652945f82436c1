"""A small order plot of a submission, drawn as SVG: errors over step sizes, on log scales.

Not by matplotlib, which draws the other plots: it takes 0.2 s of processor time for each, which is
a ninth of what the check of a right stepper takes, and writes 27 kB where this writes 2; a grade
book holds a hundred. And it is an extra, which the grade book then does not need.
"""

from __future__ import annotations

import html
import math
from collections.abc import Mapping
from typing import Any

_WIDTH, _HEIGHT, _LEFT, _TOP, _RIGHT, _BOTTOM = 420, 270, 62, 14, 12, 42
# Of Okabe and Ito, and with a mark of its own each.
_STYLES = (("#0072b2", "circle"), ("#d55e00", "square"))
# However small the picture is drawn.
_THICK = 'stroke-width="1.5" vector-effect="non-scaling-stroke"'


def order_plot(name: str, convergence: Mapping[str, Any]) -> str:
    """The errors of one check of order, with a line of the expected order; empty without errors.

    Arguments:
        name: of the check, for those who do not see it.
        convergence: as in the schema `ropeode.check/1`.
    """
    series = {
        quantity: [
            (dt, error)
            for dt, error in zip(convergence["dt"], each["errors"], strict=True)
            if error and math.isfinite(error)
        ]
        for quantity, each in convergence["quantities"].items()
    }
    points = [point for each in series.values() for point in each]
    if len(points) < 2:
        return ""
    expected = _expected(convergence["expected"], series)
    dts = [dt for dt, _ in points]
    errors = [error for _, error in (*points, *expected)]
    x = _Axis(min(dts), max(dts), _LEFT, _WIDTH - _RIGHT)
    y = _Axis(min(errors), max(errors), _HEIGHT - _BOTTOM, _TOP)
    parts = [
        *(_tick(f"{x.at(tick):.1f}", None, _power(tick)) for tick in x.ticks()),
        *(_tick(None, f"{y.at(tick):.1f}", _power(tick)) for tick in y.ticks()),
        _text((_LEFT + _WIDTH - _RIGHT) / 2, _HEIGHT - 6, "step size dt"),
    ]
    legend: list[tuple[str, str]] = []
    if expected:
        (x1, y1), (x2, y2) = ((x.at(dt), y.at(error)) for dt, error in expected)
        parts.append(
            f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="#555" '
            f'stroke-dasharray="5 4" {_THICK}/>'
        )
        legend.append(("", f"dashed: order {convergence['expected']}"))
    for (colour, mark), (quantity, each) in zip(_STYLES, series.items(), strict=False):
        at = [(x.at(dt), y.at(error)) for dt, error in each]
        path = " ".join(f"{left:.1f},{top:.1f}" for left, top in at)
        parts.append(f'<polyline points="{path}" fill="none" stroke="{colour}" {_THICK}/>')
        parts += [_mark(mark, colour, *each) for each in at]
        observed = convergence["quantities"][quantity]["observed"]
        words = quantity if observed is None else f"{quantity}: order {observed:.2f}"
        legend.append((_mark(mark, colour, -8, -4), words))
    # Where errors fall with the step size, nothing else is in this corner.
    for line, (own, words) in enumerate(legend):
        left, top = _WIDTH - _RIGHT - 130, _HEIGHT - _BOTTOM - 8 - 16 * line
        parts.append(f'<g transform="translate({left} {top})">{own}{_text(0, 0, words, "")}</g>')
    label = html.escape(f"Errors over step sizes, {name}")
    return (
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" width="{_WIDTH}" role="img" aria-label="{label}" '
        'font-family="system-ui, sans-serif" font-size="11">'
        f'<rect x="{_LEFT}" y="{_TOP}" width="{_WIDTH - _LEFT - _RIGHT}" '
        f'height="{_HEIGHT - _TOP - _BOTTOM}" fill="none" stroke="#999"/>{"".join(parts)}</svg>'
    )


class _Axis:
    """A logarithmic axis, a little longer than what is on it."""

    def __init__(self, low: float, high: float, start: float, end: float):
        margin = 0.08 * max(math.log10(high / low), 0.5)
        self._low, self._high = math.log10(low) - margin, math.log10(high) + margin
        self._start, self._end = start, end

    def at(self, value: float) -> float:
        """Where a value is."""
        share = (math.log10(value) - self._low) / (self._high - self._low)
        return self._start + share * (self._end - self._start)

    def ticks(self) -> list[float]:
        """Powers of ten; of two, where fewer than two of those are on it."""
        for base in (10.0, 2.0):
            scale = math.log10(base)
            powers = range(math.ceil(self._low / scale), math.floor(self._high / scale) + 1)
            if len(powers) >= 2:
                return [base**power for power in powers[:: 1 + len(powers) // 7]]
        return []


def _power(value: float) -> str:
    return f"{value:.0e}".replace("e-0", "e-") if value < 1e-3 else f"{value:.3g}"


def _tick(left: str | None, top: str | None, words: str) -> str:
    low = _HEIGHT - _BOTTOM
    if left is not None:
        line = f'<line x1="{left}" x2="{left}" y1="{_TOP}" y2="{low}" stroke="#e5e5e5"/>'
        return line + _text(float(left), low + 15, words)
    assert top is not None
    line = f'<line x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{top}" y2="{top}" stroke="#e5e5e5"/>'
    return line + _text(_LEFT - 6, float(top) + 4, words, "end")


def _text(left: float, top: float, words: str, anchor: str = "middle") -> str:
    side = f' text-anchor="{anchor}"' if anchor else ""
    return f'<text x="{left:.1f}" y="{top:.1f}"{side} fill="#333">{html.escape(words)}</text>'


def _mark(kind: str, colour: str, left: float, top: float) -> str:
    if kind == "circle":
        return f'<circle cx="{left:.1f}" cy="{top:.1f}" r="3.5" fill="{colour}"/>'
    return f'<rect x="{left - 3:.1f}" y="{top - 3:.1f}" width="6" height="6" fill="{colour}"/>'


def _expected(order: int | None, series: Mapping[str, list]) -> list[tuple[float, float]]:
    """Two points of the expected order, from the coarsest error on; none without such an order."""
    if order is None:
        return []
    first = next(each for each in series.values() if each)
    (coarse, error), (fine, _) = max(first), min(first)
    return [(coarse, error), (fine, error * (fine / coarse) ** order)]
