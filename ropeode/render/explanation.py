"""The explanation of a stepper: what one step does, and what follows."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from typing import Any

from ropeode.analysis import AGREE
from ropeode.problems import Problem
from ropeode.render import table_words
from ropeode.render.markup import Block, Grid, Heading, Paragraph, Section
from ropeode.render.results import blocks, line, rows
from ropeode.study import ClassOrder, Explanation, LocalStep, Part
from ropeode.theory import (
    SOLVES_ANOTHER,
    LinearStability,
    ModifiedEnergy,
    Property,
    StabilityLimits,
    StableInterval,
    StepDifference,
)
from ropeode.validation import listed

# Of the swing of the energy, what may be left where its leading correction explains it.
_KEPT = 0.1
_STABILITY = ("disturbances", "predicted", "dt", "measured")
_STRUCTURE = ("property", "kept", "defect", "falls like", "at dt")
_HOLDS = {True: "yes", False: "no", None: "-"}
_PLURAL = {"position": "positions", "velocity": "velocities", "state": "the state"}
_IN_RUNS = {"does not converge": "none"}
_LOCAL = ("quantity", "order", "change at dt = 0", "rate - f", "largest at")
_ORDERS = ("problems", "local", "observed", "declared")
_CONSTANTS = ("error", "p", "C predicted", "C measured", "at", "ratio", "10% from", "1% from")


@line.register
def _(explanation: Explanation) -> str:
    local = explanation.orders[0].local
    observed = table_words.observed_words(explanation.tables[0].orders[0].order)
    local_words = "not known" if local is None else str(local) if local > 0 else "none"
    return f"{_title(explanation)}; local order {local_words}, observed {observed}"


@blocks.register
def _(explanation: Explanation) -> list[Block]:
    remark = table_words.order_remark(explanation.tables[0].orders[0])
    return [
        Heading(_title(explanation)),
        *([Paragraph(_sentence(remark))] if remark is not None else []),
        Paragraph(_summary(explanation)),
        *(Paragraph(words) for words in _likeness_words(explanation)),
        Section("One step"),
        Paragraph(" ".join(_step_words(explanation.local))),
        _local_grid(explanation),
        Section("Order"),
        *_order_blocks(explanation),
        Section("Error constant"),
        *_constant_blocks(explanation),
        Section("Stability"),
        *_stability_blocks(explanation.stability),
        Section("Structure"),
        *_structure_blocks(explanation.structure),
        *(Paragraph(words) for words in _energy_words(explanation.modified)),
        Paragraph(table_words.reference_words(explanation.tables[0])),
    ]


def _title(explanation: Explanation) -> str:
    return f"{explanation.stepper}: {table_words.problem_words(explanation.problem)}"


def _summary(explanation: Explanation) -> str:
    """The order in theory, in runs, and as it is declared; and what to change, if that is known."""
    local, declared = explanation.local, explanation.orders[0].declared
    if local.order is None and local.at_least < 1:
        words = "Its order in theory is hidden by rounding"
    elif local.order is None:
        words = f"In theory its order on this problem is {local.at_least} or higher"
    elif local.order > 0:
        words = f"In theory its order on this problem is {local.order}"
    elif local.order == 0:
        words = "It solves another equation"
    else:
        words = "It solves no differential equation"
    orders = {
        _PLURAL[table.norm.quantity]: _IN_RUNS.get(words, words)
        for table in explanation.tables
        for words in [table_words.observed_words(table.orders[0].order)]
    }
    seen = listed(f"{order} in {quantity}" for quantity, order in orders.items())
    if len({*orders.values()}) == 1:
        seen = next(iter(orders.values()))
    words += f"; in its runs its order is {seen}."
    if declared is not None:
        words += f" It declares {f'order {declared}' if declared else 'no order'}."
    remedy = "" if local.wrong is None else local.wrong.remedy
    return f"{words} Fix: {remedy}." if remedy else words


def _step_words(local: LocalStep) -> list[str]:
    """What one step does, sentence by sentence."""
    words = [_identity_words(local)]
    if local.order is None or local.order > -1:
        words.append(_rate_words(local))
    words += _order_words(local)
    if not local.one_step:
        words.append("The step has memory: all this holds for what it does after its own start.")
    short, long = local.longest
    lengths = f"{long:.2g}" if f"{short:.2g}" == f"{long:.2g}" else f"{short:.2g} to {long:.2g}"
    along = "along the solution" if local.one_step else "like those along the solution"
    states = "1 state" if len(local.times) == 1 else f"{len(local.times)} states"
    if len(local.times) == 1:
        along += ", which may be a special one: elsewhere the order may be lower"
    words.append(f"This is read off steps at most {lengths} long, from {states} {along}.")
    return words


def _identity_words(local: LocalStep) -> str:
    if local.order != -1:
        return "At dt = 0 the step is the identity."
    words = "At dt = 0 the step is not the identity"
    if local.wrong is not None:
        return f"{words}. {_sentence(local.wrong.line.removeprefix('at dt = 0 '))}"
    changes = listed(
        f"changes {_PLURAL[each.quantity]}"
        if each.identity.factor is None
        else f"multiplies {_PLURAL[each.quantity]} by {1.0 + each.identity.factor:.7g}"
        for each in local.quantities
        if each.identity.known
    )
    return (
        f"{words}: it {changes}. It does so at every step, however short, and so it solves no "
        "differential equation."
    )


def _rate_words(local: LocalStep) -> str:
    if local.order != 0:
        return "Its rate of change there is the right-hand side f."
    off = listed(_PLURAL[each.quantity] for each in local.quantities if each.rate.known)
    cause = "No change of the problem's own terms or parameters makes up the difference."
    if local.wrong is not None:
        cause = _sentence(local.wrong.line.removeprefix(SOLVES_ANOTHER))
    return (
        "It solves another equation: at dt = 0 its rate of change differs from the right-hand "
        f"side f, in {off}. {cause}"
    )


def _sentence(words: str) -> str:
    return f"{words[0].upper()}{words[1:]}."


def _order_words(local: LocalStep) -> list[str]:
    if local.order is None:
        return [f"Rounding hides its error: the order is {local.at_least} or higher."]
    if local.order < 1:
        return []
    if local.later is None:
        begins = f"The error of a step begins with dt^{local.order + 1}"
        return [f"{begins}: the step is of order {local.order}."]
    return [
        f"Its start leaves an error of dt^{local.order}, which the steps that follow carry on: so "
        f"runs are of order {local.order}. These steps are of order {local.later} or higher by "
        "themselves."
    ]


def _local_grid(explanation: Explanation) -> Grid:
    local, headers = explanation.local, list(_LOCAL)
    known = local.order is not None and local.order >= 1
    if known:
        headers.insert(4, f"error/dt^{local.order + 1}")  # type: ignore[operator]
    kind = "component" if explanation.problem.mechanics is None else "node"
    quantities = []
    for each in local.quantities:
        shown = each.identity if local.order == -1 else each.local_error or each.rate
        row = [
            each.quantity,
            f"> {each.at_least - 1}" if each.order is None else str(each.order),
            _size(each.identity),
            _size(each.rate) if local.order != -1 else "-",
            f"{kind} {shown.index}, t = {shown.time:.4g}" if shown.known else "-",
        ]
        if known:
            row.insert(4, _size(each.local_error) if each.local_error else "-")
        quantities.append(row)
    return Grid(headers, quantities, left=frozenset({0, len(headers) - 1}))


def _size(part: Part) -> str:
    """A number if it is one, else how small it is."""
    if part.known:
        return f"{part.largest:.4g}"
    bound = max(part.largest, part.error)
    return f"< {bound:.0e}" if bound else "0"


def _likeness_words(explanation: Explanation) -> list[str]:
    """Which steppers of ropeode make the same steps, and how far the one that was named is."""
    words = []
    if (other := explanation.compared) is not None:
        words.append(_compared_words(explanation.stepper, other))
    same = [each for each in explanation.equal if each != other]
    if same:
        names = listed(each.name for each in same)
        worst = max(each.largest for each in same)
        words.append(f"Its steps equal those of {names}, {_to(worst)}.")
    words.append(explanation.method)
    return words


def _compared_words(stepper: str, other: StepDifference) -> str:
    if other.same:
        return f"The steps of {stepper} equal those of {other.name}, {_to(other.largest)}."
    words = (
        f"It is not {other.name}: after one to three steps their states differ by up to "
        f"{other.largest:.1e} of their size"
    )
    if other.power is not None:
        words += f", and after one step with the power {other.power:.2f} of dt"
    return f"{words}."


def _to(difference: float) -> str:
    return "to the last bit" if difference == 0 else f"to {difference:.0e} of the state"


def _order_blocks(explanation: Explanation) -> list[Block]:
    table = explanation.tables[0]
    observed = table_words.order_cells(table, table.orders[0])
    classes = [
        (
            _class_words(each, explanation.problem),
            _local_order(each),
            f"{observed[2]} {observed[3]}" if each.own and observed[2] != "-" else "-",
            "-" if each.declared is None else str(each.declared or "none"),
        )
        for each in explanation.orders
    ]
    parts: list[Block] = [Grid(_ORDERS, classes, left=frozenset({0}))]
    for table in explanation.tables:
        order = table.orders[0]
        name = _PLURAL[table.norm.quantity]
        words = f"Observed for {name}: {order.order.verdict}"
        if order.order.observed is None:
            words += f", {order.order.why}"
        else:
            cells = table_words.order_cells(table, order)
            words += f", order {cells[2]} {cells[3]}, {cells[4]} steps/frame"
        if order.order.left_out:
            words += f"; left out: {table_words.left_out_words(table, order)}"
        parts.append(Paragraph(f"{words}."))
    return parts


def _class_words(each: ClassOrder, problem: Problem) -> str:
    words, of = ["first-order"], each.of_class
    if problem.mechanics is not None:
        words = ["damped" if of.damped else "undamped"]
        words.append("from rest" if of.at_rest else "moving at the start")
        words += ["rigid"] * of.rigid
    return ", ".join(words) + " (this one)" * each.own


def _local_order(each: ClassOrder) -> str:
    if each.local is None:
        return f"> {each.at_least - 1}"
    return str(each.local) if each.local >= 1 else "none"


def _constant_blocks(explanation: Explanation) -> list[Block]:
    cells, norms_by_words = [], defaultdict(list)
    for table in explanation.tables:
        order, norm = table.orders[0], table.norm.name
        constant = order.constant
        assert constant is not None
        steps = [
            table_words.steps_at(table, order.stepper, dt)
            for dt in (constant.dt, constant.agree_10_percent, constant.agree_1_percent)
        ]
        if constant.order is not None:
            numbers = (_number(constant.predicted, ".5g"), _number(constant.measured, ".5g"))
            ratio = _number(constant.ratio, ".4f")
            cells.append((norm, str(constant.order), *numbers, steps[0], ratio, *steps[1:]))
        if constant.ratio is None or abs(constant.ratio - 1.0) > AGREE:
            norms_by_words[table_words.constant_words(table, order)].append(norm)
    parts: list[Block] = []
    if cells:
        last = explanation.reference.trusted - 1
        parts += [
            Paragraph(
                f"As dt goes to 0, the largest error over samples 1 to {last} is C dt^p. C is "
                "predicted from the local error d, by e' = f_y e + d along the reference, and "
                "measured at the most steps per frame at which rounding and the reference leave "
                "open less than 1% of the error. The last columns say from how many steps per "
                "frame on, up to there, the two agree to 10% and to 1%."
            ),
            Grid(_CONSTANTS, cells, left=frozenset({0})),
        ]
    return parts + [
        Paragraph(f"{listed(norms)}: {words}.") for words, norms in norms_by_words.items()
    ]


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else f"{value:{form}}"


def _stability_blocks(found: LinearStability) -> list[Block]:
    parts: list[Block] = []
    if found.limits is not None:
        parts.append(Paragraph(_limits_words(found.limits)))
    rest = found.measured_at_rest
    limits = []
    for where, predicted, measured in (
        ("along the solution", found.predicted, found.bounded_from),
        ("about its equilibrium", found.predicted_at_rest, rest and rest.steps_per_frame),
    ):
        steps = predicted and predicted.steps
        dt = steps.dt if steps is not None and 0.0 < steps.dt < math.inf else None
        count = steps and steps.steps_per_frame
        limits.append((where, _number(count, "d"), _number(dt, ".5g"), _number(measured, "d")))
    if limits := [row for row in limits if any(cell != "-" for cell in row[1:])]:
        parts += [
            Paragraph(
                "Steps per frame from which on nothing grows that does not grow in the solution: "
                "predicted from the problem's eigenvalues, and measured. Along the solution, runs "
                "are measured that do not blow up; slow growth does not show in a short run."
            ),
            Grid(_STABILITY, limits, left=frozenset({0})),
        ]
    return parts + [Paragraph(note) for note in found.notes]


def _limits_words(limits: StabilityLimits) -> str:
    words = f"An oscillation without damping {_interval_words(limits.imaginary, 'dt omega')}"
    if limits.real is not None:
        words += f"; a decay {_interval_words(limits.real, 'dt |lambda|')}"
    return f"{words}."


def _interval_words(interval: StableInterval, size: str) -> str:
    if not interval.ends:
        return f"is stable at all {size} up to {interval.looked_to:g}"
    if interval.limit > 0.0:
        return f"is stable up to {size} = {interval.limit:.6g}"
    if interval.growth is None:
        return f"is stable at no {size}"
    term = f"{interval.growth.coefficient:.3g} ({size})^{interval.growth.power}"
    return f"is stable at no {size}: a step multiplies it by 1 + {term} and smaller terms"


def _structure_blocks(found: Mapping[str, Property] | str) -> list[Block]:
    if isinstance(found, str):
        return [Paragraph(f"There is nothing to say: {found}.")]
    properties = [
        (
            name,
            _HOLDS[each.holds],
            _number(each.defect, ".1e"),
            "-" if each.power is None else f"dt^{each.power}" if each.power else "stays",
            "-" if each.holds is None else f"{each.dt:.3g}",
        )
        for name, each in found.items()
    ]
    by_note = defaultdict(list)
    for name, each in found.items():
        if each.note:
            by_note[each.note].append(name)
    return [
        Paragraph("Without damping, by what part one step misses what the exact solution keeps:"),
        Grid(_STRUCTURE, properties, left=frozenset({0, 1})),
        *(Paragraph(f"{listed(names).capitalize()}: {note}.") for note, names in by_note.items()),
    ]


def _energy_words(found: ModifiedEnergy | str | None) -> list[str]:
    """What a symplectic step keeps better than the energy."""
    if found is None:
        return []
    if isinstance(found, str):
        return [f"No energy near H is known that the step keeps: {found}."]
    p, (predicted, measured, left) = found.order, found.swings
    power = "dt" if p == 1 else f"dt^{p}"
    words = (
        f"The energy H itself swings, by {measured:.4g} in {len(found.times) - 1} frames at "
        f"{found.steps_per_frame} steps per frame. Theory predicts {predicted:.4g}: what the step "
        f"keeps to higher order is H + {power} H_{p}, where dH_{p} = w(d, .) with the local error "
        f"d and the form w. "
    )
    if left > _KEPT * measured:
        return [words + "At this step size further terms count as much."]
    ratio = measured / predicted
    return [f"{words}The ratio is {ratio:.5f}, and H + {power} H_{p} swings by {left:.1g} only."]


@rows.register
def _(explanation: Explanation) -> list[dict[str, Any]]:
    """One for each run and norm, with the prediction beside its error."""
    return [{"norm": table.norm.name, **row} for table in explanation.tables for row in rows(table)]
