"""A trajectory that can be trusted, with the certificate that says how far."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import numpy as np

from ropeode import rooms_above
from ropeode.arrays import real_array
from ropeode.display import Sampled
from ropeode.errors import ReferenceRefused
from ropeode.json_form import json_shows
from ropeode.norms import Norm, norm_for
from ropeode.problems import Problem, require_problem
from ropeode.references.certificate import Certificate
from ropeode.validation import bad_value


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Reference(Sampled):
    """A reference trajectory.

    Arguments:
        problem: what was solved.
        states: ``(times, *state)`` at the problem's sample times; only the first
            `certificate.trusted` of them are inside the trust horizon.
        certificate: how far it can be trusted, and why.

    Examples:
        >>> from ropeode import load
        >>> truth = load("kepler")
        >>> truth
        <Reference: Kepler, 90 frames; heyoka Taylor, 124 bits, estimated bound 1.1e-16,
        trusted to the end>
        >>> truth.states.shape, truth.trusted, truth.horizon
        ((91, 2, 1, 2), 91, None)
    """

    problem: Problem
    states: np.ndarray
    certificate: Certificate

    @property
    def times(self) -> np.ndarray:
        """The sample times that the solver reached, ``(times,)``."""
        return self.problem.ts[: len(self.states)]

    @property
    def tree(self) -> Any:
        """The states as a pytree like the initial state, with an axis of times in each array."""
        return self.problem.unravel(self.states)

    @property
    def positions(self) -> np.ndarray:
        """Positions, ``(times, nodes, dim)``."""
        return self.problem.positions(self.states)

    @property
    def velocities(self) -> np.ndarray:
        """Velocities, ``(times, nodes, dim)``."""
        return self.problem.velocities(self.states)

    @property
    def trusted(self) -> int:
        """The number of samples inside the trust horizon."""
        return self.certificate.trusted

    @property
    def horizon(self) -> float | None:
        """The first sample time outside the trust horizon; None if there is none."""
        return self.certificate.horizon

    def bound(self, norm: Norm | str | None = None) -> np.ndarray:
        """The estimated error bound at each sample inside the horizon, ``(trusted,)``.

        Arguments:
            norm: in which the error is measured, or its name; the bound is for the largest
                node, which no norm exceeds. By default the problem's first quantity.

        Raises:
            InputError: there is no such norm, or the problem has no such quantity.

        Examples:
            >>> from ropeode import load
            >>> bound = load("robertson").bound()
            >>> f"{bound[1]:.0e}, {bound[-1]:.0e}"
            '8e-12, 3e-10'
        """
        quantity = norm_for(self.problem, norm).quantity
        return self.certificate.bounds[quantity][: self.trusted]

    def at(self, times: Any) -> np.ndarray:
        """States at any times, inside the trust horizon.

        If one of them is no sample, the problem is solved again, with these times as samples, and
        certified by the same runs. That takes as long as the reference did, so ask for all times
        at once. The last few answers are kept.

        Arguments:
            times: one or several, in the problem's unit of time, in any order.

        Returns:
            ``(times, *state)``; of a single time one state.

        Raises:
            InputError: a time is outside the trust horizon, or the problem has no equations.
            ReferenceRefused: the solution cannot be trusted at one of these times.

        Examples:
            >>> from ropeode import Rope, reference
            >>> truth = reference(Rope(num_nodes=4).problem(frames=3))
            >>> truth.at([0.5, 1.5]).shape
            (2, 2, 2, 4)
            >>> truth.at(1.5)[0, 1].round(6)
            array([200.      , 198.880646, 198.880604, 198.880604])
        """
        finer, index = self._with_samples(times)
        return finer.states[index]

    def bound_at(self, times: Any, norm: Norm | str | None = None) -> np.ndarray:
        """The estimated error bound of `at`, ``(times,)``; a single number for a single time.

        Arguments:
            times: as for `at`, which computes the bounds of the same times too.
            norm: as for `bound`.

        Raises:
            InputError: as for `at`, or the norm is as for `bound`.
            ReferenceRefused: as for `at`.

        Examples:
            >>> from ropeode import Rope, reference
            >>> truth = reference(Rope(num_nodes=4).problem(frames=3))
            >>> truth.bound_at([0.5, 1.5]) < 1e-9
            array([ True,  True])
        """
        finer, index = self._with_samples(times)
        return finer.bound(norm)[index]

    def _with_samples(self, times: Any) -> tuple[Reference, np.ndarray]:
        """A reference with these times among its trusted samples, and their indices there."""
        wanted = real_array("times", times)
        start, end = self.times[0], self.times[self.trusted - 1]
        outside = wanted[(wanted < start) | (wanted > end)]
        if wanted.ndim > 1 or outside.size:
            raise bad_value(
                "times",
                float(outside[0]) if outside.size else wanted.shape,
                f"a number, or a list of numbers, from {start:g} to {end:g}, the span in which "
                "the reference is trusted",
                "leave out the others, or compute a reference that goes further",
            )
        finer = self
        if not np.isin(wanted, self.times).all():
            finer = _finer(self, tuple(np.union1d(self.times[: self.trusted], wanted).tolist()))
        index = np.searchsorted(finer.times, wanted)
        if np.any(index >= finer.trusted):
            raise ReferenceRefused(
                f"no states of {self.problem.name!r} at these times: they are trusted before "
                f"t = {finer.horizon:g} only ({finer.certificate.horizon_reason}). Ask for less "
                "accuracy, or for earlier times."
            )
        return finer, index


@functools.lru_cache(maxsize=4)
def _finer(known: Reference, times: tuple[float, ...]) -> Reference:
    return rooms_above.references().solved_again(known, np.array(times))


@json_shows(
    *(f"reference.certificate.{name}" for name in ("level", "solver", "rtol", "atol", "steps")),
    *(f"reference.certificate.{name}" for name in ("stiff", "witnesses", "sampling")),
    *("drift_max", "bound_max"),
    *(f"reference.certificate.{name}" for name in ("accuracy", "horizon", "horizon_reason")),
    "reference.certificate.versions",
)
@dataclasses.dataclass(frozen=True, eq=False)
class ReferenceInNorm:
    """What errors are measured against.

    Arguments:
        reference: with its certificate.
        norm: in which they are measured.
    """

    reference: Reference
    norm: Norm

    @property
    def drift_max(self) -> dict[str, float]:
        """How far the trusted samples violate constraints, by quantity; empty if there are none."""
        inside = slice(self.reference.trusted)
        drift = self.reference.certificate.drift.items()
        return {quantity: float(np.max(series[inside])) for quantity, series in drift}

    @property
    def bound_max(self) -> float:
        """The largest estimated bound of the norm's quantity: that at the last trusted sample."""
        return float(self.reference.bound(self.norm)[-1])


def problem_of(problem: Problem | Reference) -> Problem:
    """The problem itself, or the problem that a reference solves.

    Raises:
        InputError: it is neither.
    """
    if isinstance(problem, Reference):
        return problem.problem
    require_problem(problem)
    return problem
