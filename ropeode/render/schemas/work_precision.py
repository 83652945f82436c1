"""The JSON form of work-precision studies."""

from __future__ import annotations

from typing import Literal, TypedDict

from ropeode.render.schemas.accuracy_table import ProblemForm, ReferenceForm
from ropeode.study.work_precision import Cost, CostToReach, WorkRow


class FrontRunForm(TypedDict):
    """A run on a Pareto front.

    Fields:
        method: as in `rows`.
        effort: as in `rows`.
    """

    method: str
    effort: float


class CostAxisForm(TypedDict):
    """What is best where one kind of cost counts, against `error_max`.

    Fields:
        cost: `seconds`, `rhs_evaluations` or `steps`.
        front: the certified runs that no other one beats, from cheap to costly.
        costs_to_reach: what each error costs with each method.
    """

    cost: Cost
    front: list[FrontRunForm]
    costs_to_reach: list[CostToReach]


class WorkPrecisionForm(TypedDict):
    """Errors of methods, and what they cost: `ropeode work-precision --format json`.

    Fields:
        schema: name and version of this form.
        problem: what was solved: up to the trust horizon of the reference.
        norm: name of the norm.
        reference: what the errors are measured against.
        resolution: below which an error is unresolved: ten times the reference's estimated bound.
        energy_resolution: the same for errors of the energy; null where the problem has none.
        run_limit: seconds that a run might take.
        rounds: how often each run was timed.
        rows: one for each method and effort, those of a method from cheap to costly.
        costs: one for each kind of cost.
    """

    schema: Literal["ropeode.work-precision/1"]
    problem: ProblemForm
    norm: str
    reference: ReferenceForm
    resolution: float
    energy_resolution: float | None
    run_limit: float
    rounds: int
    rows: list[WorkRow]
    costs: list[CostAxisForm]
