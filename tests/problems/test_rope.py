"""The rope's parameters, and what is made of them."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode.errors import InputError
from ropeode.problems import InextensibleRope, Rope


def test_defaults_are_the_assignment():
    problem = Rope().problem(frames=20)
    x = problem.positions(problem.y0[None])[0]
    np.testing.assert_allclose(x, np.stack([np.linspace(0, -400, 16), np.full(16, 200.0)], axis=1))
    assert problem.ts.tolist() == list(range(21))
    np.testing.assert_allclose(problem.args.rest_length, 400 / 15)
    assert np.all(problem.args.mass == 1)
    assert np.all(problem.args.stiffness == 100)
    assert problem.args.free.tolist() == [0.0] + [1.0] * 15
    assert np.all(problem.args.damping == 0.01)
    assert problem.args.gravity.ravel().tolist() == [0.0, -1.0]
    assert problem.quantities == ("position", "velocity")


def test_what_is_left_out_follows_from_the_rest():
    assert Rope((0, 0, 0), (1, 2, 3)).gravity == (0.0, -1.0, 0.0)
    # A rope of one node needs no end.
    alone = Rope(start=(1, 1), end=(1, 1), num_nodes=1, pinned=()).problem(frames=1)
    assert alone.positions(alone.y0[None]).tolist() == [[[1.0, 1.0]]]
    # A velocity of all free nodes leaves pins still.
    problem = Rope(num_nodes=3, initial_velocity=(1, 2)).problem(frames=1)
    assert problem.velocities(problem.y0[None])[0].tolist() == [[0, 0], [1, 2], [1, 2]]


TAUT = r"taut between the pins 0 and 15, .* cannot move\)\. Fix: .* pinned = \[0\]"
STRETCHES = r"stretch no link \(link 0, between the nodes 0 and 1, .* by 3 per frame\)"


@pytest.mark.parametrize(
    ("kind", "given_", "words"),
    [
        (Rope, {"start": (0, np.inf)}, "start: "),
        (Rope, {"end": (1, 2, 3)}, "end: "),
        (Rope, {"end": (0, 200)}, "end: .* another point than start"),
        (Rope, {"node_mass": [1] * 15 + [0]}, "node_mass: "),
        (InextensibleRope, {"node_mass": [1, 2]}, "node_mass: .*16 needed, 2 given"),
        (Rope, {"stiffness": [1] * 16}, "stiffness: "),
        (Rope, {"stiffness": 10**400}, "stiffness: "),
        (Rope, {"pinned": (16,)}, "pinned: "),
        (Rope, {"pinned": (0, 0)}, "pinned: "),
        (Rope, {"gravity": (0, 0, -1)}, "gravity: "),
        (Rope, {"damping": True}, "damping: "),
        (Rope, {"initial_velocity": [(1, 2)] * 16}, "initial_velocity: "),
        (Rope, {"initial_velocity": [(1, 2), (1,)]}, "initial_velocity: "),
        (InextensibleRope, {"stiffness": 100.0}, "field: 'stiffness' given, which does not exist"),
        (InextensibleRope, {"pinned": [*range(16)]}, "pins that leave a node free .*leave one out"),
        (InextensibleRope, {"num_nodes": 1}, r"pinned: \[0\] given; .* leave a node free"),
        (InextensibleRope, {"pinned": (0, 15)}, TAUT),
        (InextensibleRope, {"pinned": (3, 5)}, r"pins 3 and 5.* pinned = \[3\]"),
        (InextensibleRope, {"start": (1e17, 0), "end": (1e17 + 64, 0)}, "end: .* length zero"),
        (InextensibleRope, {"initial_velocity": (3, 1)}, STRETCHES),
    ],
    ids=str,
)
def test_bad_parameters(kind, given_, words):
    with pytest.raises(InputError, match=words) as caught:
        kind(**given_)
    (line,) = caught.value.problems
    assert all(word in line for word in ("given", "allowed: ", "Fix: "))
