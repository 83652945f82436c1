"""References that are stored, and what they claim."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from ropeode.references import (
    Certificate,
    Entry,
    Facts,
    Reference,
    Verification,
    remarks,
)
from ropeode.render.markup import Block, Code, Grid, Heading, Paragraph, plain
from ropeode.render.results import blocks
from ropeode.render.table_words import trust_words

_COLUMNS, _ROWS = 60, 8
_SPARKS = 24
_WITNESSES = ("witness", "tolerance", "role", "steps", "difference")
_LIBRARY = ("name", "level", "samples", "until t =", "error bound", "title")
_DISTANCES = ("quantity", "at most apart", "verdict")
_BLOCKS = " ▁▂▃▄▅▆▇█"


def describe_reference(reference: Reference) -> str:
    """A few paragraphs on a reference that has just been computed, for a terminal."""
    problem = reference.problem
    lines = [f"{problem.name}, {problem.frames} frames: {certificate_claim(reference.certificate)}"]
    return plain([Paragraph("\n".join([*lines, *remarks(reference)]))])


@blocks.register
def _(facts: Facts) -> list[Block]:
    """All that a file says of its reference, with a plot of its bound."""
    certificate, times = facts.certificate, facts.numbers["time"]
    parameters = dict(facts.problem.parameters)
    witnesses = [
        (str(w.solver), f"{w.tolerance:.0e}", w.role, str(w.steps), f"{w.difference:.1e}")
        for w in certificate.witnesses
    ]
    first_bound = next(iter(certificate.bounds.values()))
    versions = ", ".join(f"{name} {number}" for name, number in certificate.versions.items())
    span = f"{len(times)} samples from t = {times[0]:g} to {times[-1]:g}."
    kind = parameters.pop("kind", None)
    listed = ", ".join(f"{name} {value_words(value)}" for name, value in parameters.items())
    plot = _plot(times[: certificate.trusted], first_bound[: certificate.trusted])
    return [
        Heading(f"{facts.problem.name}" + (f" ({kind}): {listed}" if kind else "")),
        Paragraph(f"{span} {certificate_claim(certificate)}"),
        Grid(_WITNESSES, witnesses, left=frozenset({0, 2})),
        Code("\n".join(line.rstrip() for line in plot)),
        Paragraph(f"Computed with {versions}."),
        Paragraph(f"sha256 {facts.digest}"),
    ]


def library_list(entries: Mapping[str, Entry]) -> str:
    """The stored library, for a terminal."""
    rows = [
        (name, each.level, str(each.samples), f"{each.end:g}", f"{each.bound:.1e}", each.title)
        for name, each in entries.items()
    ]
    words = (
        "Bounds are those at the last sample, of positions or of the state. Use a name in place of "
        "a file: `ropeode reference show NAME`, `ropeode table --reference NAME`, "
        'ropeode.load("NAME").'
    )
    left, long = frozenset({0, 1, 5}), frozenset({5})
    return plain([Grid(_LIBRARY, rows, left, long), Paragraph(words)])


@blocks.register
def _(verification: Verification) -> list[Block]:
    certificate, outside = verification.recomputed.certificate, verification.outside
    distances = [
        (
            quantity,
            f"{largest:.1e}",
            f"OUTSIDE the bounds from t = {outside[quantity]:g} on"
            if quantity in outside
            else "within the bounds",
        )
        for quantity, largest in verification.distances.items()
    ]
    return [
        Heading(f"{verification.path}: {'DISAGREES' if outside else 'agrees'}"),
        Paragraph(f"Checksum, structure and problem are right; sha256 {verification.digest}."),
        Paragraph(
            f"Computed again: {certificate.solver} at rtol {certificate.rtol:.0e}, "
            f"{verification.samples} of {verification.of} samples compared"
            f"{_why_not_all(verification)}."
        ),
        Grid(_DISTANCES, distances, left=frozenset({0, 2})),
    ]


def _why_not_all(verification: Verification) -> str:
    new = verification.recomputed.certificate
    if verification.samples == verification.of:
        return ""
    return f": the new one is trusted before t = {new.horizon:g} only ({new.horizon_reason})"


def certificate_claim(certificate: Certificate) -> str:
    """What a certificate claims."""
    bounds = ", ".join(
        f"{quantity} {series[certificate.trusted - 1]:.1e}"
        for quantity, series in certificate.bounds.items()
    )
    drift = "".join(
        f"; {quantity} constraints kept to {np.max(series[: certificate.trusted]):.1e}"
        for quantity, series in certificate.drift.items()
    )
    return (
        f"Level {certificate.level}: {certificate.solver} at rtol {certificate.rtol:.0e}. "
        f"Estimated error bound inside the horizon: {bounds}{drift}; {trust_words(certificate)}."
    )


def sparkline(values: np.ndarray) -> str:
    """Positive numbers over time, in blocks, on a logarithmic scale."""
    exponents = _exponents(values, _SPARKS)
    low, high = exponents.min(), exponents.max()
    filled = (exponents - low) / max(high - low, 1.0) * (len(_BLOCKS) - 2)
    return "".join(_BLOCKS[1 + round(level)] for level in filled.tolist())


def _plot(times: np.ndarray, bound: np.ndarray) -> list[str]:
    """The bound over time, in blocks, on a logarithmic scale."""
    exponents = _exponents(bound, _COLUMNS)
    low = np.floor(exponents.min())
    high = max(np.ceil(exponents.max()), low + 1)
    filled = np.round((exponents - low) / (high - low) * _ROWS * 8).astype(int)
    wide = max(1, _COLUMNS // len(filled))
    lines = ["estimated error bound"]
    for row in reversed(range(_ROWS)):
        bars = "".join(_BLOCKS[int(np.clip(level - 8 * row, 0, 8))] * wide for level in filled)
        label = {_ROWS - 1: f"1e{high:+03.0f}", 0: f"1e{low:+03.0f}"}.get(row, "")
        lines.append(f"{label:>7} |{bars}")
    lines.append(f"{'':>7} +{'-' * wide * len(filled)}")
    end = f"t = {times[-1]:g}"
    lines.append(f"{'':>9}{f't = {times[0]:g}':<{max(1, wide * len(filled) - len(end))}}{end}")
    return lines


def _exponents(values: np.ndarray, most: int) -> np.ndarray:
    """The powers of ten of so many of these numbers, the first and the last among them."""
    some = np.unique(np.linspace(0, len(values) - 1, min(most, len(values))).astype(int))
    return np.log10(np.maximum(values[some], np.finfo(np.float64).tiny))


def value_words(value: Any) -> str:
    """A parameter in a word or two."""
    text = f"{value:g}" if isinstance(value, float) else json.dumps(value)
    return text if len(text) <= 30 else "one for each"
