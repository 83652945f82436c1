"""Random ropes instead of the check ropes, and the findings of right steppers on them."""

from __future__ import annotations

import contextlib
import functools
import importlib
import sys
from collections.abc import Iterator
from typing import Any
from unittest import mock

import numpy as np

from ropeode.checking import (
    CHECKS,
    Claims,
    Examination,
    Finding,
    check_rope,
    reference_of,
)
from ropeode.errors import ReferenceRefused
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.simulation import Method, method_of
from tests.checking.right_steppers import RIGHT

NODES, DIM = 5, 3
# It holds what no face has: the ropes, which are replaced wherever checks look for them.
check_ropes = importlib.import_module("ropeode.checking.check_ropes")

# What is not drawn of ropes that other checks use beside those of order: they have equal frames,
# and are not driven; nothing pulls or holds the free one.
_NOTHING = (0.0, 0.0, 0.0)
ALIKE: dict[str, dict[str, Any]] = {
    "unequal": {"equal": True, "drive": _NOTHING},
    "free": {"equal": True, "drive": _NOTHING, "gravity": _NOTHING, "damping": 0.0, "pinned": ()},
}

Random = np.random.Generator


def numbers(random: Random, low: float, high: float, count: int) -> Any:
    """Between two others, as often alike as not."""
    drawn = np.exp(random.uniform(np.log(low), np.log(high), count))
    return drawn if random.random() < 0.5 else np.full(count, drawn[0])


def rope(random: Random, name: str, equal: bool = False, **fixed: Any) -> Problem:
    """A random check rope.

    Arguments:
        random: to draw from.
        name: of the problem in whose place it is.
        equal: whether its frames are; if not, they are as often as not.
        fixed: arguments of `check_rope` that are not drawn.
    """
    size = np.exp(random.uniform(np.log(0.5), np.log(2.0)))
    rest_length = size * numbers(random, 0.6, 1.4, NODES - 1)
    stretch = random.uniform(0.8, 1.4, NODES - 1)
    along = random.normal(size=DIM)
    steps = along / np.linalg.norm(along) + 0.35 * random.normal(size=(NODES - 1, DIM))
    steps *= (rest_length * stretch / np.linalg.norm(steps, axis=1))[:, None]
    x0 = size * random.normal(size=DIM) + np.vstack([np.zeros(DIM), np.cumsum(steps, axis=0)])
    pinned = random.choice(NODES, int(random.integers(0, 3)), replace=False)
    frames = random.uniform(0.25, 0.7, 3)
    if equal or random.random() < 0.5:
        frames[:] = frames[0]
    drawn = {
        "x0": x0,
        "v0": size * random.choice([0.0, 0.5]) * random.normal(size=(NODES, DIM)),
        "ts": random.choice([0.0, random.normal()]) + np.concatenate([[0.0], np.cumsum(frames)]),
        "mass": numbers(random, 0.5, 2.0, NODES),
        "stiffness": numbers(random, 1.5, 6.0, NODES - 1),
        "rest_length": rest_length,
        "pinned": pinned,
        "gravity": size * random.choice([0.0, 1.0]) * random.normal(size=DIM),
        "damping": random.choice([0.0, 1.0]) * numbers(random, 0.05, 0.6, NODES),
        "drive": size * random.choice([0.0, 1.0]) * random.normal(size=DIM),
        "frequency": random.uniform(0.5, 4.0),
    }
    return check_rope(name, **{**drawn, **fixed})


def ropes(seed: int, index: int) -> tuple[dict[str, Any], int]:
    """The same ropes for the same numbers, and how many were drawn that have no reference."""
    random = np.random.default_rng([seed, index])
    refused = 0
    while True:
        drawn = drawn_ropes(random)
        try:
            for problem in drawn["convergence_problems"]().values():
                reference_of(problem)
        except ReferenceRefused:
            refused += 1
            continue
        return drawn, refused


def drawn_ropes(random: Random) -> dict[str, Any]:
    """Replacements for the check ropes: functions by their names in `checking.check_ropes`."""
    convergence = {
        name: rope(random, name, **ALIKE.get(name, {}))
        for name in check_ropes.convergence_problems()
    }
    # What the checks beside those of order look at is damped and pinned, too.
    convergence["unequal"] = generic = rope(
        random,
        "unequal",
        damping=numbers(random, 0.05, 0.6, NODES),
        pinned=[int(random.integers(NODES))],
        **ALIKE["unequal"],
    )
    undamped = generic.changed(args=generic.args._replace(damping=np.zeros(NODES)))
    still = hanging(random)
    swing = pushed(random, still)
    return {
        "convergence_problems": lambda: convergence,
        "generic": lambda: generic,
        "undamped": lambda: undamped,
        "hanging": lambda: still,
        "swing": lambda: swing,
    }


def hanging(random: Random) -> Problem:
    """A random rope that hangs still."""
    return check_ropes.hanging_rope(
        mass=numbers(random, 0.5, 1.5, NODES),
        stiffness=numbers(random, 7.0, 10.0, NODES - 1),
        rest_length=numbers(random, 0.6, 1.0, NODES - 1),
        gravity=random.uniform(0.6, 1.0),
    )


def pushed(random: Random, still: Problem) -> Problem:
    """The same, displaced and sampled like the check rope."""
    own = check_ropes.swing()
    aside = own.y0[0] - check_ropes.hanging().y0[0]
    aside = aside + 0.03 * random.normal(size=aside.shape) * still.args.free[:, None]
    return still.changed(y0=still.y0 + np.stack([aside, 0.0 * aside]), ts=own.ts, name="swing")


@contextlib.contextmanager
def in_place(drawn: dict[str, Any]) -> Iterator[None]:
    """The drawn ropes instead of the check ropes, in all modules of the room that have them."""
    modules = [each for name, each in sys.modules.items() if name.startswith("ropeode.checking.")]
    with contextlib.ExitStack() as stack:
        for name, function in drawn.items():
            own = getattr(check_ropes, name)
            for module in modules:
                if module is not check_ropes and getattr(module, name, None) is own:
                    stack.enter_context(mock.patch.object(module, name, function))
        yield


@functools.cache
def tried_once(name: str) -> tuple[Method, Claims | None]:
    """What `check_stepper` makes of a right stepper; compiled once for all ropes."""
    given, said = RIGHT[name]
    names = {"order" if name == "expected_order" else name: it for name, it in said.items()}
    claims = Claims(**names)
    return method_of(given, check_ropes.undamped()), claims if said else None


def findings(name: str, drawn: dict[str, Any]) -> dict[str, Finding]:
    """Those of every check, by its name, of a right stepper on drawn ropes."""
    this = Examination(*tried_once(name))
    checks = {**CHECKS}
    if this.claims.method is None:
        # Without a claimed method it cannot fail, and it takes long.
        del checks["stability"]
    with in_place(drawn):
        return {check: in_float64(function)(this) for check, function in checks.items()}
