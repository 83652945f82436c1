"""Programs of the primary solver: traced, or read from the file that keeps the trace."""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import threading
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

import jax

from ropeode.references import cache_folder
from ropeode.references.solvers.family import Family, abstract

# What decides what a trace looks like, beside the right-hand side.
_PACKAGES = ("jax", "jaxlib", "diffrax", "equinox", "lineax", "optimistix")
_MODULES = (
    "ropeode.references.solvers.diffrax_program",
    "ropeode.references.solvers.rounding",
    "ropeode.problems.nested_jaxprs",
)
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
    inputs = family.inputs()
    if not cache_folder.is_used():
        return _traced(family).lower(*inputs).compile()
    try:
        kept = _kept(family)
    except Exception:
        # What calls back into Python cannot be kept. What cannot be traced raises here.
        return _traced(family).lower(*inputs).compile()
    return jax.jit(kept.call).lower(*inputs).compile()


def _kept(family: Family) -> Any:
    """The trace of a family from its file; writes the file if there is none."""
    name = f"traced/{_key(family)}.traced"
    contents = cache_folder.read(name)
    if contents is not None:
        return jax.export.deserialize(bytearray(contents))
    exported = jax.export.export(_traced(family))(*family.inputs())
    cache_folder.write(name, bytes(exported.serialize()))
    return exported


def _traced(family: Family) -> Any:
    # Not above: it imports diffrax.
    from ropeode.references.solvers.diffrax_program import solution_of

    return jax.jit(solution_of(family))


def _key(family: Family) -> str:
    """A hash of all that a trace depends on.

    The right-hand side enters as the program that JAX lowers it to, with its derivative where
    an implicit solver needs that; neither its name nor its source text says what it does.
    """

    def with_slope(t: Any, y: Any, leaves: Any) -> Any:
        return jax.jvp(lambda y: family.field(t, y, leaves), (y,), (y,))

    function = with_slope if family.solver.implicit else family.field
    y0, leaves, *_ = family.inputs()
    own = map(importlib.util.find_spec, _MODULES)
    parts = (
        *(f"{name} {metadata.version(name)}" for name in _PACKAGES),
        *(Path(str(each and each.origin)).read_text() for each in own),
        jax.default_backend(),
        str(family.solver),
        repr(family.inputs()),
        str(family.jumps > 0),
        jax.jit(function).lower(abstract(()), y0, leaves).as_text(),
    )
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()
