"""What a file of a reference must hold: the one model that all of it is checked by."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from ropeode.arrays import real_array
from ropeode.references.certificate import Level, Role, Sampling
from ropeode.validation import MOST_COUNTED, cut

PROBES = 3
_Count = Annotated[int, Field(ge=0, le=MOST_COUNTED)]
_Error = Annotated[float, Field(ge=0.0)]
_SolverName = Annotated[str, Field(pattern=r"^[\w-]+ [\w-]+(, \d{1,4} bits)?$")]
_Quantities = tuple[Literal["state"]] | tuple[Literal["position"], Literal["velocity"]]


def _tolerances(value: Any) -> np.ndarray:
    tolerances = real_array("atol", value, "1e-20")
    if np.any(tolerances < 0.0):
        raise ValueError("numbers >= 0")
    return tolerances


class _Text(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Description(_Text):
    """The text `problem`."""

    name: str
    parameters: dict[str, Any]
    jump_times: tuple[float, ...]
    samples: _Count
    quantities: _Quantities
    constrained: tuple[Literal["state", "position", "velocity"], ...]
    # Files of older releases lack these two.
    node_axis: Literal[0, 1] | None = None
    tree: str | None = None


class WitnessClaims(_Text):
    """A witness in the text `certificate`."""

    solver: _SolverName
    tolerance: _Error
    role: Role
    steps: _Count
    seconds: _Error
    # JSON has no infinity, which is that of a run that ends inside the horizon.
    difference: _Error | None


class Claims(_Text):
    """The text `certificate`."""

    level: Level
    solver: _SolverName
    rtol: _Error
    atol: Annotated[float | list[Any], AfterValidator(_tolerances)]
    steps: _Count
    accuracy: _Error
    trusted: Annotated[int, Field(ge=1)]
    horizon: float | None
    horizon_reason: str | None
    witnesses: Annotated[tuple[WitnessClaims, ...], Field(min_length=1)]
    stiff: bool
    seconds: _Error
    compile_seconds: _Error
    versions: dict[str, str]
    # Files of older releases have none.
    sampling: Sampling | None = None


def parsed(
    texts: Mapping[str, str], arrays: Mapping[str, np.ndarray]
) -> tuple[Description, Claims]:
    """The texts of a file, after they and its arrays have been checked.

    Raises:
        ValueError: one of them is not as it must be.
    """
    try:
        problem = Description.model_validate_json(texts.get("problem", ""), strict=True)
        claims = Claims.model_validate_json(texts.get("certificate", ""), strict=True)
    except ValidationError as error:
        faults = error.errors(include_url=False)
        lines = [f"{'.'.join(map(str, each['loc']))}: {each['msg'].lower()}" for each in faults]
        raise ValueError(f"in the text of its {error.title}, {cut('; '.join(lines))}") from None
    _check(problem, claims, arrays)
    return problem, claims


def _check(problem: Description, claims: Claims, arrays: Mapping[str, np.ndarray]) -> None:
    """See that the arrays have the shapes and the numbers that texts speak of."""

    def need(holds: Any, name: str, words: str) -> None:
        if not np.all(holds):
            raise ValueError(f"{name}: {words}")

    def array(name: str, *shape: int | None) -> np.ndarray:
        """An array of some shape; None stands for any length but 0."""
        found = arrays.get(name, np.empty(0))
        fits = found.ndim == len(shape) and all(
            length in (given, None) and given
            for given, length in zip(found.shape, shape, strict=True)
        )
        need(name in arrays and fits, name, f"numbers of the shape {shape}")
        return found

    def increasing(name: str) -> int:
        times = array(name, None)
        need(np.isfinite(times), name, "finite numbers")
        need(np.diff(times) > 0.0, name, "increasing times")
        return len(times)

    count, start = increasing("time"), arrays.get("initial_state", np.empty(0))
    need(start.size > 0 and np.isfinite(start).all(), "initial_state", "finite numbers")
    shape, first = start.shape, problem.quantities[0]
    if first == "position":
        shape = array(first, count, None, None).shape[1:]
        fits = start.shape[:1] == (2,) and start.size == 2 * math.prod(shape)
        fits &= start.ndim < 3 or sorted(start.shape[1:]) == sorted(shape)
        need(fits, "initial_state", "that of the positions and the velocities")
    if "node_axis" in problem.model_fields_set:
        needed = "one axis where there are positions, none elsewhere"
        need((first == "position") == (problem.node_axis is not None), "node_axis", needed)
    need(problem.samples <= count, "samples", f"at most {count}, as there are times")
    need(claims.trusted <= problem.samples, "trusted", f"at most {problem.samples} samples")
    horizon = None if claims.trusted == count else arrays["time"][claims.trusted]
    need(claims.horizon == horizon, "horizon", f"{horizon}, the first time that is not trusted")
    need(
        np.shape(claims.atol) in ((), start.shape), "atol", "one number, or one for each component"
    )
    need(np.isfinite(array("probe_state", PROBES, start.size)), "probe_state", "finite numbers")
    array("probe_rate", PROBES, start.size)
    for quantity in problem.quantities:
        states = array(quantity, count, *shape)[: problem.samples]
        need(np.isfinite(states), quantity, "finite numbers at all samples")
        witnesses = array(series_name("witness_difference", quantity), len(claims.witnesses), count)
        series = [witnesses, array(series_name("bound", quantity), count)]
        if quantity in problem.constrained:
            series.append(array(series_name("drift", quantity), count)[: problem.samples])
        # A run that did not arrive is infinitely far.
        need(all((each >= 0.0).all() for each in series), quantity, "bounds and distances >= 0")


def series_name(series: str, quantity: str) -> str:
    """`bound` is that of positions, or of the state; that of velocities is `velocity_bound`."""
    return f"velocity_{series}" if quantity == "velocity" else series
