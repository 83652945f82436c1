"""The JSON form of explanations of steppers."""

from __future__ import annotations

from typing import Any, Literal, NotRequired, TypedDict

from ropeode.render.schemas.accuracy_table import AccuracyTableForm, ConstantForm, ProblemForm
from ropeode.study.explanation import Part
from ropeode.theory.structure import Property


class DefectForm(TypedDict):
    """What is wrong at dt = 0, by quantity, and in words where these are known.

    Fields:
        position: the part in positions, of a mechanical problem.
        velocity: the part in velocities, of a mechanical problem.
        state: the part in the state, of any other problem.
        sentence: what the step does instead; null where nothing is wrong, or nobody can say.
        coefficients: the numbers behind the sentence; null likewise.
    """

    position: NotRequired[Part]
    velocity: NotRequired[Part]
    state: NotRequired[Part]
    sentence: str | None
    coefficients: dict[str, Any] | None


class ClassForm(TypedDict):
    """The order on a class of problems.

    Fields:
        damped: the acceleration contains damping.
        at_rest: all initial velocities are zero.
        rigid: nodes are joined by rigid links.
        own: whether the explained problem is one of them.
        local: read off single steps; null where rounding hides it.
        at_least: up to this order, it is certain that there is no error.
        declared: by the stepper; null where it declares nothing.
    """

    damped: bool
    at_rest: bool
    rigid: bool
    own: bool
    local: int | None
    at_least: int
    declared: int | None


class OrdersForm(TypedDict):
    """The order by theory, in runs, and as it is declared.

    Fields:
        local: read off single steps; null where rounding hides it.
        at_least: up to this order, it is certain that there is no error.
        observed: in runs; null if undetermined.
        declared: by the stepper; null where it declares nothing.
        by_quantity: local order of positions and velocities, or of the state.
        classes: on each class of problems.
    """

    local: int | None
    at_least: int
    observed: float | None
    declared: int | None
    by_quantity: dict[str, int | None]
    classes: list[ClassForm]


class ConstantsForm(ConstantForm):
    """The error constant in the first norm, and in all.

    Fields:
        by_norm: the constant in each norm.
    """

    by_norm: dict[str, ConstantForm]


class StabilityForm(TypedDict):
    """How short steps have to be; null where that is not known.

    Fields:
        predicted: steps per frame along the solution, by the stability function.
        measured: steps per frame from which on runs do not blow up.
        predicted_dt: the longest step along the solution, by the stability function.
        predicted_at_rest: steps per frame about the equilibrium, by the stability function.
        measured_at_rest: the same, by the derivative of the stepper's own step.
        imaginary_axis: the limit of dt omega for a mode that swings.
        real_axis: the limit of dt lambda for a mode that decays.
        notes: why something is missing.
    """

    predicted: int | None
    measured: int | None
    predicted_dt: float | None
    predicted_at_rest: int | None
    measured_at_rest: int | None
    imaginary_axis: float | None
    real_axis: float | None
    notes: list[str]


class EnergyForm(TypedDict):
    """How far the energy of a symplectic step swings along a run.

    Fields:
        order: p, of the correction dt^p H_p.
        steps_per_frame: of the run.
        frames: of the run.
        predicted: swing by the leading correction.
        measured: swing of the energy H.
        ratio: `measured` over `predicted`; null where nothing is predicted to swing.
        modified: swing of the corrected energy H + dt^p H_p.
    """

    order: int
    steps_per_frame: int
    frames: int
    predicted: float
    measured: float
    ratio: float | None
    modified: float


class DifferenceForm(TypedDict):
    """How far the steps of another stepper are.

    Fields:
        name: of the other stepper, with its options.
        largest: difference of the states after up to three steps, relative to their size.
        power: of dt, with which the difference of one step falls; null where that does not show.
        same: whether rounding explains the difference.
    """

    name: str
    largest: float
    power: float | None
    same: bool


class ExplanationForm(TypedDict):
    """What one step does, and the errors that follow from it: `ropeode explain`.

    Fields:
        schema: name and version of this form.
        stepper: with the options that are not defaults.
        problem: that it is explained on.
        identity_defect: what a step of dt = 0 changes.
        rhs_defect: by how much the rate of change differs from the right-hand side.
        local_error: by quantity, the coefficient of dt^(order + 1); null where the order is below 1
            or not known.
        one_step: false where the step has memory.
        order: by theory and in runs.
        error_constant: in the first norm, and in all.
        stability: how short steps have to be.
        structure: by property of the exact solution, whether the step has it; or one text that says
            why there is nothing to say.
        modified_energy: of a symplectic step; or one text that says why it is not known; null where
            the step is not symplectic, or keeps the energy.
        method: what the step is by its coefficients, in a sentence.
        equal_to: steppers of ropeode with the same steps.
        compared_with: the stepper that was named for comparison; null if none was.
        tables: by norm, the accuracy table of the runs.
    """

    schema: Literal["ropeode.explain/1"]
    stepper: str
    problem: ProblemForm
    identity_defect: DefectForm
    rhs_defect: DefectForm
    local_error: dict[str, Part | None]
    one_step: bool
    order: OrdersForm
    error_constant: ConstantsForm
    stability: StabilityForm
    structure: dict[str, Property] | str
    modified_energy: EnergyForm | str | None
    method: str
    equal_to: list[DifferenceForm]
    compared_with: DifferenceForm | None
    tables: dict[str, AccuracyTableForm]
