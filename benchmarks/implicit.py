"""What a step of implicit steppers costs as a rope gets longer: it should be O(nodes).

``python -m benchmarks.implicit`` prints, for ropes of 16 to 4096 nodes, the time of a step, and
of a Jacobian per node.
"""

from __future__ import annotations

import sys

from ropeode.problems.rope import Rope
from ropeode.simulation import simulate

NODES = (16, 64, 256, 1024, 4096)
_ROUNDS, _FRAMES = 5, 4


def measured(name: str, nodes: int) -> tuple[float, float]:
    """Seconds of a step, the least of some rounds, and iterations in it."""
    problem = Rope(num_nodes=nodes, end=(-25.0 * nodes, 200.0)).problem(frames=_FRAMES)
    runs = [simulate(problem, name, max(16, 4096 // nodes)) for _ in range(_ROUNDS)]
    steps = _FRAMES * runs[0].steps_per_frame
    iterations = (runs[0].jacobian_evaluations or 0) / steps
    return min(run.seconds for run in runs) / steps, iterations


if __name__ == "__main__":
    for name in sys.argv[1:] or ["implicit-euler", "implicit-euler:newton=1"]:
        for nodes in NODES:
            seconds, iterations = measured(name, nodes)
            each = 1e9 * seconds / nodes / iterations
            print(f"{name:24} {nodes:5} nodes {1e6 * seconds:9.1f} us/step", end="  ")
            print(f"{iterations:.2f} Jacobians/step {each:6.0f} ns per node of each")
