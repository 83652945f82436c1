"""The check ropes in NumPy, written anew, and runs of a step on them.

Runs where the release that is tried is installed, and ropeode is not.
"""

from __future__ import annotations

import sys

import numpy as np


class Rope:
    """Nodes, springs, damping, gravity and a drive; the numbers are those of `CheckArgs`.

    Arguments:
        given: arrays by name.
        name: of the rope, before a slash in these names.
    """

    def __init__(self, given, name):
        self.name = name
        self._numbers = {key.split("/")[1]: given[key] for key in given if key.startswith(name)}
        self.y0, self.ts = self._numbers["y0"], self._numbers["ts"]

    def slope(self, t, y):
        """The derivative of positions and velocities, all flat."""
        numbers = self._numbers
        x, v = y.reshape(self.y0.shape)
        along = x[1:] - x[:-1]
        length = np.linalg.norm(along, axis=1)
        pull = (numbers["stiffness"] * (1.0 - numbers["rest_length"] / length))[:, None] * along
        force = -numbers["damping"][:, None] * v
        force[:-1] += pull
        force[1:] -= pull
        drive = numbers["drive"] * np.cos(numbers["frequency"] * t)
        a = force / numbers["mass"][:, None] + numbers["gravity"] + drive
        return np.concatenate([v.ravel(), (numbers["free"][:, None] * a).ravel()])


def ropes(given):
    """All ropes of a file."""
    return [
        Rope(given, name) for name in sorted({key.split("/")[0] for key in given if "/" in key})
    ]


def runs_of(step):
    """Run ``step(slope, t, y, dt)`` on all ropes of the file that the first argument names.

    The states at the sample times go into the file that the second one names, as
    ``(runs, times, 2, nodes, dim)`` for each rope.
    """
    source, target = sys.argv[1:]
    given = dict(np.load(source))
    found = {}
    # What blows up shows in the states.
    with np.errstate(all="ignore"):
        for rope in ropes(given):
            found[rope.name] = np.stack([_run(step, rope, int(count)) for count in given["steps"]])
    np.savez(target, **found)


def _run(step, rope, count):
    y, states = rope.y0.reshape(-1), [rope.y0]
    for start, end in zip(rope.ts[:-1], rope.ts[1:], strict=True):
        dt = (end - start) / count
        for i in range(count):
            y = step(rope.slope, start + i * dt, y, dt)
        states.append(y.reshape(rope.y0.shape))
    return np.stack(states)
