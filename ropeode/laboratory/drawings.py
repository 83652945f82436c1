"""How problems are drawn: their states as points in a plane, with what joins them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from ropeode.problems import PICTURES, PROBLEMS, Picture, PictureKind, Problem


@dataclasses.dataclass(frozen=True)
class Drawing:
    """How one problem is drawn.

    Arguments:
        kind: as in `Picture`.
        points: ``points(times, states)`` gives ``(times, points, 2)`` of ``(times, *state)``, in
            float64.
        axes: their names.
        links: pairs of points that are joined.
        fixed: indices of the points that do not move.
        nodes: the node that each point is; None where it is none.
    """

    kind: PictureKind
    points: Callable[[np.ndarray, np.ndarray], np.ndarray]
    axes: tuple[str, str]
    links: tuple[tuple[int, int], ...]
    fixed: tuple[int, ...]
    nodes: tuple[int | None, ...]


def drawing_of(problem: Problem) -> Drawing:
    """How a problem is drawn.

    As its file declares. Else nodes with links between neighbours are a chain, bodies with two or
    more coordinates move in the plane of the first two, one coordinate is drawn over its
    velocity and several over their places in the row. A state that is not mechanical is drawn in
    the plane of its first two components, or over time where it has one.
    """
    said = problem.parameters
    kind = said.get("kind")
    # A problem may say what it is not.
    if isinstance(kind, str) and kind in PICTURES and PROBLEMS[kind]().parameters.keys() <= {*said}:
        return _declared(problem, PICTURES[kind])
    mechanics = problem.mechanics
    if mechanics is None:
        return _of_components(problem)
    _, nodes, dim = problem.positions(problem.y0[None]).shape
    if dim == 1:
        return _of_displacements(problem, nodes)
    links, fixed = (), ()
    if mechanics.links is not None:
        links = tuple((node, node + 1) for node in range(nodes - 1))
        still = np.ravel(mechanics.links(problem.args).inverse_mass) == 0.0
        fixed = tuple(np.flatnonzero(still).tolist())
    return Drawing(
        "orbit" if mechanics.links is None else "rope",
        lambda times, states: problem.positions(states)[..., :2],
        ("x", "y"),
        links,
        fixed,
        tuple(range(nodes)),
    )


def _declared(problem: Problem, picture: Picture) -> Drawing:
    count = picture.points(problem.ts[:1], problem.y0[None], problem.args).shape[1]
    fixed = {index % count for index in picture.fixed}
    node = iter(range(count))
    return Drawing(
        picture.kind,
        lambda times, states: picture.points(times, states, problem.args),
        picture.axes,
        tuple((i, i + 1) for i in range(count - 1)) if picture.chained else (),
        tuple(sorted(fixed)),
        tuple(None if i in fixed or picture.kind == "phase" else next(node) for i in range(count)),
    )


def _of_displacements(problem: Problem, nodes: int) -> Drawing:
    if nodes == 1:

        def phase(times: np.ndarray, states: np.ndarray) -> np.ndarray:
            return np.stack(
                [problem.positions(states)[..., 0], problem.velocities(states)[..., 0]], 2
            )

        return Drawing("phase", phase, ("x", "v"), (), (), (None,))

    def row(times: np.ndarray, states: np.ndarray) -> np.ndarray:
        heights = problem.positions(states)[..., 0]
        return np.stack([np.broadcast_to(np.arange(nodes), heights.shape), heights], axis=2)

    return Drawing("orbit", row, ("node", "position"), (), (), tuple(range(nodes)))


def _of_components(problem: Problem) -> Drawing:
    one = problem.y0.size == 1

    def points(times: np.ndarray, states: np.ndarray) -> np.ndarray:
        flat = states.reshape(len(states), -1)
        return np.stack([times, flat[:, 0]] if one else [flat[:, 0], flat[:, 1]], axis=1)[:, None]

    axes = ("time", "y0") if one else ("y0", "y1")
    return Drawing("phase", points, axes, (), (), (None,))


def finite_samples(*values: Any) -> int:
    """How many leading samples of arrays ``(samples, ...)`` float32 can hold, in all of them."""
    with np.errstate(over="ignore"):
        finite = [
            np.all(np.isfinite(np.asarray(each, np.float32)).reshape(len(each), -1), axis=1)
            for each in values
        ]
    shortest = min(len(each) for each in finite)
    whole = np.all([each[:shortest] for each in finite], axis=0)
    return int(np.argmin(np.append(whole, False)))
