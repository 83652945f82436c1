"""The lab in a cell of a notebook."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from ropeode.errors import InputError
from ropeode.laboratory.asks import DEFAULT_LADDER, MOST_STEPPERS
from ropeode.laboratory.messages import OwnStepper
from ropeode.laboratory.setup import Laboratory, Own, chosen, first_steppers, opened_with
from ropeode.norms import norm_for
from ropeode.problems import Problem
from ropeode.progress import Progress, bar, shows_progress
from ropeode.references import Reference
from ropeode.steppers import Stepper, as_stepper
from ropeode.study import AccuracyTable, check_steps, chosen_steppers
from ropeode.validation import bad_value, check_whole, require

if TYPE_CHECKING:
    from ropeode.laboratory.widget import Lab

_HEIGHT = 720
# Of the page.
_MOST_RUNGS, _MOST_STEPS = 32, 2**16


@shows_progress
def lab(
    problem: str | Problem | Reference | AccuracyTable = "rope",
    steppers: Any = None,
    steps_per_frame: ArrayLike | None = None,
    *,
    height: int = _HEIGHT,
    progress: Progress = bar,
) -> Lab:
    """Show motion and true error side by side, in a cell of a notebook.

    What the cell shows is the page of ``ropeode lab``: steppers move beside a certified reference,
    and each press of ``=`` adds a point to the plot of error against step size. It is computed
    for up to two presses of ``-`` and five of ``=``, and plays in the saved notebook; while the
    kernel runs, everything else can be chosen, too.

    Arguments:
        problem: what moves: a problem, its reference, or an accuracy table, whose reference and
            runs the page begins with; or a text, as ``--problem`` of ``ropeode table`` takes it.
        steppers: a list of up to five of whatever `ropeode.as_stepper` takes; by default the
            first five of the table, or those that a newcomer sees first.
        steps_per_frame: of the runs that the order plot begins with; the page plays the first. By
            default those of the table, or 16.
        height: of the page, in pixels.
        progress: called with what is being done and the fraction that is done.

    Returns:
        A widget, for JupyterLab, marimo and others. Its ``export("lab.html")`` writes the page to
        a file that plays without Python.

    Raises:
        InputError: one line for each argument that cannot be used, or anywidget is missing
            (the extra ``lab``).
        UserCodeError: a step of the user's own raised.
        ReferenceRefused: no reference can be had for the problem.

    Examples:
        >>> from ropeode import Rope, lab
        >>> lab(Rope(num_nodes=4).problem(frames=3), ["rk4"], [16])
        <Lab: rope; rk4>
    """
    require("anywidget", "lab", "labs in notebooks")
    # Not above: it needs anywidget.
    from ropeode.laboratory.widget import Lab

    pixels = check_whole("height", height, at_least=200, example=str(_HEIGHT))
    ladder: Any = DEFAULT_LADDER
    if isinstance(problem, AccuracyTable):
        table, problem = problem, problem.reference
        _check_norm(table)
        ladder = {row.steps_per_frame for row in table.rows}
        steppers = _of_table(table) if steppers is None else steppers
    rungs = _check_ladder(ladder if steps_per_frame is None else steps_per_frame)
    given, choice = opened_with(problem) if isinstance(problem, str) else chosen(problem)
    laboratory = Laboratory(given)
    shown = laboratory.problem(choice)
    if steppers is None:
        steppers = list(first_steppers(shown))
    names, laboratory.own = _named(chosen_steppers(shown, steppers), laboratory)
    for name, own in laboratory.own.items():
        laboratory.method(shown, name, own.facts.version)
    link = {
        "problem": choice.model_dump(mode="json"),
        "steppers": names,
        "ladder": rungs,
        "steps": rungs[0],
    }
    return Lab(laboratory, link, pixels, progress)


def _check_norm(table: AccuracyTable) -> None:
    """Raises:
    InputError: the table's errors are measured in a norm that the lab does not use.
    """
    usual = norm_for(table.problem)
    if table.norm != usual:
        allowed = f"a table in the norm {usual.name!r}, in which the lab measures errors"
        raise bad_value("table", table.norm.name, allowed, "make it without norm=")


def _of_table(table: AccuracyTable) -> list[str]:
    """The first of its steppers.

    Raises:
        InputError: one of them is none of ropeode's, and only its name is known.
    """
    names = list(dict.fromkeys(row.stepper for row in table.rows))[:MOST_STEPPERS]
    for name in names:
        try:
            as_stepper(name)
        except InputError:
            allowed = "a table of steppers that ropeode knows by name"
            raise bad_value(
                "table", name, allowed, "pass your steppers: lab(table, [step])"
            ) from None
    return names


def _check_ladder(given: Any) -> list[int]:
    """Steps per frame, in increasing order.

    Raises:
        InputError: they cannot be used, or the page cannot show them.
    """
    steps = sorted(check_steps(given))
    if len(steps) > _MOST_RUNGS or steps[-1] > _MOST_STEPS:
        allowed = f"at most {_MOST_RUNGS} numbers of at most {_MOST_STEPS} in the lab"
        raise bad_value("steps_per_frame", given, allowed, "use accuracy_table for more")
    return steps


def _named(steppers: Sequence[Stepper], laboratory: Laboratory) -> tuple[list[str], dict[str, Own]]:
    """Steppers by the names that the page uses, and those of the user's own.

    Raises:
        InputError: they are too many.
    """
    if len(steppers) > MOST_STEPPERS:
        allowed = f"at most {MOST_STEPPERS}, which can be told apart"
        raise bad_value("steppers", f"{len(steppers)} steppers", allowed, "show fewer at once")
    own = {}
    for each in steppers:
        try:
            known = laboratory.stepper(each.label, None) == each
        except InputError:
            known = False
        if not known:
            facts = OwnStepper(name=each.label, version="given", fault=None, line=None)
            own[each.label] = Own(facts, each)
    return [each.label for each in steppers], own
