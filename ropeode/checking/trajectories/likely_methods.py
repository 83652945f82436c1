"""The methods that a program is likely to have, which is known by its trajectories alone."""

from __future__ import annotations

# What courses teach and games use.
FIRST = (
    "explicit-euler",
    "semi-implicit-euler",
    "stormer-verlet",
    "velocity-verlet",
    "rk4",
    "constraint-verlet",
    "rattle",
)
# Tried in turn; each only if it is none of those before.
LIKELY = (
    (*FIRST, "stormer-verlet:start=rest", "constraint-verlet:start=rest"),
    ("heun", "midpoint", "ralston2", "ralston3"),
)
