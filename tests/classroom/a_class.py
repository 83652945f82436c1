"""The submissions of a class, as they come."""

from __future__ import annotations

from pathlib import Path

_RIGHT = """
def step(acceleration, t, x, v, dt, args):
    v = v + dt * acceleration(t, x, v, args)
    return x + dt * v, v
"""
# With another name for everything, and another comment.
_COPIED = """
def step(acceleration, time, position, velocity, h, parameters):
    # my own work
    new = velocity + h * acceleration(time, position, velocity, parameters)
    return position + h * new, new
"""
_WRONG_ORDER = """
def step(acceleration, t, x, v, dt, args):
    a = acceleration(t, x, v, args)
    return x + dt * v, v + dt * a * (1 + 1e-3)
"""
_HANGS = """
def step(acceleration, t, x, v, dt, args):
    while True:
        pass
"""
_EXITS = """
import os
def step(acceleration, t, x, v, dt, args):
    os._exit(0)
"""
_CRASHES = """
import ctypes
def step(acceleration, t, x, v, dt, args):
    ctypes.string_at(0)
"""
_PRINTS = """
def step(acceleration, t, x, v, dt, args):
    print("position", x, "velocity", v)
    v = v + 0.5 * dt * acceleration(t, x, v, args) + 0.5 * dt * acceleration(t, x, v, args)
    return x + dt * v, v
"""
_BORROWS = """
from ropeode import as_stepper
step = as_stepper("semi-implicit-euler")
"""
_HOARDS = f"""
import numpy as np
table = np.ones(2**29)
{_RIGHT}"""
CLASS = {
    "borrows": _BORROWS,
    "copied": _COPIED,
    "crashes": _CRASHES,
    "empty": "",
    "exits": _EXITS,
    "hangs": _HANGS,
    "hoards": _HOARDS,
    "no-function": "def other(x):\n    return x\n",
    "prints": _PRINTS,
    "right": _RIGHT,
    "syntax": "def step(acceleration, t, x, v, dt, args)\n    return x, v\n",
    "wrong": _WRONG_ORDER,
}


def write(folder: Path, texts: dict[str, str] = CLASS) -> Path:
    """Write the submissions to a folder."""
    folder.mkdir(exist_ok=True)
    for name, text in texts.items():
        (folder / f"{name}.py").write_text(text)
    return folder
