"""The rope as plain loops, compiled by Numba: what a user of Numba would write.

Divisions follow IEEE 754 (`error_model="numpy"`): a check of each divisor would keep the loops
from being vectorised. Reassociation (`fastmath`) stays off, as in all other programs.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from math import sqrt

import numpy as np
from numba import njit, prange


@njit(error_model="numpy")
def accelerate(x, v, a, pull, stiffness, rest_length, damping, mass, gravity, free):
    """Fill `a` with the accelerations; positions, velocities and `a` are ``(2, nodes)``.

    `pull` is work space, ``(2, nodes + 1)``, whose first and last columns are zero.
    """
    nodes = x.shape[1]
    for i in range(nodes - 1):
        dx = x[0, i + 1] - x[0, i]
        dy = x[1, i + 1] - x[1, i]
        factor = stiffness[i] * (1.0 - rest_length[i] / sqrt(dx * dx + dy * dy))
        pull[0, i + 1] = factor * dx
        pull[1, i + 1] = factor * dy
    for k in range(2):
        for i in range(nodes):
            force = pull[k, i + 1] - pull[k, i] - damping[i] * v[k, i]
            a[k, i] = (force / mass[i] + gravity[k, 0]) * free[i]


@njit(error_model="numpy")
def explicit_euler(x, v, steps, dt, stiffness, rest_length, damping, mass, gravity, free):
    """Positions after so many steps, ``(2, nodes)``."""
    x, v, a = x.copy(), v.copy(), np.empty_like(x)
    pull = np.zeros((2, x.shape[1] + 1))
    for _ in range(steps):
        accelerate(x, v, a, pull, stiffness, rest_length, damping, mass, gravity, free)
        for k in range(2):
            for i in range(x.shape[1]):
                x[k, i] += dt * v[k, i]
                v[k, i] += dt * a[k, i]
    return x


@njit(error_model="numpy")
def semi_implicit_euler(x, v, steps, dt, stiffness, rest_length, damping, mass, gravity, free):
    """Positions after so many steps, ``(2, nodes)``."""
    x, v, a = x.copy(), v.copy(), np.empty_like(x)
    pull = np.zeros((2, x.shape[1] + 1))
    for _ in range(steps):
        accelerate(x, v, a, pull, stiffness, rest_length, damping, mass, gravity, free)
        for k in range(2):
            for i in range(x.shape[1]):
                v[k, i] += dt * a[k, i]
                x[k, i] += dt * v[k, i]
    return x


@njit(error_model="numpy")
def verlet(x, v, steps, dt, stiffness, rest_length, damping, mass, gravity, free):
    """The assignment's Verlet from rest: the damping acts once per step; ``(2, nodes)``."""
    x, before, a, still = x.copy(), x.copy(), np.empty_like(x), np.zeros_like(v)
    pull = np.zeros((2, x.shape[1] + 1))
    for _ in range(steps):
        accelerate(x, still, a, pull, stiffness, rest_length, damping, mass, gravity, free)
        for k in range(2):
            for i in range(x.shape[1]):
                now = x[k, i]
                moved = (1.0 - damping[i]) * (now - before[k, i])
                x[k, i] = now + (moved + dt * dt * a[k, i])
                before[k, i] = now
    return x


STEPPERS = {
    "explicit-euler": explicit_euler,
    "semi-implicit-euler": semi_implicit_euler,
    "verlet": verlet,
}


@functools.cache
def in_parallel(stepper: Callable) -> Callable:
    """One of `STEPPERS` for many ropes, which share the cores; each is run as if alone.

    It takes what the stepper takes, but for the step with the rope as their first axis.
    """

    @njit(parallel=True, error_model="numpy")
    def run(x, v, steps, dt, stiffness, rest_length, damping, mass, gravity, free):
        ends = np.empty_like(x)
        for rope in prange(x.shape[0]):
            ends[rope] = stepper(
                x[rope],
                v[rope],
                steps,
                dt,
                stiffness[rope],
                rest_length[rope],
                damping[rope],
                mass[rope],
                gravity[rope],
                free[rope],
            )
        return ends

    return run
