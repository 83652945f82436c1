"""The observed order of a stepper, with its evidence."""

from __future__ import annotations

import numpy as np

from ropeode.laboratory.answers import Answer
from ropeode.laboratory.messages import AskOrder, LeftOutPoint, Order
from ropeode.laboratory.setup import Laboratory
from ropeode.progress import Progress, part_of
from ropeode.render import order_interval, order_remark
from ropeode.study import Row, StepperOrder, check_steps, table_of_rows


def answer(ask: AskOrder, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    ladder = check_steps(ask.steps_per_frame)
    motion = laboratory.motion(ask.problem, progress)
    method = laboratory.method(motion.problem, ask.stepper, ask.version)
    rows = []
    for index, steps in enumerate(ladder):
        part = part_of(progress, index / len(ladder), (index + 1) / len(ladder))
        rows.append(laboratory.row(motion, method, steps, part))
    table = table_of_rows(rows, [method.stepper], [None], motion.reference, motion.norm)
    (found,) = table.orders
    order, steps_of = found.order, {row.dt: row.steps_per_frame for row in rows}
    low, high = order.ci95 or (None, None)
    message = Order(
        stepper=found.stepper,
        observed=order.observed,
        low=low,
        high=high,
        verdict=order.verdict,
        expected=found.expected,
        words=_words(found),
        used=tuple(steps_of[dt] for dt in order.used),
        left_out=tuple(
            LeftOutPoint(steps_per_frame=steps_of[each.dt], why=each.reason)
            for each in order.left_out
        ),
        constant=_constant(found, rows),
    )
    return message, {}


def _words(found: StepperOrder) -> str:
    order = found.order
    if order.observed is None:
        words = f"{order.verdict}: {order.why}" if order.why else order.verdict
    else:
        words = f"{order.verdict}: observed order {order.observed:.3f}, {order_interval(order)}"
    if found.expected is not None:
        words += f"; expected {found.expected or 'none: it converges to another solution'}"
    return f"{words}; it {note}" if (note := order_remark(found)) else words


def _constant(found: StepperOrder, rows: list[Row]) -> float | None:
    """Of the fitted line, which passes through the mean of the points that it was fitted to."""
    if found.order.observed is None:
        return None
    errors = {row.dt: row.error_max for row in rows}
    points = [(dt, error) for dt in found.order.used if (error := errors[dt]) is not None]
    dt, error = np.exp(np.mean(np.log(points), axis=0))
    return float(error / dt**found.order.observed)
