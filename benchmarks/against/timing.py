"""Contenders, the rounds in which they run in turn, and what a result file holds of them."""

from __future__ import annotations

import dataclasses
import gc
import importlib
import time
from collections.abc import Callable
from typing import Any

FEWEST_ROUNDS = 3


@dataclasses.dataclass
class Contender:
    """One way to do the work of a case.

    Arguments:
        by: whose: `ropeode` or a peer.
        how: method and options, in a few words.
        run: does the work once and returns the seconds that it took.
        facts: what is told beside the times: `true_error`, `tolerance`, `evaluations`,
            `compile_seconds`, `steps`, `bound`, `rhs`; plain numbers and strings.
        measured: seconds of a run that is too long to be repeated; it is not run again.
    """

    by: str
    how: str
    run: Callable[[], float]
    facts: dict[str, Any] = dataclasses.field(default_factory=dict)
    measured: float | None = None


def clocked(work: Callable[[], Any]) -> Callable[[], float]:
    """`work` as a run: the seconds of the whole call."""

    def run() -> float:
        started = time.perf_counter()
        work()
        return time.perf_counter() - started

    return run


def race(
    contenders: list[Contender], rounds: int, *, budget: float, scale: float = 1.0
) -> list[dict[str, Any]]:
    """Run all in turn, round after round; each round begins with another one.

    Arguments:
        contenders: the first is the one that ratios are taken to.
        rounds: how many; fewer, but at least three, where the budget is spent.
        budget: in seconds.
        scale: seconds are multiplied by it.

    Returns:
        For each contender what the result file holds of it.
    """
    values: list[list[float]] = [[] for _ in contenders]
    indices = list(range(len(contenders)))
    started = time.perf_counter()
    for number in range(rounds):
        if number >= FEWEST_ROUNDS and time.perf_counter() - started > budget:
            break
        gc.collect()
        first = number % len(indices)
        for index in indices[first:] + indices[:first]:
            each = contenders[index]
            if each.measured is None:
                values[index].append(each.run() * scale)
            elif not values[index]:
                values[index].append(each.measured * scale)
    return [
        {"by": each.by, "how": each.how, "values": found, **each.facts}
        for each, found in zip(contenders, values, strict=True)
    ]


class Peers:
    """The packages that are there, and a line for each one that is not."""

    def __init__(self) -> None:
        self.left_out: list[str] = []
        self._found: dict[str, Any] = {}

    def get(self, module: str, package: str) -> Any:
        """A module, or None (and a line) where it cannot be imported."""
        if module not in self._found:
            try:
                self._found[module] = importlib.import_module(module)
            except ImportError as reason:
                self._found[module] = None
                self.leave_out(package, f"cannot be imported ({reason})")
        return self._found[module]

    def leave_out(self, what: str, why: str) -> None:
        """Note what has been left out."""
        self.left_out.append(f"{what}: {why}")
