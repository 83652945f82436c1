"""References and stored references, as text for a terminal."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from ropeode.references.certificate import Certificate
from ropeode.references.files.encoding import dense_name
from ropeode.references.files.library import Entry
from ropeode.references.files.store import Facts
from ropeode.references.files.verify import Verification
from ropeode.references.hints import remarks
from ropeode.references.reference import Reference
from ropeode.render.table_words import trust_words
from ropeode.render.text_layout import columns, wrapped

_COLUMNS, _ROWS = 60, 8
_SPARKS = 24
_BLOCKS = " ▁▂▃▄▅▆▇█"


def describe_reference(reference: Reference) -> str:
    """One paragraph on a reference that has just been computed."""
    problem, dense = reference.problem, reference.dense
    between = [] if dense is None else _dense_claim(dense.times, dense.order, dense.bounds)
    return _lines(
        wrapped(f"{problem.name}, {problem.frames} frames: {claim(reference.certificate)}"),
        between,
        *(wrapped(remark) for remark in remarks(reference)),
    )


def as_text(facts: Facts) -> str:
    """All that a file says of its reference, with a plot of its bound."""
    certificate, times = facts.certificate, facts.numbers["time"]
    parameters = dict(facts.problem.parameters)
    rows = [
        (str(w.solver), f"{w.tolerance:.0e}", w.role, str(w.steps), f"{w.difference:.1e}")
        for w in certificate.witnesses
    ]
    witnesses = columns([("witness", "tolerance", "role", "steps", "difference"), *rows])
    first_bound = next(iter(certificate.bounds.values()))
    versions = ", ".join(f"{name} {number}" for name, number in certificate.versions.items())
    span = f"{len(times)} samples from t = {times[0]:g} to {times[-1]:g}."
    kind = parameters.pop("kind", None)
    listed = ", ".join(f"{name} {value_words(value)}" for name, value in parameters.items())
    return _lines(
        wrapped(f"{facts.problem.name}" + (f" ({kind}): {listed}" if kind else "")),
        wrapped(f"{span} {claim(certificate)}"),
        _stored_dense_claim(facts),
        [""],
        witnesses,
        [""],
        _plot(times[: certificate.trusted], first_bound[: certificate.trusted]),
        [""],
        wrapped(f"Computed with {versions}."),
        [f"sha256 {facts.digest}"],
    )


def library_list(entries: Mapping[str, Entry]) -> str:
    """The stored library, two lines for each entry."""
    rows = [
        (name, entry.level, str(entry.samples), f"{entry.end:g}", f"{entry.bound:.1e}")
        for name, entry in entries.items()
    ]
    head, *lines = columns([("name", "level", "samples", "until t =", "error bound"), *rows])
    titled = [
        part
        for line, entry in zip(lines, entries.values(), strict=True)
        for part in (line, f"    {entry.title}")
    ]
    return _lines(
        [head],
        titled,
        [""],
        wrapped(
            "Bounds are those at the last sample, of positions or of the state. Use a name in "
            "place of a file: `ropeode reference show NAME`, `ropeode table --reference NAME`, "
            'ropeode.load("NAME").'
        ),
    )


def verification_text(verification: Verification) -> str:
    """The result of a verification."""
    certificate = verification.recomputed.certificate
    lines = [
        f"{verification.path}: checksum, structure and problem are right; sha256 "
        f"{verification.digest}",
        f"Computed again: {certificate.solver} at rtol {certificate.rtol:.0e}, "
        f"{verification.samples} of {verification.of} samples compared"
        f"{_why_not_all(verification)}.",
    ]
    for quantity, largest in verification.distances.items():
        verdict = "within the bounds"
        if quantity in verification.outside:
            verdict = f"OUTSIDE the bounds from t = {verification.outside[quantity]:g} on"
        lines.append(f"{quantity}: at most {largest:.1e} apart, {verdict}.")
    return _lines(*(wrapped(line) for line in lines))


def _why_not_all(verification: Verification) -> str:
    new = verification.recomputed.certificate
    if verification.samples == verification.of:
        return ""
    return f": the new one is trusted before t = {new.horizon:g} only ({new.horizon_reason})"


def claim(certificate: Certificate) -> str:
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
        f"Estimated error bound at the end: {bounds}{drift}; {trust_words(certificate)}."
    )


def _dense_claim(times: np.ndarray, order: int, bounds: Mapping[str, np.ndarray]) -> list[str]:
    listed = ", ".join(f"{quantity} {series[-1]:.1e}" for quantity, series in bounds.items())
    return wrapped(
        f"Dense output to t = {times[-1]:g}: {len(times)} nodes, order {order}. Estimated error "
        f"bound at any time: {listed}."
    )


def _stored_dense_claim(facts: Facts) -> list[str]:
    quantities = facts.problem.quantities
    if "dense_time" not in facts.numbers:
        return []
    bounds = {q: facts.numbers[dense_name("bound", q)] for q in quantities}
    count = facts.numbers[f"dense_{quantities[0]}"].shape[1]
    return _dense_claim(facts.numbers["dense_time"], 2 * count, bounds)


def sparkline(values: np.ndarray) -> str:
    """Positive numbers over time, in blocks, on a logarithmic scale."""
    columns = np.unique(np.linspace(0, len(values) - 1, min(_SPARKS, len(values))).astype(int))
    exponents = np.log10(np.maximum(values[columns], np.finfo(np.float64).tiny))
    low, high = exponents.min(), exponents.max()
    filled = (exponents - low) / max(high - low, 1.0) * (len(_BLOCKS) - 2)
    return "".join(_BLOCKS[1 + round(level)] for level in filled.tolist())


def _plot(times: np.ndarray, bound: np.ndarray) -> list[str]:
    """The bound over time, in blocks, on a logarithmic scale."""
    shown = np.maximum(bound, np.finfo(np.float64).tiny)
    columns = np.unique(np.linspace(0, len(shown) - 1, min(_COLUMNS, len(shown))).astype(int))
    exponents = np.log10(shown[columns])
    low, high = (
        np.floor(exponents.min()),
        max(np.ceil(exponents.max()), np.floor(exponents.min()) + 1),
    )
    filled = np.round((exponents - low) / (high - low) * _ROWS * 8).astype(int)
    wide = max(1, _COLUMNS // len(columns))
    lines = ["estimated error bound"]
    for row in reversed(range(_ROWS)):
        blocks = "".join(_BLOCKS[int(np.clip(level - 8 * row, 0, 8))] * wide for level in filled)
        label = {_ROWS - 1: f"1e{high:+03.0f}", 0: f"1e{low:+03.0f}"}.get(row, "")
        lines.append(f"{label:>7} |{blocks}")
    lines.append(f"{'':>7} +{'-' * wide * len(columns)}")
    end = f"t = {times[-1]:g}"
    lines.append(f"{'':>9}{f't = {times[0]:g}':<{max(1, wide * len(columns) - len(end))}}{end}")
    return lines


def value_words(value: Any) -> str:
    """A parameter in a word or two."""
    text = f"{value:g}" if isinstance(value, float) else json.dumps(value)
    return text if len(text) <= 30 else "one for each"


def _lines(*parts: list[str]) -> str:
    return "\n".join(line.rstrip() for part in parts for line in part) + "\n"
