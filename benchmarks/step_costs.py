"""What a step of every stepper costs, in evaluations of the forces and in time.

Two tables of `stepping.py`. In the first, each time is divided by that of so many steps of explicit
Euler as the stepper evaluates the forces: 1 means that a step costs its forces and nothing else.
All take turns, and the ratio is that of the shortest runs, with the quartiles of runs that follow
each other. Where evaluations are not counted, or there are none, one step of Euler is the measure.
The second table holds the time per node and step of some steppers against the number of nodes.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence

from ropeode import InextensibleRope, Problem, Rope, simulate
from ropeode.errors import InputError
from ropeode.steppers import STEPPERS, by_family

NODE_STEPS = 300_000  # per run: a call takes about a tenth of a millisecond besides its steps
# Whose time is held against the number of nodes, where they are registered.
SCALING = ("explicit-euler", "semi-implicit-euler", "implicit-euler", "implicit-midpoint", "bdf2")


def problem_of(stepper: str, nodes: int) -> Problem:
    """A rope that a stepper can run on: with springs, or with rigid links."""
    rope = Rope(num_nodes=nodes).problem(frames=1)
    try:
        simulate(rope, stepper, 1)
    except InputError:
        return InextensibleRope(num_nodes=nodes).problem(frames=1)
    return rope


def evaluations(problem: Problem, stepper: str) -> int | None:
    """Of the forces in a step; None where a loop makes them, of a length that nobody knows."""
    few, more = (simulate(problem, stepper, steps).rhs_evaluations for steps in (2, 3))
    return None if few is None or more is None else more - few


def seconds(problem: Problem, stepper: str, steps: int) -> float:
    """Of a step."""
    return simulate(problem, stepper, steps).seconds / steps


def times(nodes: int, repeats: int) -> dict[str, tuple[list[float], list[float]]]:
    """Seconds per step of every stepper, and of explicit Euler on the same rope right after it."""
    problems, steps = {name: problem_of(name, nodes) for name in STEPPERS}, NODE_STEPS // nodes
    found: dict[str, tuple[list[float], list[float]]] = {name: ([], []) for name in STEPPERS}
    for _ in range(max(repeats, 2)):
        for name, problem in problems.items():
            own, euler = found[name]
            own.append(seconds(problem, name, steps))
            euler.append(seconds(problem, "explicit-euler", steps))
    return found


def ratios(own: list[float], euler: list[float], calls: int) -> list[str]:
    """Nanoseconds of the shortest run, its ratio to that of Euler, and the pairs' quartiles."""
    low, _, high = statistics.quantiles(
        [a / b / calls for a, b in zip(own, euler, strict=True)], n=4
    )
    least = min(own) / min(euler) / calls
    return [f"{min(own) * 1e9:.0f}", f"{least:.2f}", f"{low:.2f}-{high:.2f}"]


def by_evaluations(sizes: Sequence[int], repeats: int) -> tuple[list[str], list[list[str]]]:
    """Headers and lines of the first table, by families."""
    found = {nodes: times(nodes, repeats) for nodes in sizes}
    lines = []
    for family, steppers in by_family().items():
        for cls in steppers:
            calls = evaluations(problem_of(cls.name, sizes[0]), cls.name)
            line = [family, cls.name, "in a loop" if calls is None else str(calls)]
            for nodes in sizes:
                line += ratios(*found[nodes][cls.name], calls or 1)
            lines.append(line)
            family = ""
    headers = ["family", "stepper", "evaluations"]
    for nodes in sizes:
        headers += [f"ns, {nodes} nodes", "/ Euler", "quartiles"]
    return headers, lines


def by_nodes(sizes: Sequence[int], repeats: int) -> tuple[list[str], list[list[str]]]:
    """Headers and lines of the second table: nanoseconds per node and step."""
    names = [name for name in SCALING if name in STEPPERS]
    problems = {(name, nodes): problem_of(name, nodes) for name in names for nodes in sizes}
    shortest = dict.fromkeys(problems, float("inf"))
    for _ in range(repeats):
        for (name, nodes), problem in problems.items():
            each = seconds(problem, name, NODE_STEPS // nodes)
            shortest[name, nodes] = min(shortest[name, nodes], each / nodes)
    lines = [[name, *(f"{shortest[name, nodes] * 1e9:.2f}" for nodes in sizes)] for name in names]
    return ["ns per node and step", *map(str, sizes)], lines
