"""What is drawn and measured: the reference, runs beside it, their order, and phase planes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ropeode.analysis import hanging_equilibrium, normal_modes
from ropeode.laboratory.answers import Answer
from ropeode.laboratory.drawings import finite_samples
from ropeode.laboratory.messages import (
    AskOrder,
    AskPhase,
    AskRun,
    AskTruth,
    LeftOutPoint,
    Order,
    Phase,
    Run,
    Truth,
)
from ropeode.laboratory.setup import Laboratory
from ropeode.problems import Problem, rope_of
from ropeode.progress import Progress, part_of
from ropeode.references import Reference, remarks, time_derivatives
from ropeode.render import certificate_claim, order_interval, order_remark, problem_words
from ropeode.simulation import frame_lengths
from ropeode.study import Row, StepperOrder, check_steps, table_of_rows
from ropeode.validation import bad_value

_COMPONENTS = "xyz"


def truth(ask: AskTruth, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    motion = laboratory.motion(ask.problem, progress)
    problem, finer, drawing = motion.problem, motion.finer, motion.drawing
    arrays = {
        "times": finer.times,
        "points": motion.points,
        "bound": finer.bound(motion.norm),
    }
    if motion.energy is not None:
        arrays |= {"energy": motion.energy.values, "energy_bound": motion.energy.bound}
    rope = rope_of(problem) is not None
    message = Truth(
        words=problem_words(problem),
        frame=float(np.max(frame_lengths(problem))),
        frames=problem.frames,
        samples_per_frame=motion.samples_per_frame,
        trusted=finer.trusted,
        horizon=finer.horizon,
        norm=motion.norm.words,
        drawing=drawing.kind,
        links=drawing.links,
        fixed=drawing.fixed,
        nodes=drawing.nodes,
        axes=drawing.axes,
        time_unit="frames" if _counts_frames(problem) else "",
        energy_unit="mass length²/frame²" if rope else "",
        certificate=tuple(_certificate(motion.reference)),
    )
    return message, arrays


def _certificate(reference: Reference) -> Iterator[str]:
    """What is claimed of the reference, and by which runs."""
    yield certificate_claim(reference.certificate)
    yield from remarks(reference)
    for each in reference.certificate.witnesses:
        yield f"{each.role}: {each.solver} at {each.tolerance:.0e}, {each.difference:.1e} apart"


def _counts_frames(problem: Problem) -> bool:
    """Whether the time unit of the problem is one frame."""
    whole = bool(np.array_equal(problem.ts, np.arange(problem.frames + 1.0)))
    # A duration may be as many units of time as there are frames by chance.
    return whole and not {"duration", "periods"} & {*problem.parameters}


def run(ask: AskRun, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    motion = laboratory.motion(ask.problem, progress)
    method, steps = laboratory.method(motion.problem, ask.stepper, ask.version), ask.steps_per_frame
    row = laboratory.row(motion, method, steps, part_of(progress, 0.0, 0.6))
    run = laboratory.run(motion, method, steps, part_of(progress, 0.6, 1.0))
    every = motion.every(steps)
    of_row = {name: getattr(row, name) for name in Run.model_fields.keys() - {"kind", "every"}}
    return Run(every=every, **of_row), motion.differences(run.states, every)


def order(ask: AskOrder, laboratory: Laboratory, progress: Progress) -> Answer:
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


def phase(ask: AskPhase, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    motion = laboratory.motion(ask.problem, progress)
    problem, states, every = motion.finer.problem, motion.finer.states, 1
    if ask.stepper is not None:
        if ask.steps_per_frame is None:
            allowed = "how many steps a run makes in each frame"
            raise bad_value("steps_per_frame", None, allowed, "name it beside the stepper")
        method = laboratory.method(motion.problem, ask.stepper, ask.version)
        run = laboratory.run(motion, method, ask.steps_per_frame, progress)
        problem, states, every = run.problem, run.states, motion.every(ask.steps_per_frame)
    if ask.mode is not None:
        x, v, labels = _of_mode(problem, states, ask.mode)
    else:
        x, v, labels = _of_node(problem, states, ask.node, ask.component)
    count = finite_samples(x, v)
    message = Phase(every=every, x_label=labels[0], v_label=labels[1])
    return message, {"x": x[:count], "v": v[:count]}


def _of_node(
    problem: Problem, states: np.ndarray, node: int | None, component: int
) -> tuple[np.ndarray, np.ndarray, tuple[str, str]]:
    if problem.mechanics is None:
        rates = time_derivatives(problem, problem.ts[: len(states)], states, 1)[:, 1]
        both = [problem.quantity("state", each) for each in (states, rates)]
    else:
        both = [problem.positions(states), problem.velocities(states)]
    _, nodes, dim = both[0].shape
    node = nodes - 1 if node is None else node
    for name, value, most in (("node", node, nodes - 1), ("component", component, dim - 1)):
        if value > most:
            raise bad_value(name, value, f"0 to {most} of {problem.name}", "choose another")
    x, v = (each[:, node, component] for each in both)
    if problem.mechanics is None:
        return x, v, (f"component {node}", "its rate of change")
    name = _COMPONENTS[component : component + 1] if dim > 1 else "position"
    of_node = f" of node {node}" if nodes > 1 else ""
    return x, v, (f"{name}{of_node}", f"velocity in {name}" if dim > 1 else "velocity")


def _of_mode(
    problem: Problem, states: np.ndarray, mode: int
) -> tuple[np.ndarray, np.ndarray, tuple[str, str]]:
    """How far it is out in a normal mode of the hanging equilibrium."""
    still = hanging_equilibrium(problem)
    modes = normal_modes(problem, still)
    if mode >= len(modes.frequencies):
        allowed = f"0 to {len(modes.frequencies) - 1}, counted from the slowest"
        raise bad_value("mode", mode, allowed, "choose another")
    weights = modes.weights[mode]
    x = np.sum(weights * (states[:, 0] - still[0]), axis=tuple(range(1, states.ndim - 1)))
    v = np.sum(weights * states[:, 1], axis=tuple(range(1, states.ndim - 1)))
    label = f"mode {mode}, {modes.frequencies[mode]:.3g} rad in a unit of time"
    return x, v, (label, "its velocity")
