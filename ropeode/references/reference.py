"""A trajectory that can be trusted, with the certificate that says how far."""

from __future__ import annotations

import dataclasses
from typing import Any, get_args, overload

import numpy as np

from ropeode.errors import InputError, ReferenceRefused
from ropeode.norms import Norm, distance, norm_for
from ropeode.problems.ensemble import Ensemble
from ropeode.problems.problem import Problem
from ropeode.references.certificate import Certificate, Level
from ropeode.references.dense.polynomials import Dense
from ropeode.references.ladder import Progress
from ropeode.validation import check_positive, complaint, unknown

SMALLEST_RTOL = 1e-13
LARGEST_RTOL = 1e-3
RELATIVE_ACCURACY = 1e-8
# At the level `extended`: float64 has 16 digits, and two to spare.
DIGITS = 18
TIME_LIMIT = 60.0
# Of the initial state's scale; what hardly moves cannot be known to 1e-8 of its motion.
FINEST_ACCURACY = 1e-12


@dataclasses.dataclass(frozen=True, eq=False)
class Reference:
    """A reference trajectory.

    Arguments:
        problem: what was solved.
        states: ``(times, *state)`` at the problem's sample times; only the first
            `certificate.trusted` of them are inside the trust horizon.
        certificate: how far it can be trusted, and why.
        dense: the states at all times between; None where they were not asked for.
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

    def bound(self, norm: Norm | None = None) -> np.ndarray:
        """The estimated error bound at each sample inside the horizon, ``(trusted,)``.

        Arguments:
            norm: in which the error is measured; the bound is for the largest node, which
                no norm exceeds. By default the problem's first quantity.
        """
        quantity = (norm or norm_for(self.problem)).quantity
        return self.certificate.bounds[quantity][: self.trusted]

    def at(self, times: Any) -> np.ndarray:
        """States at any times, ``(times, *state)``; at samples the same as `states`.

        Arguments:
            times: one or several, in the problem's unit of time, in any order.

        Raises:
            InputError: the reference has no dense output, or it does not cover a time.
        """
        return self._dense().at(times)

    def bound_at(self, times: Any, norm: Norm | None = None) -> np.ndarray:
        """The estimated error bound of `at`, ``(times,)``.

        Arguments:
            times: as for `at`.
            norm: as for `bound`.

        Raises:
            InputError: the reference has no dense output, or it does not cover a time.
        """
        return self._dense().bound_at(times, (norm or norm_for(self.problem)).quantity)

    def _dense(self) -> Dense:
        if self.dense is None:
            allowed = "a reference with dense output"
            fix = "make it with reference(problem, dense=True), or --dense on the command line"
            raise InputError(complaint("dense", self.dense, allowed, fix))
        return self.dense


@overload
def reference(
    problem: Problem,
    accuracy: float | None = None,
    rtol: float | None = None,
    *,
    level: Level = "consensus",
    digits: int = DIGITS,
    time_limit: float = TIME_LIMIT,
    dense: bool = False,
    progress: Progress = lambda text: None,
) -> Reference: ...
@overload
def reference(
    problem: Ensemble,
    accuracy: float | None = None,
    rtol: float | None = None,
    *,
    level: Level = "consensus",
    digits: int = DIGITS,
    time_limit: float = TIME_LIMIT,
    dense: bool = False,
    progress: Progress = lambda text: None,
) -> list[Reference | ReferenceRefused]: ...
def reference(
    problem: Problem | Ensemble,
    accuracy: float | None = None,
    rtol: float | None = None,
    *,
    level: Level = "consensus",
    digits: int = DIGITS,
    time_limit: float = TIME_LIMIT,
    dense: bool = False,
    progress: Progress = lambda text: None,
) -> Reference | list[Reference | ReferenceRefused]:
    """Solve a problem so that the solution can be trusted, and say how far.

    The primary solver is diffrax Dopri8. It is run on a ladder of tolerances as far as
    rounding lets it; the run before the tightest is the reference. That is held against the
    other rungs, against itself from a neighbouring initial state and with steps too short to
    miss much, and against SciPy's DOP853. If the explicit solver needs too many steps the
    problem counts as stiff, and the solvers are diffrax Kvaerno5 and SciPy's Radau.

    At the level `extended` it is solved by Taylor series (heyoka) in as many digits as it
    takes, twice; see `ropeode.references.extended.solution`.

    Of an ensemble each member has its own reference; see
    `ropeode.references.ensemble.each_reference`, which gives one after the other.

    Arguments:
        problem: what to solve, or an ensemble of problems.
        accuracy: the largest error bound that is still trusted, in the units of the positions
            (of the state, for a problem that is not mechanical); by default 1e-8 (or 1e4 times
            `rtol`, if that is given and more) of how far a node (or component) moves.
        rtol: relative tolerance of the reference; by default as tight as gains anything. The
            absolute tolerance is `rtol` times the largest component of the initial state.
        level: `consensus` of float64 solvers, or `extended` precision, which needs heyoka.
        digits: to which two runs in extended precision are to agree.
        time_limit: in seconds, for all runs in extended precision.
        dense: whether the states between the samples are to be known as well; see
            `ropeode.references.dense.dense_output`.
        progress: called with a few words before each run.

    Returns:
        The reference; of an ensemble a list with, for each member, its reference or the
        `ReferenceRefused` that says why it has none.

    Raises:
        InputError: an argument cannot be used.
        ReferenceRefused: not even the first sample can be trusted; says why.
    """
    if isinstance(problem, Ensemble):
        # Not above: that module builds on this one.
        from ropeode.references.ensemble import each_reference

        return list(
            each_reference(
                problem,
                accuracy,
                rtol,
                level=level,
                digits=digits,
                time_limit=time_limit,
                dense=dense,
                progress=progress,
            )
        )
    if dense:
        # Not above: that module builds on this one.
        from ropeode.references.dense.dense_output import with_dense_output

        known = reference(
            problem,
            accuracy,
            rtol,
            level=level,
            digits=digits,
            time_limit=time_limit,
            progress=progress,
        )
        return with_dense_output(known, time_limit=time_limit, progress=progress)
    if level not in get_args(Level):
        raise InputError(unknown("level", level, get_args(Level)))
    if level == "extended":
        # Not above: that module builds on this one, and heyoka is an extra.
        from ropeode.references.extended.reference import extended_reference

        return extended_reference(
            problem, accuracy, rtol, digits=digits, time_limit=time_limit, progress=progress
        )
    # Not above: that module builds on this one.
    from ropeode.references.consensus import consensus_reference

    return consensus_reference(problem, *checked(accuracy, rtol), progress=progress)


def checked(accuracy: float | None, rtol: float | None) -> tuple[float | None, float | None]:
    """The arguments of `reference` as numbers, where they are given.

    Raises:
        InputError: one of them cannot be used.
    """
    if accuracy is not None:
        accuracy = check_positive("accuracy", accuracy, example="1e-6")
    if rtol is not None:
        rtol = check_positive("rtol", rtol, example="1e-12")
        if not SMALLEST_RTOL <= rtol <= LARGEST_RTOL:
            raise InputError(
                complaint(
                    "rtol",
                    rtol,
                    f"from {SMALLEST_RTOL:g} (float64 carries no more) to {LARGEST_RTOL:g}",
                    f"for example rtol={SMALLEST_RTOL:g}",
                )
            )
    return accuracy, rtol


def reference_for(
    given: Problem | Reference,
    accuracy: float | None = None,
    rtol: float | None = None,
    *,
    progress: Progress = lambda text: None,
    **more: Any,
) -> Reference:
    """The reference that is given, or else that of the problem that is given.

    Arguments:
        given: a problem, or a reference of it that exists already.
        accuracy: as for `reference`; not with a reference.
        rtol: as for `reference`; not with a reference.
        progress: as for `reference`.
        more: `level`, `digits`, `time_limit` and `dense` of `reference`.

    Raises:
        InputError: an argument cannot be used.
        ReferenceRefused: no reference can be had.
    """
    if not isinstance(given, Reference):
        return reference(given, accuracy, rtol, progress=progress, **more)
    faults = [
        complaint(name, value, "none with a reference that exists already", "leave one of them out")
        for name, value in (("accuracy", accuracy), ("rtol", rtol))
        if value is not None
    ]
    if faults:
        raise InputError(faults)
    return given


def problem_of(given: Problem | Reference) -> Problem:
    """The problem that is given, or that of the reference that is given."""
    return given.problem if isinstance(given, Reference) else given


def motion(problem: Problem, states: np.ndarray, norm: Norm | None = None) -> np.ndarray:
    """How far any node (or component) has got from where it started, up to each sample.

    This is the size against which an error is large or small; unlike the size of the state
    it does not change when the whole problem is moved. At least 1e-8 of the state's scale.

    Arguments:
        problem: whose motion it is.
        states: ``(times, *state)``.
        norm: by default the problem's first.
    """
    start = np.broadcast_to(problem.y0, states.shape)
    apart = distance(problem, norm or norm_for(problem), states, start)
    farthest = np.maximum.accumulate(apart)
    return np.maximum(farthest, 1e-8 * problem.scale)
