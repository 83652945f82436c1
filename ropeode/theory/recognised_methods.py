"""Methods by name: the well-known one that a tableau is, or the one that it is nearly."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from fractions import Fraction
from typing import NamedTuple

import jax

from ropeode.tableaus import NystromTableau, Tableau
from ropeode.tableaus.stages import Number, Row, dot, ones, same
from ropeode.theory.known_tableaus import EXPLICIT, IMPLICIT, SECOND_ORDER, published

AnyTableau = Tableau | NystromTableau

# A method that differs in more stages than these is another one; the result counts as one of them.
_CHANGES, _CHANGES_OF_FEW_STAGES = 2, 1
# What a stage that the result does not need counts, unless the method is a well-known one exactly.
_REDUCED = 2
# Methods of more stages are also looked for among those of libraries.
_FEW = 4


class Recognition(NamedTuple):
    """A well-known method that a tableau is, or nearly is.

    Fields:
        name: of the well-known method.
        known: its tableau.
        differences: where the tableau differs, in words; none where it is that method.
        corrections: the lines of the well-known method that are others in the tableau's.
    """

    name: str
    known: AnyTableau
    differences: tuple[str, ...]
    corrections: tuple[str, ...]


def recognised(tableau: AnyTableau) -> Recognition | None:
    """The well-known method that a tableau is or is nearest to; None where none is near.

    A method that differs from a well-known one, and has at least its order, is one of its own.

    Arguments:
        tableau: as `tableau_of` finds it.
    """
    best: tuple[tuple[int, int], Recognition] | None = None
    for given in dict.fromkeys((_simplest(tableau), _simplest(tableau.reduced))):
        # A stage too many was written by somebody who had another method in mind.
        fewer = _REDUCED * (given.stages < tableau.stages - _for_next_step(tableau))
        for name, known in _candidates(given):
            cost, found = _compared(name, given, known)
            key = (cost and cost + fewer, len(found.corrections))
            most = _CHANGES if known.stages > 2 else _CHANGES_OF_FEW_STAGES
            if cost <= most and (best is None or key < best[0]):
                best = key, found
    if best is None:
        return None
    (cost, _), found = best
    # Times are not what makes a method one of its own.
    own = cost > 0 and not _only_times(tableau, found.known)
    if own and _order(tableau) >= _order(found.known):
        return None
    return found


def _only_times(tableau: AnyTableau, known: AnyTableau) -> bool:
    """Whether a method differs from another one in the times of its slopes alone."""
    given = _simplest(tableau)
    if given.stages != known.stages:
        return False
    return not _compared("", dataclasses.replace(given, c=known.c), known)[0]


def _compared(name: str, given: AnyTableau, known: AnyTableau) -> tuple[int, Recognition]:
    """How a tableau differs from a well-known one of the same kind and size, line by line.

    Returns:
        In how many of its stages and results, and where.
    """
    if isinstance(known, NystromTableau) and known.a is None and isinstance(given, NystromTableau):
        given = dataclasses.replace(given, a=None)
    right = lines_of(known)
    corrections = tuple(line for line in right if line not in lines_of(given))
    words = []
    if at_once := any(known.c) and not any(given.c):
        words.append("all slopes taken at time t")
        given = dataclasses.replace(given, c=known.c)
    pairs = list(zip(lines_of(given), right, strict=True))
    words += [f"{mine} in place of {own.partition(' = ')[2]}" for mine, own in pairs if mine != own]
    # The new positions and the new velocities are one result.
    changed = {min(i, known.stages) for i, (mine, own) in enumerate(pairs) if mine != own}
    return at_once + len(changed), Recognition(name, known, tuple(words), corrections)


def describe(tableau: AnyTableau, declared: int | None = None) -> str:
    """A tableau in a few sentences: its name, what differs from the method of that name, its order.

    Arguments:
        tableau: as `tableau_of` finds it.
        declared: the order that its author claims; it is said where it is another one.

    Returns:
        As in "This is RK4 with k4 = f(t + dt, y + 1/2 * dt * k3) in place of
        f(t + dt, y + dt * k3); its order is 1 in place of 4."
    """
    recognition = recognised(tableau)
    if recognition is None:
        kind = "Runge-Kutta" if isinstance(_simplest(tableau), Tableau) else "Nystrom"
        explicit = "an explicit" if tableau.explicit else "an implicit"
        count = tableau.reduced.stages
        name = f"{explicit} {kind} method with {count} stage{'s' if count > 1 else ''}"
        sentence = f"This is {name}, none of the well-known ones"
    else:
        sentence = f"This is {recognition.name}"
        if recognition.differences:
            sentence += " with " + ", and with ".join(recognition.differences)
    sentence += f"; {_order_in_words(tableau, recognition)}"
    if declared not in (None, tableau.order):
        sentence += f" (declared: {declared})"
    return " ".join([f"{sentence}.", *_remarks(tableau)])


def _order(tableau: AnyTableau) -> int:
    """The order that names are given by: a Nystrom method's where forces are of positions."""
    if isinstance(tableau, NystromTableau):
        return tableau.order_without_velocities
    return tableau.order


def _order_in_words(tableau: AnyTableau, recognition: Recognition | None) -> str:
    order = tableau.order
    words = f"its order is {order}"
    if recognition and (wanted := _order(recognition.known)) != _order(tableau):
        words += f" in place of {wanted}"
    if isinstance(tableau, NystromTableau):
        if tableau.a is None:
            words += ", for forces that do not depend on the velocities"
        elif (more := tableau.order_without_velocities) != order:
            words += f", and {more} where forces do not depend on the velocities"
    elif (more := tableau.order_without_time) != order:
        words += f", and {more} where the right-hand side does not depend on time"
    return words


def _remarks(tableau: AnyTableau) -> Iterator[str]:
    """Slopes that the step does not need, and velocities that cost a Nystrom method its order."""
    for i, j in enumerate(tableau.equal_to):
        if i != j:
            yield f"k{j + 1} and k{i + 1} are computed with equal arguments."
    for i in tableau.unused:
        # Many methods take it for their next step.
        where = ", the slope at the new state," if is_result(tableau, i) else ""
        yield f"k{i + 1}{where} is not used in the step."
    if isinstance(tableau, Tableau) or tableau.a is None:
        return
    if tableau.order < tableau.order_without_velocities:
        for i, (row, drift) in enumerate(zip(tableau.a, tableau.d, strict=True)):
            at = dot(row, ones(len(row)))
            if not same(at, drift):
                yield f"k{i + 1} takes positions at {_time(drift)} and velocities at {_time(at)}."


def _time(moved: Number) -> str:
    """A time, in units of dt from the start of the step."""
    if same(moved, Fraction(0)):
        return "t"
    size = "" if same(abs(moved), Fraction(1)) else f"{_shown(abs(moved))} "
    return f"t {'+' if moved > 0 else '-'} {size}dt"


def _for_next_step(tableau: AnyTableau) -> int:
    """How many slopes are taken at the new state, for the next step."""
    return sum(is_result(tableau, i) for i in tableau.unused)


def _simplest(tableau: AnyTableau) -> AnyTableau:
    """A Nystrom method as the Runge-Kutta method that it is, if it is one."""
    if isinstance(tableau, Tableau) or tableau.a is None:
        return tableau
    method = Tableau(tableau.a, tableau.b, tableau.c)
    derived, given = NystromTableau.of_tableau(method).parts, tableau.parts
    # Fractions and numbers are the leaves of these trees.
    return method if all(map(same, jax.tree.leaves(derived), jax.tree.leaves(given))) else tableau


def _candidates(tableau: AnyTableau) -> Iterator[tuple[str, AnyTableau]]:
    """Well-known methods with as many stages."""
    stages = tableau.stages
    known = EXPLICIT if tableau.explicit else IMPLICIT
    if isinstance(tableau, Tableau):
        if tableau.explicit and stages > _FEW:
            known = {**known, **published()}
        yield from ((name, each) for name, each in known.items() if each.stages == stages)
        return
    if not tableau.explicit:
        return
    yield from ((name, each) for name, each in SECOND_ORDER.items() if each.stages == stages)
    for name, each in EXPLICIT.items():
        if each.stages == stages:
            own = NystromTableau.of_tableau(each)
            yield name, own if tableau.a else dataclasses.replace(own, a=None)


def _shown(number: Number) -> str:
    return str(number) if isinstance(number, Fraction) else f"{number:.10g}"


def lines_of(tableau: Tableau | NystromTableau) -> list[str]:
    """One line for each slope, and one for each result, as in ``k2 = f(t + dt, y + dt * k1)``.

    Arguments:
        tableau: of f, the right-hand side, or of a, the acceleration.
    """
    stages = []
    for i, c in enumerate(tableau.c):
        time = f"t{_term(c, 'dt')}"
        if isinstance(tableau, Tableau):
            y = "y_new" if is_result(tableau, i) else f"y{_sum('dt', tableau.a[i])}"
            own = f"f({time}, {y})"
        else:
            x = f"x{_term(tableau.d[i], 'dt * v')}{_sum('dt**2', tableau.p[i])}"
            x = "x_new" if is_result(tableau, i) else x
            v = "" if tableau.a is None else f", v{_sum('dt', tableau.a[i])}"
            own = f"a({time}, {x}{v})"
        stages.append(f"k{i + 1} = {own}")
    if isinstance(tableau, Tableau):
        return [*stages, f"y_new = y{_sum('dt', tableau.b)}"]
    return [
        *stages,
        f"x_new = x + dt * v{_sum('dt**2', tableau.q)}",
        f"v_new = v{_sum('dt', tableau.b)}",
    ]


def is_result(tableau: Tableau | NystromTableau, stage: int) -> bool:
    """Whether a stage's state is the result."""
    if isinstance(tableau, Tableau):
        return all(map(same, tableau.a[stage], tableau.b))
    return same(tableau.d[stage], Fraction(1)) and all(map(same, tableau.p[stage], tableau.q))


def _sum(step: str, row: Row) -> str:
    """What is added: slopes with their coefficients, times a power of dt."""
    slopes = [(value, f"k{i + 1}") for i, value in enumerate(row) if not same(value, Fraction(0))]
    if len(slopes) == 1:
        return _term(slopes[0][0], f"{step} * {slopes[0][1]}")
    inner = "".join(_term(*each) for each in slopes)
    return f" + {step} * ({inner.removeprefix(' + ')})" if slopes else ""


def _term(value: Number, what: str) -> str:
    """As " + what", with its coefficient; nothing where that is 0."""
    if same(value, Fraction(0)):
        return ""
    size = "" if same(abs(value), Fraction(1)) else f"{_shown(abs(value))} * "
    return f" {'+' if value > 0 else '-'} {size}{what}"
