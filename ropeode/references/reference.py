"""A trajectory that can be trusted, with the certificate that says how far."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from ropeode.display import Sampled
from ropeode.json_form import json_shows
from ropeode.norms import Norm, norm_for
from ropeode.problems import Problem, require_problem
from ropeode.references.certificate import Certificate
from ropeode.references.dense.polynomials import Dense
from ropeode.validation import bad_value


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Reference(Sampled):
    """A reference trajectory.

    Arguments:
        problem: what was solved.
        states: ``(times, *state)`` at the problem's sample times; only the first
            `certificate.trusted` of them are inside the trust horizon.
        certificate: how far it can be trusted, and why.
        dense: the states between the samples as well; None where there is no dense output.

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
    dense: Dense | None = None

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
        """States at any times; at samples the same as `states`.

        Arguments:
            times: one or several, in the problem's unit of time, in any order.

        Returns:
            ``(times, *state)``; of a single time one state.

        Raises:
            InputError: the reference has no dense output, or it does not cover a time.

        Examples:
            >>> from ropeode import Rope, reference
            >>> truth = reference(Rope(num_nodes=4).problem(frames=3), dense=True)
            >>> truth.at([0.5, 1.5]).shape
            (2, 2, 2, 4)
            >>> truth.at(1.5)[0, 1].round(6)
            array([200.      , 198.880646, 198.880604, 198.880604])
        """
        states = self._dense().at(times)
        return states if np.ndim(times) else states[0]

    def bound_at(self, times: Any, norm: Norm | str | None = None) -> np.ndarray:
        """The estimated error bound of `at`, ``(times,)``; a single number for a single time.

        Arguments:
            times: as for `at`.
            norm: as for `bound`.

        Raises:
            InputError: the reference has no dense output, or it does not cover a time, or the
                norm is as for `bound`.

        Examples:
            >>> from ropeode import Rope, reference
            >>> truth = reference(Rope(num_nodes=4).problem(frames=3), dense=True)
            >>> truth.bound_at([0.5, 1.5]) < 1e-9
            array([ True,  True])
        """
        bounds = self._dense().bound_at(times, norm_for(self.problem, norm).quantity)
        return bounds if np.ndim(times) else bounds[0]

    def _dense(self) -> Dense:
        if self.dense is None:
            allowed = "a reference with dense output"
            fix = "make it with reference(problem, dense=True), or --dense on the command line"
            raise bad_value("dense", self.dense, allowed, fix)
        return self.dense


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
