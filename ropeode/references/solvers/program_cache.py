"""Programs of the primary solver: compiled, or found in the cache folder."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from typing import Any

import jax

from ropeode import cache
from ropeode.cache import Source
from ropeode.references.solvers.family import Family, abstract

_compiling = threading.Lock()


def compiled(family: Family) -> tuple[Callable, bool]:
    """The compiled program of a family, and whether this call compiled it.

    Where several threads want the same program, one compiles it and the others wait.
    """
    with _compiling:
        before = _compiled.cache_info().misses
        return _compiled(family), _compiled.cache_info().misses > before


@functools.lru_cache(maxsize=64)
def _compiled(family: Family) -> Callable:
    description = _description(family) if cache.is_used() else None
    return cache.program(description, lambda: _source(family))[0]


def _source(family: Family) -> Source:
    # Not above: it imports diffrax.
    from ropeode.references.solvers.diffrax_program import solution_of

    return Source(solution_of(family), family.inputs())


def _description(family: Family) -> str:
    """What tells a program of the primary solver from all others.

    The right-hand side enters as the program that JAX lowers it to, with its derivative where
    an implicit solver needs that; neither its name nor its source text says what it does.
    """

    def with_slope(t: Any, y: Any, leaves: Any) -> Any:
        return jax.jvp(lambda y: family.field(t, y, leaves), (y,), (y,))

    function = with_slope if family.solver.implicit else family.field
    y0, leaves, *_ = family.inputs()
    parts = (
        str(family.solver),
        repr(family.inputs()),
        str(family.jumps > 0),
        *([] if family.compensated else ["as its library has it"]),
        jax.jit(function).lower(abstract(()), y0, leaves).as_text(),
    )
    return "\0".join(parts)
