"""Small steps or iterations? Claims of Macklin et al. (2019), on ropes with a reference."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from ropeode import reference
from ropeode.analysis import ErrorSeries, distances, hanging_equilibrium, normal_modes, resolution
from ropeode.errors import ReferenceRefused
from ropeode.norms import Norm
from ropeode.precision import in_float64
from ropeode.problems import Problem, free_coordinates
from ropeode.problems.rope import Rope
from ropeode.progress import Progress, silent
from ropeode.references import Reference
from ropeode.simulation import Trajectory, simulate
from ropeode.simulation.jax_stepper import jax_stepper

NODES = (16, 64, 256)
STIFFNESSES = (1e2, 1e4, 1e6)
# At 60 frames per second gravity of one length unit per frame^2 is the earth's where 400 units
# are 1.1 metres. In 20 frames, a third of a second, the rope falls through half of its swing.
FRAMES, MASS = 20, 16.0
# Sweeps over the links in each frame, and the iterations of one step that they are split into.
BUDGETS = (1, 4, 16, 64, 256)
# The methods that are compared at one error, and what each repeats. The iterations of Newton's
# method are counted by the run; the others do one of these in each step.
METHODS: dict[str, tuple[str, Callable[[Trajectory], int]]] = {
    "implicit-euler": ("Newton iterations", lambda run: run.jacobian_evaluations or 0),
    "implicit-euler:newton=1": ("linear solves", lambda run: run.jacobian_evaluations or 0),
    "projective-dynamics": ("linear solves", lambda run: _steps(run)),
    "projective-dynamics:iterations=10": ("linear solves", lambda run: 10 * _steps(run)),
    "xpbd": ("sweeps", lambda run: _steps(run)),
    "velocity-verlet": ("force evaluations", lambda run: run.rhs_evaluations or 0),
}
TOLERANCE = 0.01
# Rounds in which the methods take turns, with runs of at least so many seconds: in shorter ones
# the start of a run counts.
_ROUNDS, _SHORTEST = 7, 0.05
_MOST_STEPS = 2**15
# Of the reference, so that errors of a ten-thousandth of the rope are resolved.
_RTOL, _ACCURACY, _TIME_LIMIT = 1e-10, 4e-3, 1200.0

# Nodes and stiffness.
OneRope = tuple[int, float]

TIP = Norm("tip", "position", lambda apart: apart[:, -1], "distance of the last node")
_WHOLE = Norm("rope", "position", lambda apart: np.max(apart, axis=1), "distance of the worst node")


def rope_of(nodes: int, stiffness: float) -> Problem:
    """The undamped rope of one length and mass, however many nodes it has."""
    mass = MASS / nodes
    whole = Rope(num_nodes=nodes, node_mass=mass, stiffness=stiffness, damping=0.0)
    return whole.problem(FRAMES)


def truth_of(problem: Problem) -> Reference:
    """The certified reference of a rope, fine enough for errors of a ten-thousandth of it.

    Raises:
        ReferenceRefused: no reference can be had for the problem.
    """
    return reference(problem, rtol=_RTOL, accuracy=_ACCURACY, time_limit=_TIME_LIMIT)


@dataclasses.dataclass(frozen=True)
class Spent:
    """A run of XPBD, and what it made of the rope. Errors are parts of the rope's length.

    Arguments:
        steps: in each frame.
        iterations: in each step.
        status: of the run; only of one that is `ok` there are numbers.
        final, max, rms: error of the tip's position, at the end and over the frames; None where
            the reference cannot resolve it.
        worst: error of the worst node at any frame; None likewise.
        energy: what has been lost at the end, as a part of the true kinetic energy there.
        stretch: by which part of its length the longest link of any frame is too long.
    """

    steps: int
    iterations: int
    status: str
    final: float | None = None
    max: float | None = None
    rms: float | None = None
    worst: float | None = None
    energy: float | None = None
    stretch: float | None = None

    @property
    def sweeps(self) -> int:
        """Over the links, in each frame."""
        return self.steps * self.iterations


@dataclasses.dataclass(frozen=True, eq=False)
class Splits:
    """All ways to spend budgets of sweeps on one rope.

    Arguments:
        truth: its reference.
        stretch: of the true solution.
        runs: steps times iterations is one of the budgets in each.
    """

    truth: Reference
    stretch: float
    runs: tuple[Spent, ...]

    def run(self, steps: int, iterations: int) -> Spent:
        """The run with so many of each."""
        return next(r for r in self.runs if (r.steps, r.iterations) == (steps, iterations))


def splits(truth: Reference, budgets: Sequence[int] = BUDGETS) -> Splits:
    """XPBD with each budget of sweeps per frame, split into steps and iterations in all ways.

    Arguments:
        truth: reference of an undamped rope.
        budgets: sweeps in each frame; iterations are the budgets that divide one.
    """
    runs = [
        _spent(truth, budget // iterations, iterations)
        for budget in budgets
        for iterations in budgets
        if budget % iterations == 0
    ]
    return Splits(truth, _stretch(truth.problem, truth.states[: truth.trusted]), tuple(runs))


def _spent(truth: Reference, steps: int, iterations: int) -> Spent:
    run = simulate(truth.problem, f"xpbd:iterations={iterations}", steps, progress=silent)
    if run.status != "ok":
        return Spent(steps, iterations, run.status)
    tip, whole = tip_errors(run, truth), _errors(run, truth, _WHOLE)
    states = run.states[: truth.trusted]
    start, *_, end = truth.problem.energies(states)
    length = _length(truth.problem)
    kinetic = _kinetic(truth.problem, truth.states[truth.trusted - 1])

    def part(error: float | None) -> float | None:
        return None if error is None else error / length

    return Spent(
        steps,
        iterations,
        run.status,
        part(tip.final),
        part(tip.max),
        part(tip.rms),
        part(whole.max),
        float((start - end) / kinetic),
        _stretch(truth.problem, states),
    )


def tip_errors(run: Trajectory, truth: Reference) -> ErrorSeries:
    """How far the last node is from where it should be, inside the trust horizon."""
    return _errors(run, truth, TIP)


def _errors(run: Trajectory, truth: Reference, norm: Norm) -> ErrorSeries:
    return ErrorSeries(
        norm,
        truth.times[1 : truth.trusted],
        distances(run.states, truth, norm)[1:],
        # The bound is that of the worst node.
        resolution(truth, norm)[1:],
    )


def _length(problem: Problem) -> float:
    """Of the rope, without forces."""
    return float(np.sum(problem.args.rest_length))


def _kinetic(problem: Problem, state: np.ndarray) -> float:
    return float(0.5 * np.sum(problem.args.mass * np.sum(state[1] ** 2, axis=0)))


def _stretch(problem: Problem, states: np.ndarray) -> float:
    """By which part of its length the longest link of any sample is too long."""
    links = np.linalg.norm(np.diff(problem.positions(states), axis=1), axis=2)
    return float(np.max(links / np.asarray(problem.args.rest_length)) - 1.0)


def time_of_steps(problem: Problem, sweeps: int = 64, rounds: int = _ROUNDS) -> float:
    """The time of n steps with one sweep over that of one step with n: the median of rounds.

    Arguments:
        problem: a rope.
        sweeps: n.
        rounds: in which the two take turns.
    """
    iterated = f"xpbd:iterations={sweeps}"
    steps = _long_enough(problem, "xpbd", sweeps)
    ways, ratios = (("xpbd", steps), (iterated, steps // sweeps)), []
    for _ in range(1 + rounds):
        small, large = (simulate(problem, *way, progress=silent).seconds for way in ways)
        ratios.append(small / large)
    return float(np.median(ratios[1:]))


@dataclasses.dataclass(frozen=True)
class Cheapest:
    """What a method needs for the tip to stay within a hundredth of the rope's length.

    Arguments:
        method: its name with options.
        steps: in each frame: the fewest, found by bisection; None where `_MOST_STEPS` do not do.
        error: the largest of the tip, as a part of the rope's length.
        unit: what the method repeats.
        units: how many of these in each frame.
        seconds: that these take: median, smallest and largest of the rounds.
    """

    method: str
    steps: int | None
    error: float | None
    unit: str
    units: float | None
    seconds: tuple[float, float, float] | None = dataclasses.field(default=None, compare=False)


def cheapest(
    truth: Reference, methods: Sequence[str] = tuple(METHODS), rounds: int = _ROUNDS
) -> list[Cheapest]:
    """The fewest steps with which each method keeps the tip to a hundredth of the rope's length.

    Arguments:
        truth: reference of an undamped rope.
        methods: some of `METHODS`.
        rounds: in which they take turns to be timed; with none, no seconds are measured.
    """
    rows = []
    for method in methods:
        steps, (unit, count) = fewest_steps(truth, method), METHODS[method]
        if steps is None:
            rows.append(Cheapest(method, None, None, unit, None))
            continue
        run = simulate(truth.problem, method, steps, progress=silent)
        error = tip_errors(run, truth).values.max() / _length(truth.problem)
        units = count(run) / truth.problem.frames
        rows.append(Cheapest(method, steps, float(error), unit, units))
    return _timed(truth.problem, rows, rounds) if rounds else rows


def _timed(problem: Problem, rows: list[Cheapest], rounds: int) -> list[Cheapest]:
    """With the seconds of a unit, from longer runs in turn, times the units."""
    long = {
        row.method: _long_enough(problem, row.method, row.steps)
        for row in rows
        if row.steps is not None
    }
    of_a_unit: dict[str, list[float]] = {method: [] for method in long}
    for _ in range(rounds):
        for method, steps in long.items():
            run = simulate(problem, method, steps, progress=silent)
            of_a_unit[method].append(run.seconds / METHODS[method][1](run))
    timed = []
    for row in rows:
        if row.units is not None:
            seconds = row.units * np.array(of_a_unit[row.method])
            middle, low, high = (float(f(seconds)) for f in (np.median, np.min, np.max))
            row = dataclasses.replace(row, seconds=(middle, low, high))
        timed.append(row)
    return timed


def _long_enough(problem: Problem, method: str, steps: int) -> int:
    """Steps per frame, not fewer than those given, whose run takes long enough to be timed."""
    while simulate(problem, method, steps, progress=silent).seconds < _SHORTEST:
        steps *= 2
    return steps


def fewest_steps(truth: Reference, method: str) -> int | None:
    """The smallest number of steps per frame with which the tip stays close, by bisection.

    It is close with twice as many steps too, lest an error that only passes through zero counts.
    """
    enough = 1
    while not (_is_close(truth, method, enough) and _is_close(truth, method, 2 * enough)):
        enough *= 2
        if enough > _MOST_STEPS:
            return None
    failed = enough // 2
    while enough - failed > 1:
        middle = (enough + failed) // 2
        failed, enough = (failed, middle) if _is_close(truth, method, middle) else (middle, enough)
    return enough


def _is_close(truth: Reference, method: str, steps: int) -> bool:
    run = simulate(truth.problem, method, steps, progress=silent)
    if run.status != "ok":
        return False
    return tip_errors(run, truth).values.max() <= TOLERANCE * _length(truth.problem)


def _steps(run: Trajectory) -> int:
    return run.steps_per_frame * run.problem.frames


@dataclasses.dataclass(frozen=True)
class Damped:
    """How a method damps the slowest swing of an undamped rope, as rates per frame.

    Arguments:
        method: its name with options.
        steps: in each frame.
        measured: from a run.
        of_step: by the eigenvalues of its own step at its own equilibrium.
        implicit_euler: by the formula of implicit Euler, which multiplies a swing by
            ``1/(1 - i omega dt)`` in each step.
        speed: the frequency of the method's own swing over the true one.
    """

    method: str
    steps: int
    measured: float
    of_step: float
    implicit_euler: float
    speed: float


DAMPED = (
    "implicit-euler",
    "xpbd",
    "xpbd:iterations=64",
    "projective-dynamics",
    "velocity-verlet",
)
DAMPED_STEPS = (1, 2, 4, 8, 16, 32)
# The rope whose damping is measured; the height of a swing as a part of its length, far above
# rounding and far below where it is nonlinear; and frames.
_HELD, _HEIGHT, _WATCHED = (16, 1e2), 3e-5, 200
_CORRECTIONS = 20


def damping_rates(
    methods: Sequence[str] = DAMPED,
    steps_per_frame: Sequence[int] = DAMPED_STEPS,
    problem: Problem | None = None,
) -> list[Damped]:
    """The rate at which each method damps the slowest swing of a hanging rope that has no damping.

    Step sizes with which a small disturbance grows are left out.

    Arguments:
        methods: whose state is all that they carry.
        steps_per_frame: numbers of steps per frame.
        problem: an undamped rope; by default one of 16 nodes.
    """
    problem = rope_of(*_HELD) if problem is None else problem
    omega = float(normal_modes(problem, hanging_equilibrium(problem)).frequencies[0])
    rows = []
    for method in methods:
        for steps in steps_per_frame:
            still, factors, shapes = _own_modes(problem, method, 1.0 / steps)
            if not np.max(np.abs(factors)) <= 1.0 + 1e-9:
                continue
            # No method damps another swing less.
            swings = np.flatnonzero(np.abs(np.angle(factors)) > 1e-6)
            slowest = swings[np.argmin(np.abs(np.angle(factors[swings])))]
            rows.append(
                Damped(
                    method,
                    steps,
                    measured=_measured_damping(problem, method, steps, still, shapes[slowest]),
                    of_step=-steps * math.log(abs(factors[slowest])),
                    implicit_euler=0.5 * steps * math.log1p((omega / steps) ** 2),
                    speed=float(abs(np.angle(factors[slowest])) * steps / omega),
                )
            )
    return rows


@in_float64
def _own_modes(problem: Problem, method: str, dt: float) -> tuple[np.ndarray, np.ndarray, Any]:
    """Where a method hangs still, the factors of its modes in one step, and their shapes."""
    stepper, t, args = jax_stepper(problem, method), float(problem.ts[0]), problem.args

    @jax.jit
    def step(y: Any) -> Any:
        carried = stepper.step(t, stepper.init(t, y, dt, args), dt, args)
        return stepper.state(t + dt, carried, dt, args)

    derivative, y = jax.jit(jax.jacfwd(step)), hanging_equilibrium(problem)
    free = np.broadcast_to(free_coordinates(problem), y.shape)
    # Newton's method, down to rounding. Too few sweeps carry a rope that is longer than it should
    # be.
    for _ in range(_CORRECTIONS):
        matrix = np.asarray(derivative(y))[free][:, free]
        y = y.copy()
        y[free] += np.linalg.lstsq(np.eye(len(matrix)) - matrix, (step(y) - y)[free])[0]
    decomposition: Any = np.linalg.eig(np.asarray(derivative(y))[free][:, free])
    factors, vectors = decomposition
    shapes = np.zeros((len(factors), *y.shape))
    shapes[:, free] = vectors.real.T
    return y, factors, shapes


def _measured_damping(
    problem: Problem, method: str, steps: int, still: np.ndarray, shape: np.ndarray
) -> float:
    """The rate at which a mode gets smaller in a run that begins with it.

    Each sample of one mode is a fixed combination of the two before it, by ``2 Re mu`` and
    ``-|mu|^2``, where the mode is multiplied by mu in a frame.
    """
    start = still + _HEIGHT * _length(problem) * shape / np.max(np.abs(shape[0]))
    held = problem.changed(y0=start, ts=np.arange(_WATCHED + 1.0))
    run = simulate(held, method, steps, progress=silent)
    swing = (run.positions - problem.positions(still[None]))[:, -1, 0]
    before = np.stack([swing[1:-1], swing[:-2]], axis=1)
    return -0.5 * math.log(-np.linalg.lstsq(before, swing[2:])[0][1])


class Ropes(NamedTuple):
    """What is known of all ropes, by nodes and stiffness.

    Fields:
        splits: of sweeps into steps and iterations.
        costs: of each method for the same error.
        refused: why a rope has no reference, and therefore no numbers.
    """

    splits: dict[OneRope, Splits]
    costs: dict[OneRope, list[Cheapest]]
    refused: dict[OneRope, str]


def every_rope(
    nodes: Sequence[int] = NODES,
    stiffnesses: Sequence[float] = STIFFNESSES,
    progress: Progress = silent,
) -> Ropes:
    """Both studies of all ropes.

    Arguments:
        nodes: of the ropes.
        stiffnesses: of their springs.
        progress: called with what is being done and the fraction that is done.
    """
    found = Ropes({}, {}, {})
    ropes = [(count, stiffness) for count in nodes for stiffness in stiffnesses]
    for index, (count, stiffness) in enumerate(ropes):
        progress(f"{count} nodes, stiffness {stiffness:g}", index / len(ropes))
        try:
            truth = truth_of(rope_of(count, stiffness))
        except ReferenceRefused as refusal:
            found.refused[count, stiffness] = str(refusal)
            continue
        found.splits[count, stiffness] = splits(truth)
        found.costs[count, stiffness] = cheapest(truth)
    return found
