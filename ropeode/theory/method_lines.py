"""A method as the lines of a program, from its tableau."""

from __future__ import annotations

from fractions import Fraction

from ropeode.tableaus import NystromTableau, Tableau
from ropeode.tableaus.stages import Number, Row, same


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
