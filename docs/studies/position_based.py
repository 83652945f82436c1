"""What the graphics steppers converge to, as dt goes to 0 with a fixed number of iterations."""

from __future__ import annotations

import dataclasses

import numpy as np

from ropeode import reference
from ropeode.analysis import ObservedOrder, largest_distance, observed_order, resolution
from ropeode.norms import norm_for
from ropeode.problems import InextensibleRope, Problem
from ropeode.problems.rope import Rope
from ropeode.references import Reference
from ropeode.simulation import simulate

STEPS_PER_FRAME = (64, 96, 128, 192, 256, 384, 512)
# The error at so many steps per frame is shown.
SHOWN = 512
FRAMES = 4
NEAR = (16, 32, 64, 128)
_MASS = np.array([1.0, 2.0, 0.5, 1.5, 0.7, 1.2])
_DAMPING = np.array([0.1, 0.2, 0.3, 0.1, 0.2, 0.3])
_LINKS_OF_NODE = np.array([1, 2, 2, 2, 2, 1])
_SHAPE = {"start": (0, 0), "end": (4, 3), "num_nodes": 6, "gravity": (0.3, -1), "pinned": (0,)}
_SHAPE["initial_velocity"] = np.outer((0, 0.1, -0.1, 0.2, 0.1, 0.4), (-0.6, 0.8))

SPRINGS, RIGID, AS_HEAVY = "springs", "rigid links", ", inner nodes twice as heavy"
# Steppers with the rope that they are run on, and the one that they are expected to go to.
CASES = [
    ("pbd", SPRINGS, RIGID),
    ("pbd", RIGID, RIGID),
    ("pbd:iterations=5", RIGID, RIGID),
    ("pbd:sweep=jacobi", RIGID, RIGID),
    ("pbd:sweep=jacobi,iterations=2", RIGID, RIGID),
    ("pbd:sweep=averaged", RIGID, RIGID + AS_HEAVY),
    ("pbd:sweep=averaged,iterations=5", RIGID, RIGID + AS_HEAVY),
    ("xpbd", SPRINGS, SPRINGS),
    ("xpbd:iterations=2", SPRINGS, SPRINGS),
    ("xpbd:iterations=5", SPRINGS, SPRINGS),
    ("xpbd:substeps=5", SPRINGS, SPRINGS),
    ("xpbd:sweep=jacobi", SPRINGS, SPRINGS),
    ("xpbd:sweep=averaged", SPRINGS, SPRINGS + AS_HEAVY),
    ("xpbd", RIGID, RIGID),
    ("xpbd:substeps=5", RIGID, RIGID),
    ("projective-dynamics", SPRINGS, SPRINGS),
    ("projective-dynamics:iterations=5", SPRINGS, SPRINGS),
    ("diffrax:ImplicitEuler", SPRINGS, SPRINGS),
]


@dataclasses.dataclass(frozen=True)
class Limit:
    """Where a stepper goes as dt goes to 0.

    Arguments:
        stepper: its label.
        rope: that it is run on.
        goes_to: the rope that its runs are compared with.
        order: of the difference to the certified reference of that rope.
        error: largest distance of a node at `SHOWN` steps per frame; not finite where the run
            diverged.
        own: the same, to the rope that it is run on.
    """

    stepper: str
    rope: str
    goes_to: str
    order: ObservedOrder
    error: float
    own: float


def rope(kind: str) -> Problem:
    """A rope with unequal masses and damping, moving at the start."""
    times = _LINKS_OF_NODE if kind.endswith(AS_HEAVY) else 1
    own = {**_SHAPE, "node_mass": _MASS * times, "damping": _DAMPING * times}
    made = InextensibleRope(**own) if kind.startswith(RIGID) else Rope(**own, stiffness=20)
    return made.problem(FRAMES)


def limits_of_graphics() -> list[Limit]:
    """Each case, measured.

    Raises:
        ReferenceRefused: no reference can be had for a rope.
    """
    truths = {kind: reference(rope(kind)) for kind in {kind for case in CASES for kind in case[1:]}}
    return [_limit(*case, truths) for case in CASES]


def _limit(stepper: str, kind: str, goes_to: str, truths: dict[str, Reference]) -> Limit:
    problem = rope(kind)
    runs = [simulate(problem, stepper, steps) for steps in STEPS_PER_FRAME]
    norm = norm_for(problem)

    def errors(truth: Reference) -> list[float]:
        return [
            largest_distance(problem, norm, run.states, truth.states)
            if run.status == "ok"
            else np.inf
            for run in runs
        ]

    truth, shown = truths[goes_to], STEPS_PER_FRAME.index(SHOWN)
    found = errors(truth)
    order = observed_order(
        [run.dt for run in runs],
        found,
        resolution=float(resolution(truth, norm)[-1]),
        motion=float(np.max(np.abs(truth.states[:, 0] - problem.y0[0]))),
    )
    return Limit(stepper, kind, goes_to, order, found[shown], errors(truths[kind])[shown])


def near_implicit_euler(steppers: tuple[str, ...]) -> list[tuple[str, list[float], float]]:
    """The largest distance of steppers from implicit Euler at `NEAR` steps per frame.

    Returns:
        The stepper, its distances, and the power of dt with which the last two fall.
    """
    problem, found = rope(SPRINGS), []
    norm = norm_for(problem)
    euler = [simulate(problem, "diffrax:ImplicitEuler", steps).states for steps in NEAR]
    for stepper in steppers:
        own = [simulate(problem, stepper, steps).states for steps in NEAR]
        apart = [largest_distance(problem, norm, b, a) for a, b in zip(euler, own, strict=True)]
        found.append((stepper, apart, float(np.log2(apart[-2] / apart[-1]))))
    return found


def growth_by_jacobi(nodes: int, iterations: int, steps: int = 60) -> tuple[float, float]:
    """By which factor a step multiplies the errors of lengths, of a straight rope pinned at an end.

    Returns:
        The largest root of ``z^2 - 2 s z + s`` over the eigenvalues s of the projection, and the
        factor in a run of `pbd:sweep=jacobi`; not-a-number where the errors die away.
    """
    mass = np.diag([0.0] + [1.0] * (nodes - 1))
    across = np.diff(np.eye(nodes), axis=0)
    matrix = across @ mass @ across.T
    one = np.eye(nodes - 1) - matrix @ np.diag(1.0 / np.diag(matrix))
    eigenvalues = np.linalg.eigvals(one).real ** iterations
    predicted = max(np.max(np.abs(np.roots([1.0, -2.0 * s, s]))) for s in eigenvalues)
    problem = InextensibleRope(
        start=(0, 0), end=(0, 1 - nodes), num_nodes=nodes, gravity=(0, -1e-30), damping=0
    ).problem(steps)
    y0 = problem.y0.copy()
    y0[0, 1, 1:] += 1e-12 * np.cos(3.0 * np.arange(1, nodes))
    run = simulate(
        dataclasses.replace(problem, y0=y0), f"pbd:sweep=jacobi,iterations={iterations}", 1
    )
    lengths = np.linalg.norm(np.diff(run.positions, axis=1), axis=2)
    wrong = np.max(np.abs(lengths - 1.0), axis=1)
    grown = np.flatnonzero((wrong > 1e-9) & (wrong < 1e-4))
    if len(grown) < 2:
        return float(predicted), float("nan")
    first, last = grown[0], grown[-1]
    return float(predicted), float((wrong[last] / wrong[first]) ** (1.0 / (last - first)))
