"""Problems made to deceive a reference; the solution of each is known to any number of digits.

Each kind is one right-hand side. Its numbers are in `args` and drawn at random, so that what is
compiled for one trial serves all others. The solution is a formula, evaluated in extended precision
(MPFR, by heyoka's real numbers) with the numbers that the problem holds. No solver has a part in
it.

A kind is *smooth* if a reference is expected: its right-hand side is smooth on the scale of the
span, or its jumps are declared, and rounding errors do not grow beyond what float64 can carry.
Many of the others have no reference in float64, and a refusal or an early horizon is the right
answer.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import heyoka
import jax
import jax.numpy as jnp
import numpy as np

from ropeode.problems import Problem

Random = np.random.Generator
# An array of heyoka's real numbers, and a function of times, the initial state and args to states.
Reals = np.ndarray
Truth = Callable[[Reals, Reals, Any], Sequence[Reals]]

# So few numbers of frames, because each makes a program of its own; most trials are short.
FEW = ((1, 0.3), (5, 0.4), (16, 0.3))
SOME = ((5, 0.45), (16, 0.45), (256, 0.1))
MANY = ((16, 0.5), (256, 0.44), (2000, 0.06))
MOST = ((256, 0.8), (2000, 0.18), (20000, 0.02))


@dataclasses.dataclass(frozen=True)
class Adversary:
    """One kind of problems.

    Arguments:
        field: ``rhs(t, y, args)``, or ``acceleration(t, x, v, args)``.
        draw: the numbers of one problem, as keyword arguments of `problem`.
        truth: the components of the solution, each ``(times,)``; not-a-number where there is none.
        share: how many of all trials are of this kind; only the ratios count.
        smooth: whether a reference is expected.
        mechanical: whether `field` is an acceleration.
        frames: how many, each with its probability.
        extended: the share of trials at the level ``extended``.
    """

    field: Callable
    draw: Callable[[Random], dict[str, Any]]
    truth: Truth
    share: float = 1.0
    smooth: bool = False
    mechanical: bool = False
    frames: Sequence[tuple[int, float]] = FEW
    extended: float = 0.0

    def drawn(self, random: Random) -> tuple[str, dict[str, Any]]:
        """The level, and the parameters of `problem`."""
        level = "extended" if random.random() < self.extended else "consensus"
        counts, odds = zip(*self.frames, strict=True)
        frames = int(random.choice(counts, p=odds))
        warp = float(random.choice([1.0, 1.0, 1.0, 2.5]))
        return level, {"frames": frames, "warp": warp, **self.draw(random)}

    def problem(
        self,
        frames: int,
        warp: float,
        span: Sequence[float],
        y0: Any,
        args: Any,
        jump_times: Sequence[float] = (),
    ) -> Problem:
        """The problem with these numbers.

        Arguments:
            frames: how many.
            warp: sample times are powers of equal ones.
            span: begin and end.
            y0: the initial state, or positions and velocities.
            args: of `field`.
            jump_times: that are declared.
        """
        fractions = np.linspace(0.0, 1.0, frames + 1) ** warp
        ts = span[0] + (span[1] - span[0]) * fractions
        # Where t itself has too few digits for so many samples.
        ts = np.unique(ts)
        args = jax.tree.map(np.float64, tuple(args))
        if self.mechanical:
            return Problem.second_order(self.field, *y0, ts, args)
        inside = [time for time in jump_times if ts[0] < time < ts[-1]]
        return Problem(self.field, y0, ts, args, jump_times=inside)

    def solution(self, problem: Problem, precision: int) -> Reals:
        """The states at the sample times, as `heyoka.real`."""

        def real(number: Any) -> Any:
            return heyoka.real(float(number), precision)

        start, args = jax.tree.map(real, (problem.y0.ravel().tolist(), problem.args))
        ts = np.array([real(t) for t in problem.ts])
        with np.errstate(all="ignore"):
            components = self.truth(ts, start, args)
        zero = 0 * ts
        return np.stack([zero + each for each in components], axis=1).reshape(
            len(ts), *problem.y0.shape
        )


def powers(random: Random, low: float, high: float) -> float:
    """A number between two powers of ten, each order of magnitude as likely as the next."""
    return float(10.0 ** random.uniform(low, high))


def sign(random: Random) -> float:
    return float(random.choice([-1.0, 1.0]))


def place(random: Random, span: Sequence[float]) -> float:
    """Somewhere inside, not too close to the ends."""
    return float(span[0] + (span[1] - span[0]) * random.uniform(0.02, 0.98))


def erf(x: Reals) -> Reals:
    """The error function, by the series of which all terms have one sign (DLMF 7.6.2)."""
    # Further out it is 1 to more than 200 digits.
    within = np.where(np.abs(x) < 22, x, 0 * x)
    term = within
    total = within
    square, n = 2 * within * within, 0
    largest = float(np.max(np.abs(within)))
    while n < 20 or n < 4 * largest**2 + 40 * largest + 100:
        n += 1
        term = term * square / (2 * n + 1)
        total = total + term
    pi = 4 * np.arctan(1 + 0 * x)
    series = 2 / np.sqrt(pi) * np.exp(-within * within) * total
    return np.where(np.abs(x) < 22, series, np.sign(x))


def log_cosh(x: Reals) -> Reals:
    return np.abs(x) + np.log1p(np.exp(-2 * np.abs(x))) - np.log(2 + 0 * x)


# --- Pulses in time ---------------------------------------------------------------------------


def gaussian(t: Any, y: Any, args: Any) -> Any:
    rate, height, centre, width = args
    return height * jnp.exp(-(((t - centre) / width) ** 2)) - rate * y


def gaussian_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    rate, height, centre, width = args
    pi = 4 * np.arctan(1 + 0 * t)
    lag = rate * width / 2
    below, above = (t[:1] - centre) / width - lag, (t - centre) / width - lag
    area = height * width * np.sqrt(pi) / 2 * np.exp(lag * lag - rate * (t - centre))
    return [np.exp(-rate * (t - t[0])) * y0[0] + area * (erf(above) - erf(below))]


def draw_gaussian(random: Random, narrow: float, wide: float) -> dict[str, Any]:
    end = powers(random, -1, 2)
    width = end * powers(random, narrow, wide)
    area = powers(random, -2, 1) * sign(random)
    rate = float(random.choice([0.0, powers(random, -2, 1) / end]))
    return {
        "span": [0.0, end],
        "y0": [float(random.normal())],
        "args": [rate, area / width, place(random, (0.0, end)), width],
    }


def draw_declared_gaussian(random: Random) -> dict[str, Any]:
    drawn = draw_gaussian(random, -5.0, -1.5)
    *_, centre, width = drawn["args"]
    return {**drawn, "jump_times": [centre - 8 * width, centre + 8 * width]}


def bump(t: Any, y: Any, args: Any) -> Any:
    height, centre, width, shape = args
    u = (t - centre) / width
    sech2, lorentz, switch = 1 / jnp.cosh(u) ** 2, 1 / (1 + u * u), jnp.tanh(u)
    return height * (shape[0] * sech2 + shape[1] * lorentz + shape[2] * switch) + 0 * y


def bump_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    height, centre, width, shape = args
    ends = (t - centre) / width, (t[:1] - centre) / width
    integral = sum(
        weight * (primitive(ends[0]) - primitive(ends[1]))
        for weight, primitive in zip(shape, (np.tanh, np.arctan, log_cosh), strict=True)
    )
    return [y0[0] + height * width * integral]


def draw_bump(random: Random, narrow: float, wide: float) -> dict[str, Any]:
    end = powers(random, -1, 2)
    width = end * powers(random, narrow, wide)
    which = int(random.integers(3))
    area = powers(random, -2, 1) * sign(random)
    return {
        "span": [0.0, end],
        "y0": [float(random.normal())],
        # A switch acts for the whole time.
        "args": [
            area / (end if which == 2 else width),
            place(random, (0.0, end)),
            width,
            tuple(float(which == each) for each in range(3)),
        ],
    }


def behind_a_loss(t: Any, y: Any, args: Any) -> Any:
    rate, factor, level, height, centre, width = args
    pulse = height * jnp.exp(-(((t - centre) / width) ** 2))
    return rate * (factor * y - level) + pulse


def behind_a_loss_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    rate, factor, level, height, centre, width = args
    (pushed,) = gaussian_truth(t, [0 * y0[0]], (-rate * factor, height, centre, width))
    off = y0[0] - level / factor
    return [level / factor + off * np.exp(rate * factor * (t - t[0])) + pushed]


def draw_behind_a_loss(random: Random) -> dict[str, Any]:
    """It starts as near to an unstable balance as float64 numbers can, so that rounding decides."""
    end = powers(random, -1, 2)
    factor, level = float(random.integers(3, 50)), float(random.integers(1, 50))
    growth = float(random.uniform(5.0, 60.0))
    centre, width = float(random.uniform(0.2, 0.95)) * end, end * powers(random, -4.5, -1.5)
    # At the end as large as something between one rounding error, grown, and the level.
    at_end = level / factor * max(float(np.exp(growth)) * 1e-17, 1.0) * powers(random, -3, 1)
    area = at_end * float(np.exp(-growth * (1 - centre / end))) * sign(random)
    return {
        "span": [0.0, end],
        "y0": [level / factor],
        "args": [growth / (factor * end), factor, level, area / width, centre, width],
    }


def kick(t: Any, x: Any, v: Any, args: Any) -> Any:
    height, centre, width = args
    return height / jnp.cosh((t - centre) / width) ** 2 + 0 * x


def kick_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    height, centre, width = args
    u, u0 = (t - centre) / width, (t[:1] - centre) / width
    push, time = height * width, t - t[0]
    x = y0[0] + y0[1] * time + push * (width * (log_cosh(u) - log_cosh(u0)) - np.tanh(u0) * time)
    return [x, y0[1] + push * (np.tanh(u) - np.tanh(u0))]


def draw_kick(random: Random) -> dict[str, Any]:
    end = powers(random, -1, 2)
    width = end * powers(random, -4.5, -0.5)
    push = powers(random, -2, 1) * sign(random) / end
    y0 = [[float(random.normal())], [float(random.normal() / end) * random.integers(2)]]
    return {
        "span": [0.0, end],
        "y0": y0,
        "args": [push / width, place(random, (0.0, end)), width],
    }


# --- Pulses in the state ----------------------------------------------------------------------


def state_pulse(t: Any, y: Any, args: Any) -> Any:
    rate, height, centre, width = args
    x = y[0]
    return jnp.stack([rate * x, height * rate * x / jnp.cosh((x - centre) / width) ** 2])


def state_pulse_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    rate, height, centre, width = args
    x = y0[0] * np.exp(rate * (t - t[0]))
    u, u0 = (x - centre) / width, (x[:1] - centre) / width
    return [x, y0[1] + height * width * (np.tanh(u) - np.tanh(u0))]


def draw_state_pulse(random: Random, narrow: float, wide: float) -> dict[str, Any]:
    end = powers(random, -1, 2)
    growth = random.uniform(0.2, 3.0) * sign(random)
    last = float(np.exp(growth))
    width = abs(last - 1.0) * powers(random, narrow, wide)
    area = powers(random, -2, 1) * sign(random)
    return {
        "span": [0.0, end],
        "y0": [1.0, float(random.normal())],
        "args": [growth / end, area / width, place(random, (1.0, last)), width],
    }


def slow_layer(t: Any, y: Any, args: Any) -> Any:
    speed, slowness, centre, width = args
    return speed / (1 + slowness / jnp.cosh((y - centre) / width) ** 2)


def slow_layer_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    """Where ``time(y) = t``; both bisection and Newton's method, since the layer may be thin."""
    speed, slowness, centre, width = args

    def way(y: Any) -> Any:
        return y + slowness * width * np.tanh((y - centre) / width)

    goal = way(y0[0] + 0 * t[:1]) + speed * (t - t[0])
    low, high = y0[0] + 0 * t, y0[0] + speed * (t - t[0])
    for _ in range(80):
        middle = (low + high) / 2
        before = way(middle) < goal
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    y = (low + high) / 2
    for _ in range(8):
        slope = 1 + slowness / np.cosh((y - centre) / width) ** 2
        y = y - (way(y) - goal) / slope
    return [y]


def draw_slow_layer(random: Random) -> dict[str, Any]:
    end, length = powers(random, -1, 2), powers(random, -1, 1)
    width = length * powers(random, -4, -0.5)
    # It takes a share of the time to pass.
    slowness = powers(random, -2, 0) * length / (2 * width)
    return {
        "span": [0.0, end],
        "y0": [0.0],
        "args": [length / end, slowness, 0.6 * place(random, (0.0, length)), width],
    }


# --- Switches ---------------------------------------------------------------------------------


def window(t: Any, y: Any, args: Any) -> Any:
    rate, height, begin, end = args
    return jnp.where((t > begin) & (t < end), height, 0.0) - rate * y


def window_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    rate, height, begin, end = args
    y = np.exp(-rate * (t - t[0])) * y0[0]
    since = np.maximum(t - begin, 0 * t)
    behind = np.maximum(t - end, 0 * t)
    return [y + height / rate * (np.exp(-rate * behind) - np.exp(-rate * since))]


def draw_window(random: Random, *, declared: bool) -> dict[str, Any]:
    end = powers(random, -1, 2)
    width = end * powers(random, -4.5, -0.3)
    begin = float(random.uniform(0.02, 0.98)) * (end - width)
    area = powers(random, -2, 1) * sign(random)
    drawn = {
        "span": [0.0, end],
        "y0": [float(random.normal())],
        "args": [powers(random, -2, 1) / end, area / width, begin, begin + width],
    }
    return {**drawn, "jump_times": [begin, begin + width]} if declared else drawn


def state_window(t: Any, y: Any, args: Any) -> Any:
    rate, low, high, begin, end = args
    x = y[0]
    return jnp.stack([rate * x, jnp.where((x > begin) & (x < end), high, low)])


def state_window_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    rate, low, high, begin, end = args
    first, second = (t[0] + np.log(edge / y0[0]) / rate for edge in (begin, end))
    time_in = np.minimum(np.maximum(t, first), second) - np.maximum(first, t[0])
    x = y0[0] * np.exp(rate * (t - t[0]))
    return [x, y0[1] + low * (t - t[0]) + (high - low) * time_in]


def draw_state_window(random: Random) -> dict[str, Any]:
    end = powers(random, -1, 2)
    growth = random.uniform(0.2, 3.0)
    last = float(np.exp(growth))
    width = (last - 1.0) * powers(random, -4.5, -0.3)
    begin = 1.0 + float(random.uniform(0.02, 0.98)) * (last - 1.0 - width)
    low, area = float(random.normal()) / end, powers(random, -2, 1) * sign(random)
    high = low + area / end * (last - 1.0) / width
    return {
        "span": [0.0, end],
        "y0": [1.0, float(random.normal())],
        "args": [growth / end, low, high, begin, begin + width],
    }


def two_springs(t: Any, y: Any, args: Any) -> Any:
    right, left = args
    x, v = y[0], y[1]
    return jnp.stack([v, -jnp.where(x > 0, right, left) * x])


def two_springs_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    """From x = 0 with a positive velocity: half a period on each side in turn."""
    fast, slow = (np.sqrt(stiffness) for stiffness in args)
    pi = 4 * np.arctan(1 + 0 * t[0])
    half, period = pi / fast, pi / fast + pi / slow
    whole = np.floor(((t - t[0]) / period).astype(np.float64)).astype(int)
    phase = (t - t[0]) - np.array([period * int(each) for each in whole])
    right = phase < half
    rate = np.where(right, fast, slow)
    angle = rate * np.where(right, phase, phase - half)
    v = y0[1] * np.where(right, np.cos(angle), -np.cos(angle))
    return [y0[1] / rate * np.where(right, np.sin(angle), -np.sin(angle)), v]


def draw_two_springs(random: Random) -> dict[str, Any]:
    right = powers(random, -1, 2)
    left = right * powers(random, 0, 6)
    return {
        "span": [0.0, float(random.uniform(1.0, 8.0)) * np.pi / np.sqrt(right)],
        "y0": [0.0, abs(float(random.normal())) + 0.1],
        "args": [right, left],
    }


# --- Balances and growth ----------------------------------------------------------------------


def balance(t: Any, y: Any, args: Any) -> Any:
    rate, large, small = args
    return rate * y + ((large + small) - large)


def balance_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    rate, _, small = args
    growth = np.expm1(rate * (t - t[0]))
    return [y0[0] + growth * (y0[0] + small / rate)]


def column(t: Any, x: Any, v: Any, args: Any) -> Any:
    """It buckles, beside a mass that swings."""
    rate, large, small = args
    return jnp.stack([rate * rate * x[0] + ((large + small) - large), -rate * rate * x[1]])


def column_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    rate, _, small = args
    angle, push = rate * (t - t[0]), small / rate
    x0, x1, v0, v1 = y0
    return [
        # Half the angle: the hyperbolic cosine less 1 would cancel.
        x0 * np.cosh(angle)
        + v0 / rate * np.sinh(angle)
        + 2 * push / rate * np.sinh(angle / 2) ** 2,
        x1 * np.cos(angle) + v1 / rate * np.sin(angle),
        x0 * rate * np.sinh(angle) + v0 * np.cosh(angle) + push * np.sinh(angle),
        -x1 * rate * np.sin(angle) + v1 * np.cos(angle),
    ]


def draw_balance(random: Random) -> dict[str, Any]:
    end = powers(random, -1, 2)
    large = powers(random, -1, 1)
    small = large * powers(random, -22, -14) * float(random.choice([-1.0, 0.0, 1.0, 1.0]))
    return {
        "span": [0.0, end],
        "y0": [0.0],
        "args": [float(random.uniform(1.0, 55.0)) / end, large, small],
    }


def draw_column(random: Random) -> dict[str, Any]:
    moving = float(random.choice([0.0, 1.0, 1.0]))
    return {**draw_balance(random), "y0": [[0.0, moving], [0.0, 0.0]]}


def delayed(t: Any, y: Any, args: Any) -> Any:
    rate, centre, large, small = args
    return rate * (t - centre) * y + ((large + small) - large)


def delayed_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    rate, centre, _, small = args
    pi = 4 * np.arctan(1 + 0 * t)
    root = np.sqrt(rate / 2)
    u, u0 = root * (t - centre), root * (t[:1] - centre)
    pushed = small * np.sqrt(pi) / (2 * root) * np.exp(u * u) * (erf(u) - erf(u0))
    return [np.exp(u * u - u0 * u0) * y0[0] + pushed]


def draw_delayed(random: Random) -> dict[str, Any]:
    """It decays until the centre by a factor, and grows as much after it."""
    end, centre = 2.0, 1.0
    large = float(random.choice([0.0, 1.0]))
    small = powers(random, -60, -10) * float(random.choice([0.0, 1.0, -1.0]))
    return {
        "span": [0.0, end * float(random.uniform(0.8, 1.1))],
        "y0": [1.0],
        "args": [2.0 * float(random.uniform(5.0, 120.0)), centre, large, small],
    }


def hidden(t: Any, y: Any, args: Any) -> Any:
    decay, growth = args
    return jnp.stack([-decay * y[0], growth * y[1]])


def hidden_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    decay, growth = args
    return [y0[0] * np.exp(-decay * (t - t[0])), y0[1] * np.exp(growth * (t - t[0]))]


def draw_hidden(random: Random) -> dict[str, Any]:
    """A component far below the tolerance grows to the size of the other."""
    end, orders = powers(random, -1, 2), float(random.uniform(10.0, 60.0))
    growth = (orders + random.uniform(-3.0, 2.0)) * np.log(10.0)
    return {
        "span": [0.0, end],
        "y0": [1.0, 10.0**-orders],
        "args": [powers(random, -2, 0) / end, growth / end],
    }


# --- Cancellation and stagnation --------------------------------------------------------------


def cancelling(t: Any, y: Any, args: Any) -> Any:
    height, rate, shape = args
    u = rate * t
    forms = 1 - jnp.cos(u), (1 + u) - 1, jnp.exp(u) - 1, jnp.sqrt(1 + u) - 1
    return height * sum(weight * form for weight, form in zip(shape, forms, strict=True)) + 0 * y


def cancelling_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    height, rate, shape = args
    u = rate * t
    integrals = (
        t - np.sin(u) / rate,
        u * t / 2,
        np.expm1(u) / rate - t,
        2 * np.expm1(3 * np.log1p(u) / 2) / (3 * rate) - t,
    )
    parts = zip(shape, integrals, strict=True)
    return [y0[0] + height * sum(weight * (each - each[0]) for weight, each in parts)]


def draw_cancelling(random: Random) -> dict[str, Any]:
    end, largest = powers(random, -1, 2), powers(random, -16, -1)
    which = int(random.integers(4))
    size = largest**2 / 2 if which == 0 else largest
    return {
        "span": [0.0, end],
        "y0": [float(random.normal())] if random.random() < 0.5 else [0.0],
        "args": [
            1.0 / (size * end),
            largest / end,
            tuple(float(which == each) for each in range(4)),
        ],
    }


def swallowed(t: Any, y: Any, args: Any) -> Any:
    rate, large = args
    return rate * ((large + y) - large)


def swallowed_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    return [y0[0] * np.exp(args[0] * (t - t[0]))]


def draw_swallowed(random: Random) -> dict[str, Any]:
    end, y0 = powers(random, -1, 2), powers(random, -3, 3)
    return {
        "span": [0.0, end],
        "y0": [y0],
        "args": [sign(random) * powers(random, -1, 0.7) / end, y0 * powers(random, -1, 18)],
    }


def tiny_rate(t: Any, y: Any, args: Any) -> Any:
    (rate,) = args
    return rate * y


def tiny_rate_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    return [y0[0] * np.exp(args[0] * (t - t[0]))]


def draw_tiny_rate(random: Random) -> dict[str, Any]:
    end = powers(random, -1, 4)
    return {
        "span": [0.0, end],
        "y0": [powers(random, -3, 3)],
        "args": [sign(random) * powers(random, -18, -1) / end],
    }


def offset(t: Any, y: Any, args: Any) -> Any:
    slope, height, rate = args
    return slope + height * rate * jnp.cos(rate * t) + 0 * y


def offset_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    slope, height, rate = args
    return [y0[0] + slope * (t - t[0]) + height * (np.sin(rate * t) - np.sin(rate * t[0]))]


def draw_offset(random: Random) -> dict[str, Any]:
    end = powers(random, -1, 2)
    motion = powers(random, -3, 3)
    return {
        "span": [0.0, end],
        "y0": [sign(random) * motion * powers(random, 4, 19)],
        "args": [
            sign(random) * motion / end,
            float(random.choice([0.0, motion])),
            float(random.uniform(1.0, 10.0)) / end,
        ],
    }


def clock(t: Any, y: Any, args: Any) -> Any:
    rate, start = args
    return jnp.stack([jnp.ones_like(y[0]), rate * jnp.cos(rate * (y[0] - start))])


def clock_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    rate, start = args
    now = y0[0] + (t - t[0])
    first = rate * (y0[0] - start)
    return [now, y0[1] + np.sin(rate * (now - start)) - np.sin(first)]


def draw_clock(random: Random) -> dict[str, Any]:
    """A time in the state, such as the seconds since 1970."""
    end, now = powers(random, -6, 1), powers(random, 2, 17)
    return {
        "span": [0.0, end],
        "y0": [now, float(random.normal())],
        "args": [float(random.uniform(0.5, 20.0)) / end, now],
    }


# --- Many samples, late starts, scales --------------------------------------------------------


def oscillator(t: Any, y: Any, args: Any) -> Any:
    stiffness, damping = args
    return jnp.stack([y[1], -stiffness * y[0] - 2 * damping * y[1]])


def oscillator_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    stiffness, damping = args
    rate, time = np.sqrt(stiffness - damping * damping), t - t[0]
    decay, cos, sin = np.exp(-damping * time), np.cos(rate * time), np.sin(rate * time) / rate
    x = decay * (y0[0] * cos + (y0[1] + damping * y0[0]) * sin)
    v = decay * (y0[1] * cos - (stiffness * y0[0] + damping * y0[1]) * sin)
    return [x, v]


def draw_oscillator(random: Random) -> dict[str, Any]:
    rate = powers(random, -1, 1)
    return {
        "span": [0.0, float(random.uniform(10.0, 300.0)) / rate],
        "y0": [float(random.normal()), float(random.normal()) * rate],
        "args": [rate**2, rate * float(random.choice([0.0, 0.01]))],
    }


def draw_fast(random: Random) -> dict[str, Any]:
    """About as many periods in each frame, so that every sample may show the same phase."""
    periods = int(random.integers(1, 30))
    rate = 2 * np.pi * periods * float(random.choice([1.0, 1.0 + 1e-3 * random.normal()]))
    return {
        "span": [0.0, float(random.integers(1, 6))],
        "y0": [float(random.normal()), float(random.normal()) * rate],
        "args": [rate**2, 0.0],
    }


def draw_scaled(random: Random) -> dict[str, Any]:
    size, time = powers(random, -100, 100), powers(random, -30, 30)
    rate = 1 / time
    return {
        "span": [0.0, float(random.uniform(1.0, 30.0)) * time],
        "y0": [float(random.normal()) * size, float(random.normal()) * size * rate],
        "args": [rate**2, rate * float(random.choice([0.0, 0.1]))],
    }


def logistic(t: Any, y: Any, args: Any) -> Any:
    rate, limit = args
    return rate * y * (1 - y / limit)


def logistic_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    rate, limit = args
    grown = np.exp(rate * (t - t[0]))
    return [y0[0] * grown / (1 + y0[0] / limit * (grown - 1))]


def draw_logistic(random: Random) -> dict[str, Any]:
    time, limit = powers(random, -30, 30), powers(random, -100, 100)
    return {
        "span": [0.0, float(random.uniform(1.0, 20.0)) * time],
        "y0": [limit * powers(random, -6, 0.5)],
        "args": [1.0 / time, limit],
    }


def late(t: Any, y: Any, args: Any) -> Any:
    pull, rate = args
    return rate * jnp.cos(rate * t) - pull * (y - jnp.sin(rate * t))


def late_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    pull, rate = args
    off = y0[0] - np.sin(rate * t[0])
    return [np.sin(rate * t) + off * np.exp(-pull * (t - t[0]))]


def draw_late(random: Random, low: float, high: float) -> dict[str, Any]:
    start, length = powers(random, low, high) * sign(random), powers(random, -1, 1)
    return {
        "span": [start, start + length],
        "y0": [float(random.normal())],
        "args": [powers(random, -1, 1) / length, float(random.uniform(0.5, 20.0)) / length],
    }


# --- Poles, roots, stiffness ------------------------------------------------------------------


def pole(t: Any, y: Any, args: Any) -> Any:
    (rate,) = args
    return rate * y * y


def pole_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    left = 1 - args[0] * y0[0] * (t - t[0])
    # There is no solution behind the pole, and what is trusted there is wrong.
    return [np.where(left > 0, y0[0] / left, heyoka.real("nan", 60))]


def draw_pole(random: Random, low: float, high: float) -> dict[str, Any]:
    time, y0 = powers(random, -1, 2), powers(random, -2, 2)
    until = 1.0 - powers(random, -high, -low)
    return {"span": [0.0, until * time], "y0": [y0], "args": [1.0 / (y0 * time)]}


def draw_pole_passed(random: Random) -> dict[str, Any]:
    time, y0 = powers(random, -1, 2), powers(random, -2, 2)
    until = float(random.uniform(1.01, 3.0))
    return {"span": [0.0, until * time], "y0": [y0], "args": [1.0 / (y0 * time)]}


def falling(t: Any, y: Any, args: Any) -> Any:
    (rate,) = args
    return -rate / (2 * y)


def falling_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    left = y0[0] * y0[0] - args[0] * (t - t[0])
    return [np.where(left > 0, np.sqrt(np.abs(left)), heyoka.real("nan", 60))]


def draw_falling(random: Random) -> dict[str, Any]:
    time, y0 = powers(random, -1, 2), powers(random, -2, 2)
    until = float(random.choice([1.0 - powers(random, -8, -0.3), random.uniform(1.01, 3.0)]))
    return {"span": [0.0, until * time], "y0": [y0], "args": [y0**2 / time]}


def root(t: Any, y: Any, args: Any) -> Any:
    (rate,) = args
    return rate * jnp.sqrt(jnp.abs(y))


def root_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    return [(np.sqrt(y0[0]) + args[0] * (t - t[0]) / 2) ** 2]


def draw_root(random: Random) -> dict[str, Any]:
    """The solution is almost not unique where it starts near zero."""
    time = powers(random, -1, 2)
    return {"span": [0.0, time], "y0": [powers(random, -200, -2)], "args": [2.0 / time]}


def stiff(t: Any, y: Any, args: Any) -> Any:
    pull, cubic, rate = args
    z = y - jnp.cos(rate * t)
    return -pull * z * (1 + cubic * z * z) - rate * jnp.sin(rate * t)


def stiff_truth(t: Reals, y0: Any, args: Any) -> Sequence[Reals]:
    pull, cubic, rate = args
    z0 = y0[0] - np.cos(rate * t[0])
    grown = (1 / (z0 * z0) + cubic) * np.exp(2 * pull * (t - t[0])) - cubic
    return [np.cos(rate * t) + np.where(z0 > 0, 1 / np.sqrt(grown), -1 / np.sqrt(grown))]


def draw_stiff(random: Random) -> dict[str, Any]:
    end = powers(random, -1, 2)
    return {
        "span": [0.0, end],
        "y0": [1.0 + sign(random) * powers(random, -3, 0.5)],
        "args": [
            powers(random, 1, 6) / end,
            float(random.integers(2)),
            float(random.uniform(0.5, 10.0)) / end,
        ],
    }


ADVERSARIES = {
    "pulse, wide": Adversary(
        gaussian, lambda random: draw_gaussian(random, -1.5, -0.3), gaussian_truth, smooth=True
    ),
    "pulse, narrow": Adversary(
        gaussian,
        lambda random: draw_gaussian(random, -4.5, -1.5),
        gaussian_truth,
        share=2.0,
        extended=0.2,
    ),
    "pulse, declared": Adversary(gaussian, draw_declared_gaussian, gaussian_truth, smooth=True),
    "pulse behind a loss": Adversary(
        behind_a_loss, draw_behind_a_loss, behind_a_loss_truth, extended=0.5
    ),
    "bump or smooth switch": Adversary(
        bump, lambda random: draw_bump(random, -4.5, -0.5), bump_truth, share=2.0, extended=0.1
    ),
    "kick": Adversary(kick, draw_kick, kick_truth, mechanical=True, extended=0.1),
    "pulse in the state": Adversary(
        state_pulse,
        lambda random: draw_state_pulse(random, -4.5, -0.5),
        state_pulse_truth,
        share=1.5,
        extended=0.1,
    ),
    "slow layer": Adversary(slow_layer, draw_slow_layer, slow_layer_truth, share=0.7),
    "window, declared": Adversary(
        window, lambda random: draw_window(random, declared=True), window_truth, smooth=True
    ),
    "window": Adversary(
        window,
        lambda random: draw_window(random, declared=False),
        window_truth,
        share=2.0,
        extended=0.1,
    ),
    "window in the state": Adversary(
        state_window, draw_state_window, state_window_truth, share=1.5
    ),
    "two springs": Adversary(two_springs, draw_two_springs, two_springs_truth, share=0.7),
    "balance": Adversary(balance, draw_balance, balance_truth, extended=0.1),
    "column": Adversary(column, draw_column, column_truth, mechanical=True, extended=0.1),
    "delayed loss of stability": Adversary(delayed, draw_delayed, delayed_truth, extended=0.1),
    "hidden growth": Adversary(hidden, draw_hidden, hidden_truth, extended=0.1),
    "cancellation": Adversary(
        cancelling, draw_cancelling, cancelling_truth, share=2.0, extended=0.1
    ),
    "swallowed state": Adversary(swallowed, draw_swallowed, swallowed_truth, extended=0.1),
    "tiny rate": Adversary(
        tiny_rate, draw_tiny_rate, tiny_rate_truth, share=1.5, smooth=True, frames=MANY
    ),
    "offset": Adversary(offset, draw_offset, offset_truth, share=1.5, smooth=True, frames=MANY),
    "clock in the state": Adversary(clock, draw_clock, clock_truth, share=1.5, frames=SOME),
    "many samples": Adversary(
        oscillator, draw_oscillator, oscillator_truth, share=0.5, smooth=True, frames=MOST
    ),
    "fast oscillation": Adversary(oscillator, draw_fast, oscillator_truth, share=0.5, smooth=True),
    "scales": Adversary(oscillator, draw_scaled, oscillator_truth, smooth=True),
    "logistic, scaled": Adversary(logistic, draw_logistic, logistic_truth, smooth=True),
    "late start": Adversary(
        late, lambda random: draw_late(random, 1.0, 5.0), late_truth, smooth=True
    ),
    "very late start": Adversary(late, lambda random: draw_late(random, 5.0, 9.0), late_truth),
    "pole, far": Adversary(
        pole, lambda random: draw_pole(random, 0.3, 2.0), pole_truth, smooth=True
    ),
    "pole, near": Adversary(
        pole, lambda random: draw_pole(random, 2.0, 10.0), pole_truth, share=0.5
    ),
    "pole, passed": Adversary(pole, draw_pole_passed, pole_truth, share=0.3),
    "falling into a singularity": Adversary(falling, draw_falling, falling_truth, share=0.4),
    "root": Adversary(root, draw_root, root_truth, share=0.5),
    "stiff": Adversary(stiff, draw_stiff, stiff_truth, share=0.2, smooth=True),
}
