"""A node or a mode in its phase plane, along the reference or a run."""

from __future__ import annotations

import numpy as np

from ropeode.analysis import hanging_equilibrium, normal_modes
from ropeode.laboratory.answers import Answer
from ropeode.laboratory.drawings import finite_samples
from ropeode.laboratory.messages import AskPhase, Phase
from ropeode.laboratory.setup import Laboratory
from ropeode.problems import Problem
from ropeode.progress import Progress
from ropeode.references import time_derivatives
from ropeode.validation import bad_value

_COMPONENTS = "xyz"


def answer(ask: AskPhase, laboratory: Laboratory, progress: Progress) -> Answer:
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
