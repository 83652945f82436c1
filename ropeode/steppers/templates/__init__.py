"""Steppers to begin with, as text."""

from __future__ import annotations

from importlib import resources

# What a template shows, by name.
TEMPLATES = {
    "acceleration": "a step function for positions and velocities (velocity Verlet)",
    "rhs": "a step function for any right-hand side (Heun)",
    "two-step": "a stepper that carries something from step to step (position Verlet)",
}


def template(name: str) -> str:
    """The text of a Python file.

    Arguments:
        name: one of `TEMPLATES`.
    """
    file = f"{name.replace('-', '_')}.py"
    return resources.files(__name__).joinpath(file).read_text("utf-8")
