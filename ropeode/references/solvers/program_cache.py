"""Programs of the primary solver: traced, or read from the file that keeps the trace."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import importlib.util
import threading
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

import jax
import numpy as np

from ropeode.errors import InputError
from ropeode.files import write_whole

# What decides what a trace looks like, beside the right-hand side.
_PACKAGES = ("jax", "jaxlib", "diffrax", "equinox", "lineax", "optimistix")
_EXPLICIT = ("Dopri8",)
_folder: Path | None = None
_compiling = threading.Lock()


def keep_traces_in(folder: Path) -> None:
    """Keep traces in files of a folder from now on, and take them from there.

    The runs do not change: a trace from a file is the same program as a new one.

    Arguments:
        folder: is made when there is something to put into it.
    """
    global _folder
    _folder = folder


@dataclasses.dataclass(frozen=True)
class Family:
    """Runs that one compiled program serves; all numbers of a problem are its inputs.

    Arguments:
        solver: the name of a diffrax solver.
        rhs: ``rhs(t, y, args)`` of the problem.
        shape: of its state.
        args_tree: the structure of `args`.
        args_leaves: shape and dtype of each array in it.
        times: how many sample times.
        jumps: how many jump times.
        own_lengths: whether each frame has a longest step of its own.
    """

    solver: str
    rhs: Callable
    shape: tuple[int, ...]
    args_tree: Any
    args_leaves: tuple[tuple[tuple[int, ...], Any], ...]
    times: int
    jumps: int
    own_lengths: bool

    def field(self, t: Any, y: Any, leaves: Any) -> Any:
        """The right-hand side for flat states: one flat array is diffrax's fastest form."""
        args = jax.tree.unflatten(self.args_tree, leaves)
        return self.rhs(t, y.reshape(self.shape), args).reshape(-1)

    def inputs(self) -> tuple:
        """Shapes and dtypes of the program's inputs; see `diffrax_program.solution_of`."""
        number = _abstract(())
        return (
            _abstract((int(np.prod(self.shape)),)),
            [_abstract(*leaf) for leaf in self.args_leaves],
            _abstract((self.times,)),
            _abstract((self.jumps,)),
            number,
            number,
            _abstract((), np.int64),
            _abstract((self.times - 1,) if self.own_lengths else ()),
        )


def compiled(family: Family) -> tuple[Callable, bool]:
    """The compiled program of a family, and whether it was compiled for this call.

    Of several threads that ask for it one compiles it, and the others wait.
    """
    with _compiling:
        before = _compiled.cache_info().misses
        return _compiled(family), _compiled.cache_info().misses > before


@functools.lru_cache(maxsize=64)
def _compiled(family: Family) -> Callable:
    inputs = family.inputs()
    if _folder is None:
        return _traced(family).lower(*inputs).compile()
    try:
        kept = _kept(family, _folder)
    except Exception:
        # What calls back into Python cannot be kept. If it cannot be traced, that is raised here.
        return _traced(family).lower(*inputs).compile()
    return jax.jit(kept.call).lower(*inputs).compile()


def _kept(family: Family, folder: Path) -> Any:
    """The trace of a family, from its file, which is written if there is none."""
    path = folder / f"{_key(family)}.traced"
    exported = _read(path)
    if exported is None:
        exported = jax.export.export(_traced(family))(*family.inputs())
        _write(path, bytes(exported.serialize()))
    return exported


def _traced(family: Family) -> Any:
    # Not above: it imports diffrax.
    from ropeode.references.solvers.diffrax_program import solution_of

    return jax.jit(solution_of(family))


def _key(family: Family) -> str:
    """A hash of all that a trace depends on.

    The right-hand side counts as what JAX makes of it, with its derivative where an implicit
    solver takes that; neither its name nor its source text says what it does.
    """

    def with_slope(t: Any, y: Any, leaves: Any) -> Any:
        return jax.jvp(lambda y: family.field(t, y, leaves), (y,), (y,))

    function = family.field if family.solver in _EXPLICIT else with_slope
    y0, leaves, *_ = family.inputs()
    own = importlib.util.find_spec("ropeode.references.solvers.diffrax_program")
    parts = (
        *(f"{name} {metadata.version(name)}" for name in _PACKAGES),
        Path(str(own and own.origin)).read_text(),
        jax.default_backend(),
        family.solver,
        repr(family.inputs()),
        str(family.jumps > 0),
        jax.jit(function).lower(_abstract(()), y0, leaves).as_text(),
    )
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def _read(path: Path) -> Any:
    """The trace in a file; None where there is none, or it is not what was written."""
    try:
        digest, contents = path.read_bytes().split(b"\n", 1)
    except (OSError, ValueError):
        return None
    if hashlib.sha256(contents).hexdigest().encode() != digest:
        return None
    return jax.export.deserialize(bytearray(contents))


def _write(path: Path, contents: bytes) -> None:
    """Keep a trace; where the folder cannot be written to, the next process traces again."""
    with contextlib.suppress(OSError, InputError):
        path.parent.mkdir(parents=True, exist_ok=True)
        digest = hashlib.sha256(contents).hexdigest().encode()
        write_whole(path, digest + b"\n" + contents)


def _abstract(shape: tuple[int, ...], dtype: Any = np.float64) -> jax.ShapeDtypeStruct:
    return jax.ShapeDtypeStruct(shape, dtype)
