"""Programs as people write them, with one mistake or none, and the files that they write."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from tests.checking.trajectory_writing import WRITERS

STEPS = (16, 32, 64)


def explicit(a, x, v, dt):
    return x + dt * v, v + dt * a(x, v)


def semi_implicit(a, x, v, dt):
    v = v + dt * a(x, v)
    return x + dt * v, v


def frozen(a, x, v, dt):
    first = a(x, v)
    return x + dt * v + dt * dt / 2 * first, v + dt * first


def kick_drift_kick(a, x, v, dt):
    v = v + dt / 2 * a(x, v)
    x = x + dt * v
    return x, v + dt / 2 * a(x, v)


def midpoint(a, x, v, dt):
    half = v + dt / 2 * a(x, v)
    return x + dt * half, v + dt * a(x + dt / 2 * v, half)


def kutta3(a, x, v, dt):
    first = a(x, v)
    half = v + dt / 2 * first
    second = a(x + dt / 2 * v, half)
    end = v + dt * (2 * second - first)
    third = a(x + dt * (2 * half - v), end)
    return x + dt / 6 * (v + 4 * half + end), v + dt / 6 * (first + 4 * second + third)


def rk4(a, x, v, dt):
    v1, a1 = v, a(x, v)
    v2, a2 = v + dt / 2 * a1, a(x + dt / 2 * v1, v + dt / 2 * a1)
    v3, a3 = v + dt / 2 * a2, a(x + dt / 2 * v2, v + dt / 2 * a2)
    v4, a4 = v + dt * a3, a(x + dt * v3, v + dt * a3)
    return x + dt / 6 * (v1 + 2 * v2 + 2 * v3 + v4), v + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


def on_a_floor(x, v):
    low = x[:, 1] < 146.0
    return np.where(low[:, None] & [False, True], 146.0, x), np.where(low[:, None], 0.0, v)


def slowed_down(x, v):
    return x, v * 4.0 / np.maximum(speed(v, 1.0), 4.0)


def speed(v, mass):
    return np.linalg.norm(v, axis=1, keepdims=True)


@dataclasses.dataclass
class Program:
    """A rope as in a game: loops that share nothing with the package.

    `method` is one of the functions above, or "verlet", by the last two positions.
    """

    problem: object
    method: object = semi_implicit
    gravity: float = 1.0
    gravity_times_dt: bool = False
    push: bool = False
    one_sided: bool = False
    spring_times: Callable = lambda length, stretch: 1.0
    drag_times: Callable = lambda v, mass: 1.0
    masses_that_divide: int = 1
    masses_of_gravity: int = 0
    forces: float = 1.0
    acceleration_times: float = 1.0
    damping: float = 1.0
    dashpot: float = 0.0
    drag_per_spring: float = 0.0
    kept: float = 1.0
    adds_up: bool = False
    rested: tuple[int, ...] = ()
    single_length: bool = False
    number: type = np.float64
    starts: str = "given"
    fence_post: bool = False
    counts_by_time: bool = False
    line_between_steps: bool = False
    exact_damping: bool = False
    afterwards: Callable = lambda x, v: (x, v)

    def acceleration(self, x, v, dt):
        args = self.problem.args
        mass = args.mass[:, None]
        force = -self.damping * args.damping[:, None].astype(self.number) * v
        force = self.drag_times(v, mass) * force
        if hasattr(args, "stiffness"):
            for i, (k, rest) in enumerate(
                zip(args.stiffness, args.rest_length.astype(self.number), strict=True)
            ):
                d = x[i + 1] - x[i]
                length = np.hypot(*d)
                if self.single_length:
                    length = float(np.float32(length))
                pull = (-1 if self.push else 1) * self.number(k) * (length - rest) * d / length
                pull = self.spring_times(length, length - rest) * pull
                pull = pull + self.dashpot * ((v[i + 1] - v[i]) @ d) * d / length**2
                force[i] += pull - self.drag_per_spring * v[i]
                force[i + 1] -= self.drag_per_spring * v[i + 1]
                if not self.one_sided:
                    force[i + 1] -= pull
        force *= self.forces
        if self.adds_up:
            force = self.before = force + self.before
        gravity = self.gravity * args.gravity.reshape(-1) * (dt if self.gravity_times_dt else 1)
        free = args.free.copy()
        free[list(self.rested)] = 0
        gravity = gravity * mass**self.masses_of_gravity
        a = self.acceleration_times * (force / mass**self.masses_that_divide + gravity)
        return (free[:, None] * a).astype(self.number)

    def begin(self, dt):
        """Positions and velocities, and the last positions."""
        x, v = (each.T.astype(self.number) for each in self.problem.y0)
        if self.fence_post:
            x = x[0] + (x - x[0]) * (len(x) - 1) / len(x)
        self.before = np.zeros_like(x)
        last = x if self.starts == "rest" else x - dt * v
        if self.starts == "taylor":
            last = last + dt * dt / 2 * self.acceleration(x, v, dt)
        return x, v, last

    def step(self, x, v, last, dt):
        """The next positions and velocities, and the last positions."""
        if self.method == "verlet":
            if not hasattr(self.problem.args, "stiffness"):
                x = self.restored(x)
            a = self.acceleration(x, (x - last) / dt, dt)
            new = x + self.kept * (x - last) + dt * dt * a
            return new, (new - x) / dt, x
        if self.exact_damping:
            args = self.problem.args
            v = np.exp(-args.damping * dt / args.mass)[:, None] * v
        of_step = self.method(
            lambda x, v: self.acceleration(x, v, dt), x, self.number(self.kept) * v, dt
        )
        return *self.afterwards(*of_step), x

    def run(self, n):
        """Positions and velocities at the frames, ``(times, nodes, 4)``."""
        # A step that divides no frame, where samples lie between the steps.
        dt = self.number(1 / (n + 0.37 * self.line_between_steps))
        x, v, last = self.begin(dt)
        samples, t, made = [np.hstack([x, v])], 0.0, 0
        for frame in range(1, self.problem.frames + 1):
            before = np.hstack([x, v])
            while t < frame if self.counts_by_time or self.line_between_steps else made < frame * n:
                before = np.hstack([x, v])
                x, v, last = self.step(x, v, last, dt)
                made += 1
                t = made * float(dt) if self.line_between_steps else t + float(dt)
            after = np.hstack([x, v])
            past = (t - frame) / dt if self.line_between_steps else 0.0
            samples.append(after + past * (before - after))
        return np.array(samples, np.float64)

    def restored(self, x):
        x, free = x.copy(), self.problem.args.free
        for i, rest in enumerate(self.problem.args.rest_length):
            d = x[i + 1] - x[i]
            excess = d * (1 - rest / np.hypot(*d)) / (free[i] + free[i + 1])
            x[i] += free[i] * excess
            x[i + 1] -= free[i + 1] * excess
        return x

    def files(self, folder, steps=STEPS, columns=4, **how):
        with np.errstate(all="ignore"):
            return [
                WRITERS[".csv"](
                    folder / f"{n}.csv",
                    range(self.problem.frames + 1),
                    self.run(n)[:, :, :columns],
                    1 / (n + 0.37 * self.line_between_steps),
                    **how,
                )
                for n in steps
            ]
