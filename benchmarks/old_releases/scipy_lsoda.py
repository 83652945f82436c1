"""SciPy's LSODA with dense output: states at the ends of its steps, and between them."""

from __future__ import annotations

import sys

import numpy as np
from rope import ropes
from scipy.integrate import solve_ivp


def main():
    """Solve the rope of the first argument's file, at all its tolerances, into the second."""
    source, target = sys.argv[1:]
    given = dict(np.load(source))
    (rope,) = ropes(given)
    # Where in a step it is looked at; 0 and 1 are the ends.
    inside = np.linspace(0.0, 1.0, int(given["points"]))
    found = {}
    for i, rtol in enumerate(given["rtols"]):
        run = solve_ivp(
            rope.slope,
            (rope.ts[0], rope.ts[-1]),
            rope.y0.reshape(-1),
            method="LSODA",
            rtol=rtol,
            atol=1e-3 * rtol,
            dense_output=True,
        )
        assert run.success, run.message
        times = run.t[:-1, None] + inside * np.diff(run.t)[:, None]
        between = [
            piece(at) for piece, at in zip(run.sol.interpolants, times[:, 1:-1], strict=True)
        ]
        states = np.concatenate(
            [run.y.T[:-1, None], np.swapaxes(between, 1, 2), run.y.T[1:, None]], axis=1
        )
        found[f"times/{i}"] = times
        found[f"states/{i}"] = states.reshape(*times.shape, *rope.y0.shape)
    np.savez(target, **found)


if __name__ == "__main__":
    main()
