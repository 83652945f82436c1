"""What is wrong with the program that computes the positions in files, in words."""

from __future__ import annotations

from typing import Any

import numpy as np

from ropeode.checking.diagnosis.methods import MISTAKEN
from ropeode.checking.diagnosis.programs import (
    KEPT,
    Changed,
    Program,
    Runs,
    Wrong,
    programs_of,
    unforced_nodes,
)
from ropeode.checking.diagnosis.rope_forces import has_rope_forces
from ropeode.checking.report import Diagnosis
from ropeode.checking.simple_numbers import shortest
from ropeode.checking.trajectories.known_methods import of_the_motion
from ropeode.problems import Problem
from ropeode.study import problem_class
from ropeode.theory.terms import FACTORS, TERMS, by_power, known_mistakes, said
from ropeode.validation import listed, numbered

# How precisely a number is found, as a part of itself and of the right one.
_PRECISION = 1e-7
# With a larger spread, as a part of itself and of the right one, nothing is said but the number.
_LARGEST_SPREAD = 1e-2
_SCALE = TERMS["kept"].remedy
_PER_STEP = "{}, however long the step is, so that the runs have no limit as dt goes to 0"
_ADDED = "are never set to zero: each step adds those of all steps before"
# The cause and the words of changes that are the same for all steps; `{}` is the value. Others are
# said by their term, value and power of dt.
_MISTAKES: dict[tuple[str, ...], tuple[str, str, str]] = {
    **{
        terms: ("damping-per-step", _PER_STEP.format(f"each step {words}"), _SCALE)
        for terms, words in (
            *(((name,), "keeps {} of the velocity") for name in KEPT),
            (("kept", "all"), "multiplies the new velocity by {}"),
        )
    },
    **{
        terms: ("forces-add-up", f"{forces} {_ADDED}", TERMS["old_forces"].remedy)
        for terms, forces in (
            (("old_forces", "old_gravity"), "the forces"),
            (("old_forces",), "the forces of springs"),
        )
    },
}


def diagnose_program(
    problem: Problem, runs: Runs, truth: np.ndarray, changes: int = 1
) -> Diagnosis | None:
    """Name the program whose positions are those in files, with its mistake if it has one.

    Arguments:
        problem: that it should solve.
        runs: step size and states of each; not-a-number from where it diverged.
        truth: the right states, ``(times, *state)``.
        changes: as for `programs_of`.

    Returns:
        The cause `method` if nothing is wrong in the program; None if no program that is known
        computes the positions.
    """
    still, drifting = unforced = unforced_nodes(problem, runs, truth)
    fixed = _fixed(still, drifting)
    programs = programs_of(problem, runs, unforced, changes)
    if not programs:
        if fixed is None:
            return None
        return Diagnosis(fixed.cause, fixed.words, {"nodes": still + drifting}, fixed.remedy)
    if fixed is not None:
        programs = [each._replace(wrong=(fixed, *each.wrong)) for each in programs]
    program, *others = programs
    if _terms(program) == ["damping"]:
        # Any damping can be said as a further one.
        others = [each for each in others if _terms(each) != ["further"]]
    same = f"{of_the_motion(program.misfit)}, over the first {program.frames} frames"
    if program.alike and program.is_right:
        evidence = {"methods": [*program.alike], "misfit": program.misfit}
        words = (
            f"the positions are those of {listed(program.alike)}, which are the same here, {same}"
        )
        return Diagnosis("method", words, evidence)
    if program.is_right:
        method, words = program.method, ""
        order = method.order_if(problem_class(problem).damped)
        if not isinstance(method.order, int):
            words = f"{method.order[0]} without damping, and {method.order[1]} with it"
        evidence = {
            "method": method.name,
            "order": order,
            "symplectic": method.symplectic,
            "misfit": program.misfit,
        }
        line = f"the positions are those of {method.name}, {same}; {_order(words or order)}"
        return Diagnosis("method", line, evidence, method.remedy)
    cause, words, remedy = _said(program, problem)
    every = dict.fromkeys([words, *(_said(each, problem)[1] for each in others)])
    words = "; or, which moves the same, ".join(every)
    evidence = {
        "method": program.method.name,
        "terms": [term for each in programs for term in _evidence(each)],
        "frames": program.frames,
        "misfit": program.misfit,
    }
    several = len(program.changes) + len(program.mistakes) > 1
    change = "these changes" if several else "this change"
    line = (
        f"{words}. With {change}, {program.method.name} reproduces the positions in the files "
        f"{same}"
    )
    return Diagnosis(cause, line, evidence, remedy)


def _terms(program: Program) -> list[str]:
    """The names of the terms that are changed."""
    return [name for change in program.changes for name in change.terms]


def _evidence(program: Program) -> list[dict[str, Any]]:
    """The terms that are changed, or known mistakes."""
    mistakes = [{"term": TERMS[e.kind].name, "mistake": e.words} for e in program.mistakes]
    changes = [
        term_found(name, found=[*change.found.values()], dts=[*change.found])
        for change in program.changes
        for name in change.terms
    ]
    return mistakes + changes


def term_found(name: str, **found: Any) -> dict[str, Any]:
    """A term as evidence: what it should be, and what was found."""
    return {"term": TERMS[name].name, "expected": TERMS[name].expected, **found}


def _order(order: int | str) -> str:
    return "it does not converge" if order == 0 else f"its order is {order}"


def _fixed(still: list[int], drifting: list[int]) -> Wrong | None:
    """What is wrong where nodes have no forces."""
    words = []
    for nodes, one, several in (
        (still, "never moves, though it is", "never move, though they are"),
        (
            drifting,
            "moves on with its initial velocity, though it is",
            "move on with their initial velocities, though they are",
        ),
    ):
        if nodes:
            does = one if len(nodes) == 1 else several
            words.append(f"{numbered('node', nodes)} {does} not pinned")
    remedy = "let the loop over the nodes run from the first to the last"
    return Wrong("fixed-node", " and ".join(words), remedy) if words else None


def _said(program: Program, problem: Problem) -> Wrong:
    """All that is wrong with a program; the first cause counts where there are more."""
    mistakes = [*program.wrong]
    for known in program.mistakes:
        term = TERMS[known.kind]
        mistakes.append(Wrong("parameters", f"{term.name} {known.words}", term.remedy))
    mistakes += [_changed(each, problem) for each in program.changes]
    causes, words, remedies = zip(*mistakes, strict=True)
    # The line about what reproduces the positions names its slip.
    slip = program.method.remedy if program.method in MISTAKEN else ""
    return Wrong(causes[0], "; and ".join(words), "; ".join(filter(None, (*remedies, slip))))


def _changed(change: Changed, problem: Problem) -> Wrong:
    """What is wrong where terms have another value."""
    values, exponent, name = np.array([*change.found.values()]), change.power, change.terms[0]
    value, term = float(values[0]), TERMS[name]
    if exponent == 0.0:
        size = max(abs(value), abs(term.expected))
        value = shortest(value, max(float(np.ptp(values)), _PRECISION * size))
        if change.terms in _MISTAKES:
            cause, words, remedy = _MISTAKES[change.terms]
            return Wrong(cause, words.format(f"{value:g}"), remedy)
        return Wrong("parameters", wrong_term(problem, name, value), term.remedy)
    assert exponent is not None
    if name in KEPT:
        rate, what = (1.0 - value) / next(iter(change.found)), "rate"
        if has_rope_forces(problem):
            rate, what = rate * float(np.mean(problem.args.mass)), "coefficient"
        words = f"there is a further damping, of {what} {rate:.4g}"
        return Wrong("parameters", words, TERMS["further"].remedy)
    if exponent < 0.0 and "damping" in term.name:
        words = _PER_STEP.format(f"{term.name} acts once per step")
        return Wrong("damping-per-step", words, _SCALE)
    return Wrong("step-size", by_power(name, exponent), term.remedy)


def wrong_term(problem: Problem, name: str, value: float, spread: float = _PRECISION) -> str:
    """A sentence: what is wrong with a term that has this value.

    Arguments:
        problem: whose numbers may explain it.
        name: of the term.
        value: its factor, or its coefficient if there should be no such term.
        spread: by how much the value may be off.
    """
    term, size = TERMS[name], max(abs(value), TERMS[name].expected)
    if spread > _LARGEST_SPREAD * size:
        number = f"{value:.2g} (± {spread:.1g})"
        if term.expected == 0.0:
            return f"there is {term.name}, of coefficient {number}"
        return f"{term.name} is {number} times what it should be"
    words = said(name, value)
    if term.expected == 0.0 or value in FACTORS.values() or not has_rope_forces(problem):
        return words
    kind = {"forces": "mass"}.get(name, name)
    known = [
        each.words
        for each in known_mistakes(problem.args)
        if each.kind == kind and each.number is not None
        if abs(each.number - value) <= max(spread, _PRECISION * size)
    ]
    return f"{words} (perhaps it {known[0]})" if known else words
