# ruff: noqa: T201
"""The round-off in a run of the position form, and what two ways of estimating it say.

    python docs/examples/roundoff.py --steps 1024

The default rope is solved by Störmer-Verlet in NumPy, in three forms:

    centered   x + ((1 - h) (x - x_before) + dt^2 a) / (1 + h),  h = r dt/2
    lagged     x + ((1 - r dt) (x - x_before) + dt^2 a),         the small terms first
    ungrouped  (x + (1 - r dt) (x - x_before)) + dt^2 a,         the same, from left to right

The first two are those of the package's stepper.

Each form runs in extended precision, which gives its true round-off; in other units of
length; and with noise of half a unit of rounding on the result of each step. The figures in
docs/explanation/roundoff.md come from this script. It needs a platform whose
`numpy.longdouble` is wider than float64. At 16384 steps per frame it takes some minutes.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np

from ropeode import Rope

FRAMES = 20
OTHER_UNIT = 1.0 / 0.8414709848078965
FORMS: dict[str, Callable] = {
    "centered": lambda x, moved, r, dt, a: (
        x + ((1 - r * dt / 2) * moved + dt**2 * a) / (1 + r * dt / 2)
    ),
    "lagged": lambda x, moved, r, dt, a: x + ((1 - r * dt) * moved + dt**2 * a),
    "ungrouped": lambda x, moved, r, dt, a: x + (1 - r * dt) * moved + dt**2 * a,
}


def run(
    form: str, steps: int, number: type = np.float64, unit: float = 1.0, noise: float = 0.0
) -> np.ndarray:
    """Positions at the sample times in the original unit, ``(times, dim, nodes)``.

    Arguments:
        form: one of `FORMS`.
        steps: per frame.
        number: the type to compute with.
        unit: lengths are multiplied by it.
        noise: relative size of a random change of each step's result.
    """
    problem = Rope(damping=0.01).problem(FRAMES)
    args = problem.args
    k, rest, free, g, r = (
        np.asarray(value).astype(number)
        for value in (
            args.stiffness,
            args.rest_length * unit,
            args.free,
            args.gravity * unit,
            args.damping / args.mass * args.free,
        )
    )

    def acceleration(x: np.ndarray) -> np.ndarray:
        along = x[:, 1:] - x[:, :-1]
        pull = k * (1 - rest / np.sqrt(np.sum(along * along, axis=0))) * along
        force = np.zeros_like(x)
        force[:, :-1] += pull
        force[:, 1:] -= pull
        return (force + g) * free

    random = np.random.default_rng(0)
    dt = number(1) / number(steps)
    x = (problem.y0[0] * unit).astype(number)
    before = x + dt**2 / 2 * acceleration(x)
    samples = [x]
    for _ in range(FRAMES):
        for _ in range(steps):
            after = FORMS[form](x, x - before, r, dt, acceleration(x))
            if noise:
                after = after + noise * random.uniform(-1, 1, x.shape) * after * (after != x)
            before, x = x, after
        samples.append(x)
    return np.array(samples) / number(unit)


def distance(a: np.ndarray, b: np.ndarray) -> float:
    """The largest distance of a node at any sample."""
    return float(np.sqrt(np.sum((a - b) ** 2, axis=1)).max())


def main() -> None:
    """Print a line for each form."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=1024, help="per frame")
    steps = parser.parse_args().steps

    print(f"{steps} steps per frame")
    print("form        round-off  in other units  estimate by units  estimate by noise")
    for form in FORMS:
        plain = run(form, steps)
        # The unit is rounded into the numbers of the problem here, and not in ropeode, which
        # multiplies inside the acceleration; at this size it makes no difference.
        scaled = run(form, steps, unit=OTHER_UNIT)
        exact = run(form, steps, np.longdouble)
        noisy = run(form, steps, noise=2.0**-53)
        print(
            f"{form:10} {distance(plain, exact):10.1e} {distance(scaled, exact):15.1e} "
            f"{distance(scaled, plain):18.1e} {distance(noisy, plain):18.1e}"
        )


if __name__ == "__main__":
    main()
