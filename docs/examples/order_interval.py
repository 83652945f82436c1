# ruff: noqa: T201
"""How often the interval of an observed order contains the order that the stepper declares.

    python docs/examples/order_interval.py --ropes 150 --seed 1

Random ropes of six nodes are solved by every stepper that declares an order for them. The
numbers in docs/reference/table.md come from this script.
"""

from __future__ import annotations

import argparse

import numpy as np

from ropeode import ReferenceRefused, Rope, accuracy_table

STEPPERS = (
    "explicit-euler",
    "semi-implicit-euler",
    "stormer-verlet",
    "stormer-verlet:start=rest",
    "stormer-verlet:damping=lagged",
    "velocity-verlet",
    "rk4",
)
STEPS = tuple(2**k for k in range(4, 13))


def random_rope(random: np.random.Generator) -> Rope:
    """A rope of six nodes, pinned at its first one, damped and moving or not."""
    direction = random.normal(size=2)
    moving, damped = random.integers(0, 2, size=2)
    return Rope(
        start=random.normal(size=2),
        end=random.normal(size=2) + 10 * direction / np.linalg.norm(direction),
        num_nodes=6,
        node_mass=np.exp(random.normal(scale=0.5, size=6)),
        stiffness=np.exp(random.uniform(0, np.log(100))),
        gravity=random.normal(size=2),
        damping=damped * np.exp(random.uniform(np.log(1e-3), 0)),
        initial_velocity=moving * random.normal(size=2),
    )


def main() -> None:
    """Count intervals that contain the declared order, and print a line for each stepper."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ropes", type=int, default=150)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()

    orders_of: dict[str, list] = {stepper: [] for stepper in STEPPERS}
    for index in range(options.ropes):
        problem = random_rope(np.random.default_rng([options.seed, index])).problem(frames=4)
        try:
            table = accuracy_table(problem, STEPPERS, STEPS)
        except ReferenceRefused:
            continue
        for each in table.orders:
            if each.expected:
                orders_of[each.stepper].append((each.expected, each.order))

    print(f"{'stepper':32} orders  determined  contained  median width  largest miss")
    for stepper, orders in orders_of.items():
        determined = [(p, order) for p, order in orders if order.observed is not None]
        misses = [max(order.ci95[0] - p, p - order.ci95[1], 0.0) for p, order in determined]
        width = [order.ci95[1] - order.ci95[0] for _, order in determined]
        print(
            f"{stepper:32} {len(orders):6} {len(determined):11} "
            f"{sum(miss == 0 for miss in misses):10} {np.median(width):13.4f} "
            f"{max(misses):13.4f}"
        )


if __name__ == "__main__":
    main()
