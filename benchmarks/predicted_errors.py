"""The error that theory predicts from single steps, held against the error that is measured.

    python benchmarks/predicted_errors.py --out docs/data/predicted_errors.jsonl
    python benchmarks/predicted_errors.py --out docs/data/predicted_errors.jsonl --show

Every stepper of ropeode, with all its options, runs on every problem of the library that it is for.
The signed error of its runs, divided by dt**order, is compared with the predicted one, component by
component and at each sample time. The finest step size counts at which the error stands clear of
what reference and rounding leave open (`least_clear_error`).

The outcome of each pair is written to the file at once, as a line; the same command resumes if
interrupted. `--show` runs nothing, and prints the outcomes in the file, for
docs/explanation/global-error.md.
"""

from __future__ import annotations

import argparse
import functools
import json
import re
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from tabulate import tabulate

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.outcomes import lines_in
from ropeode import reference, simulate
from ropeode.analysis import differences, in_other_units, least_clear_error, round_off
from ropeode.norms import norm_for
from ropeode.problems import PROBLEMS
from ropeode.references import Reference
from ropeode.simulation import Method, method_of
from ropeode.steppers import STEPPERS, BuiltIn, ConstraintVerlet, variants
from ropeode.study import problem_class
from ropeode.theory import PredictedError, predicted_error

# Spans over which explicit steppers get to their asymptotic range in seconds.
SPANS: dict[str, dict[str, Any]] = {
    "rope": {"frames": 20},
    "inextensible-rope": {"frames": 5},
    "double-pendulum": {"frames": 5},
    "henon-heiles": {"frames": 10, "duration": 10},
    "arenstorf": {"frames": 10, "periods": 0.3},
    "pleiades": {"frames": 6, "duration": 1.2},
    "van-der-pol": {"frames": 6},
    "lorenz": {"frames": 10, "duration": 1},
    "robertson": {"frames": 6, "duration": 0.04},
    "hires": {"frames": 6, "duration": 5},
    "oregonator": {"frames": 6, "duration": 0.5},
}
FEWEST, MOST_STEPS = 8, 2**17
AGREE = 0.01
# A quantity whose coefficient is so many times its uncertainty, or less, has none.
NOTHING = 3.0
STEPPERS_TRIED = [
    *(each for cls in STEPPERS.values() for each in variants(cls)),
    ConstraintVerlet(sweeps=3),
]


@functools.cache
def known(name: str) -> Reference:
    """The reference of a problem of the library."""
    return reference(PROBLEMS[name](**SPANS.get(name, {})), level="extended", time_limit=600.0)


def pairs() -> list[tuple[str, BuiltIn]]:
    """Each problem with the steppers that are for it and claim an order on it."""
    found = []
    for name in PROBLEMS:
        problem = PROBLEMS[name](**SPANS.get(name, {}))
        kind = problem_class(problem)
        for stepper in STEPPERS_TRIED:
            # Without damping the choices of how it enters make one method.
            other = not kind.damped and getattr(stepper, "damping", "centered") != "centered"
            fits = stepper.refusal(problem) is None and stepper.solves(kind)
            if fits and stepper.order(kind) and not other:
                found.append((name, stepper))
    return found


def compared(name: str, stepper: BuiltIn) -> dict[str, Any]:
    """Prediction and measurement, as a line of the file."""
    truth = known(name)
    method = method_of(stepper, truth.problem)
    began = time.perf_counter()
    prediction = predicted_error(truth, method)
    line = {"problem": name, "stepper": stepper.label, "seconds": time.perf_counter() - began}
    if isinstance(prediction, str):
        return {**line, "why": prediction}
    line |= {
        "order": prediction.order,
        "declared": stepper.order(problem_class(truth.problem)),
        "constant": largest(prediction.states),
        "uncertain": prediction.uncertain,
    }
    found = {
        quantity: judged(truth, prediction, runs_of(truth, method, quantity), quantity)
        for quantity in truth.problem.quantities
    }
    return {**line, "quantities": found}


def runs_of(truth: Reference, method: Method, quantity: str) -> list[tuple[float, np.ndarray]]:
    """Step sizes in halves, and the signed errors, as far as they are resolved."""
    problem, norm = truth.problem, norm_for(truth.problem, f"{quantity}-max")
    rescaled, runs, steps = in_other_units(problem), [], FEWEST
    while steps * problem.frames <= MOST_STEPS:
        run = simulate(problem, method, steps)
        if run.status == "ok":
            error = problem.quantity(quantity, differences(run.states, truth))
            (rounding,) = round_off(run, rescaled, truth.trusted, [norm], method)
            if largest(error) < least_clear_error(truth, norm, run.dt, rounding):
                break
            runs.append((run.dt, error))
        steps *= 2
    return runs


def judged(
    truth: Reference,
    prediction: PredictedError,
    runs: list[tuple[float, np.ndarray]],
    quantity: str,
) -> dict[str, Any]:
    """Predicted and measured errors of a quantity, as they are at the finest resolved step size.

    Returns:
        The largest predicted one; the step size; the ratio of the two along the predicted one; how
        far they are apart, as a part of the largest predicted one, and at the step size at which
        they are closest, for rounding may show at the finest; how far in the limit of no step size,
        by a parabola through the three finest; and how much that parabola changes the limit of a
        straight line. Where nothing is predicted, what is measured.
    """
    # At the first sample a run has no error.
    expected = truth.problem.quantity(quantity, prediction.states)[1:]
    measured = [error[1:] / dt**prediction.order for dt, error in runs]
    found = {"constant": largest(expected)}
    if not runs:
        return found
    if largest(expected) <= NOTHING * max(prediction.uncertain, 1e-6) * largest(prediction.states):
        return {"constant": 0.0, "dt": runs[-1][0], "measured": largest(measured[-1])}
    found |= {
        "dt": runs[-1][0],
        "ratio": float(np.sum(measured[-1] * expected) / np.sum(expected**2)),
        "apart": largest(measured[-1] - expected) / largest(expected),
        "closest": min(largest(each - expected) for each in measured) / largest(expected),
    }
    if len(measured) > 2:
        third, second, first = measured[-3:]
        limit, line = (third - 6.0 * second + 8.0 * first) / 3.0, 2.0 * first - second
        found["limit"] = largest(limit - expected) / largest(expected)
        found["correction"] = largest(limit - line) / largest(expected)
    return found


def largest(states: np.ndarray) -> float:
    """The largest component."""
    return float(np.max(np.abs(states)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="file of outcomes, *.jsonl")
    parser.add_argument("--show", action="store_true", help="the result; nothing is run")
    parser.add_argument("--only", nargs="*", default=list(PROBLEMS), help="names of problems")
    options = parser.parse_args()
    record = {(line["problem"], line["stepper"]): line for line in lines_in(options.out)}
    if not options.show:
        with options.out.open("a") as file:
            for name, stepper in pairs():
                if (name, stepper.label) in record or name not in options.only:
                    continue
                line = compared(name, stepper)
                record[name, stepper.label] = line
                file.write(json.dumps(line) + "\n")
                file.flush()
    print(shown(list(record.values())))


def shown(lines: list[dict[str, Any]]) -> str:
    """The result, in Markdown: counts, and each quantity that is further apart."""
    rows, reasons, counts = [], Counter(), Counter()
    for line in sorted(lines, key=lambda each: list(PROBLEMS).index(each["problem"])):
        start = [line["problem"], f"`{line['stepper']}`"]
        if "why" in line:
            # Without its numbers.
            reasons[re.split("[:,]| by [0-9]", line["why"])[0]] += 1
            continue
        for quantity, each in line["quantities"].items():
            kind = "unresolved" if "dt" not in each else "apart" in each and each["apart"] <= AGREE
            counts["zero" if "measured" in each else kind] += 1
            if kind is not False or "measured" in each:
                continue
            rows.append(
                [
                    *start,
                    line["order"],
                    quantity,
                    f"{each['constant']:.5g}",
                    f"{each['dt']:.2g}",
                    f"{each['ratio']:.5f}",
                    *(f"{each[key]:.1e}" if key in each else "-" for key in ("apart", "limit")),
                ]
            )
    head = [
        "problem",
        "stepper",
        "order",
        "of",
        "predicted",
        "dt",
        "ratio",
        "apart",
        "in the limit",
    ]
    words = (
        f"{len(lines)} pairs. Of {counts[True] + counts[False]} quantities whose error is resolved "
        f"{counts[True]} agree within {AGREE:.0%} in every component, at every sample, at the "
        f"finest step size. {counts['zero']} have no error of the method's order, as predicted. "
        f"{counts['unresolved']} have one that is resolved at no step size. For "
        f"{sum(reasons.values())} pairs there is no prediction:"
    )
    why = [f"- {reason}: {count} of them" for reason, count in reasons.most_common()]
    return "\n".join(
        [words, "", *why, "", tabulate(rows, head, tablefmt="pipe", disable_numparse=True)]
    )


if __name__ == "__main__":
    main()
