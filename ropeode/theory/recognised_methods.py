"""Methods by name: the well-known one that a tableau is, or the one that it is nearly."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

from ropeode.tableaus import NystromTableau, Tableau
from ropeode.tableaus.stages import Number, Row, dot, ones, same
from ropeode.theory.known_tableaus import EXPLICIT, IMPLICIT, SECOND_ORDER, published
from ropeode.validation import listed

AnyTableau = Tableau | NystromTableau

# A method that differs in more places than these is another one.
_MOST_CHANGES = {1: 1}
_CHANGES = 2
# What a stage that the result does not need counts, unless the method is a well-known one exactly.
_REDUCED = 2
# Methods of more stages are also looked for among those of libraries.
_FEW = 4


class Recognition(NamedTuple):
    """A well-known method that a tableau is, or nearly is.

    Fields:
        name: of the well-known method.
        known: its tableau.
        given: the tableau that is compared with it.
        differences: where the tableau differs, in words; none where it is that method.
    """

    name: str
    known: AnyTableau
    given: AnyTableau
    differences: tuple[str, ...]

    @property
    def corrections(self) -> list[str]:
        """The lines of the well-known method that are others in the tableau's."""
        if not self.differences:
            return []
        given = self.given
        if isinstance(given, NystromTableau) and isinstance(self.known, NystromTableau):
            given = given if self.known.a else dataclasses.replace(given, a=None)
        return [line for line in lines_of(self.known) if line not in lines_of(given)]


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
            changes = list(_changes(given, known))
            cost = sum(change.cost for change in changes)
            if cost > _MOST_CHANGES.get(known.stages, _CHANGES):
                continue
            words = tuple(change.words for change in changes)
            key = (cost and cost + fewer, len(words))
            if best is None or key < best[0]:
                best = key, Recognition(name, known, given, words)
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
    return not list(_changes(dataclasses.replace(given, c=known.c), known))


def describe(tableau: AnyTableau, declared: int | None = None) -> str:
    """A tableau in a few sentences: its name, what differs from the method of that name, its order.

    Arguments:
        tableau: as `tableau_of` finds it.
        declared: the order that its author claims; it is said where it is another one.

    Returns:
        As in "This is RK4 with a43 = 1/2 in place of 1; its order is 1 in place of 4."
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
    columns = zip(_flat(derived), _flat(given), strict=True)
    return method if all(same(one, other) for one, other in columns) else tableau


def _flat(parts: Sequence) -> Iterator[Number]:
    for each in parts:
        if isinstance(each, Fraction | float):
            yield each
        else:
            yield from _flat(each)


def _candidates(tableau: AnyTableau) -> Iterator[tuple[str, AnyTableau]]:
    """Well-known methods with as many stages."""
    stages = tableau.stages
    known = EXPLICIT if tableau.explicit else IMPLICIT
    if isinstance(tableau, Tableau):
        if tableau.explicit and stages > _FEW:
            known = {**known, **published(stages)}
        yield from ((name, each) for name, each in known.items() if each.stages == stages)
        return
    if not tableau.explicit:
        return
    yield from ((name, each) for name, each in SECOND_ORDER.items() if each.stages == stages)
    for name, each in EXPLICIT.items():
        if each.stages == stages:
            own = NystromTableau.of_tableau(each)
            yield name, own if tableau.a else dataclasses.replace(own, a=None)


class _Change(NamedTuple):
    """A difference between two tableaus: what it counts, and in words."""

    cost: int
    words: str


class _Place(NamedTuple):
    """Where coefficients stand.

    Fields:
        symbol: of a coefficient, with the place of its number, as in ``a4{}``.
        name: what is computed with them.
    """

    symbol: str
    name: str


def _changes(given: AnyTableau, known: AnyTableau) -> Iterator[_Change]:
    """How one tableau differs from another of the same kind and size."""
    if isinstance(known, NystromTableau) and known.a is None and isinstance(given, NystromTableau):
        given = dataclasses.replace(given, a=None)
    if (ratio := _ratio(given, known)) is not None:
        yield _Change(1, f"all its slopes times {_shown(ratio)}")
        return
    at_end = {i for i in range(given.stages) if is_result(given, i) and is_result(known, i)}
    # One who takes the old positions leaves out all that makes them new ones.
    old = set()
    if isinstance(given, NystromTableau) and isinstance(known, NystromTableau):
        old = {i for i in range(given.stages) if known.d[i] and not any((given.d[i], *given.p[i]))}
        yield from (_Change(1, f"the old positions used in k{i + 1}") for i in sorted(old))
    rows = zip(_rows(given, at_end | old), _rows(known, at_end | old), strict=True)
    for (place, mine), (_, other) in rows:
        if not all(map(same, mine, other)):
            yield _change(place, mine, other)
    yield from _changed_times(given, known)
    if isinstance(given, NystromTableau) and isinstance(known, NystromTableau):
        for i, (mine, other) in enumerate(zip(given.d, known.d, strict=True)):
            if not same(mine, other) and i not in old:
                name = f"the factor of dt v in the positions of k{i + 1}"
                yield _Change(1, _entry(name, mine, other))


def _ratio(given: AnyTableau, known: AnyTableau) -> Number | None:
    """The only factor by which all slopes of a Nystrom method differ in its result; None if none.

    For a Runge-Kutta method, a row of the tableau says as much.
    """
    if isinstance(given, Tableau) or isinstance(known, Tableau):
        return None
    ratio = next((a / b for a, b in zip(given.b, known.b, strict=True) if b), Fraction(1))
    scaled = dataclasses.replace(
        known, q=tuple(ratio * each for each in known.q), b=tuple(ratio * each for each in known.b)
    )
    if same(ratio, Fraction(1)) or not all(map(same, _flat(given.parts), _flat(scaled.parts))):
        return None
    return ratio


def _rows(tableau: AnyTableau, at_end: set[int]) -> Iterator[tuple[_Place, Row]]:
    """The rows of coefficients of slopes, each with its place; once for stages at the result."""
    stages = [i for i in range(tableau.stages) if i not in at_end]
    if isinstance(tableau, Tableau):
        yield _Place("b{}", "the result"), tableau.b
        yield from (
            (_Place(f"a{i + 1}{{}}", f"the argument of k{i + 1}"), tableau.a[i]) for i in stages
        )
        return
    yield _Place("the factor of dt^2 k{} in the new positions", "the new positions"), tableau.q
    yield _Place("the factor of dt k{} in the new velocities", "the new velocities"), tableau.b
    for i in stages:
        name = f"the positions of k{i + 1}"
        yield _Place(f"the factor of dt^2 k{{}} in {name}", name), tableau.p[i]
    for i, row in enumerate(tableau.a or ()):
        name = f"the velocities of k{i + 1}"
        yield _Place(f"the factor of dt k{{}} in {name}", name), row


def _change(place: _Place, mine: Row, other: Row) -> _Change:
    """How a row differs: a slope in place of another one, all by one factor, or entry by entry."""
    pairs = [(i, j) for i in range(len(mine)) for j in range(len(mine)) if i != j]
    for i, j in pairs:
        if not other[j]:
            continue
        moved = list(other)
        moved[i], moved[j] = other[i] + other[j], Fraction(0)
        if all(map(same, mine, moved)):
            used = "used twice" if other[i] else "used"
            return _Change(1, f"k{i + 1} {used} in {place.name} in place of k{j + 1}")
        moved[i], moved[j] = other[j], other[i]
        if i < j and all(map(same, mine, moved)):
            return _Change(1, f"k{i + 1} and k{j + 1} swapped in {place.name}")
    different = [i for i, (a, b) in enumerate(zip(mine, other, strict=True)) if not same(a, b)]
    ratio = next((a / b for a, b in zip(mine, other, strict=True) if b), 0)
    if len(different) > 1 and ratio and all(map(same, mine, [ratio * each for each in other])):
        return _Change(1, f"its slopes times {_shown(ratio)} in {place.name}")
    entries = [_entry(place.symbol.format(i + 1), mine[i], other[i]) for i in different]
    # Weights may all be mistaken for others.
    most = _CHANGES if place.name == "the result" else len(entries)
    return _Change(min(len(entries), most), listed(entries))


def _changed_times(given: AnyTableau, known: AnyTableau) -> Iterator[_Change]:
    """How the times of the slopes differ.

    What goes with a change in the matrix counts nothing.
    """
    wanted = given.row_sums if isinstance(given, Tableau) else given.d
    different = [i for i, (a, b) in enumerate(zip(given.c, known.c, strict=True)) if not same(a, b)]
    following = all(map(same, given.c, wanted))
    if different and not any(given.c):
        yield _Change(0 if following else 1, "all slopes taken at time t")
    else:
        for i in different:
            words = _entry(f"c{i + 1}", given.c[i], known.c[i])
            yield _Change(0 if same(given.c[i], wanted[i]) else 1, words)


def _entry(name: str, mine: Number, other: Number) -> str:
    values = f"{_shown(mine)} in place of {_shown(other)}"
    return f"{values} as {name}" if " " in name else f"{name} = {values}"


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
    slopes = [(value, f"k{i + 1}") for i, value in enumerate(row) if value]
    if len(slopes) == 1:
        return _term(slopes[0][0], f"{step} * {slopes[0][1]}")
    inner = "".join(_term(*each) for each in slopes)
    return f" + {step} * ({inner.removeprefix(' + ')})" if slopes else ""


def _term(value: Number, what: str) -> str:
    """As " + what", with its coefficient; nothing where that is 0."""
    if not value:
        return ""
    size = abs(value)
    text = str(size) if isinstance(size, Fraction) else f"{size:.10g}"
    return f" {'+' if value > 0 else '-'} {what if size == 1 else f'{text} * {what}'}"
