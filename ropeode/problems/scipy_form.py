"""Right-hand sides as `scipy.integrate.solve_ivp` takes them: ``fun(t, y, *args)``, in NumPy."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import itertools
import time
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.arrays import real_array
from ropeode.errors import RopeodeError, UserCodeError
from ropeode.precision import in_float64
from ropeode.problems import checks
from ropeode.problems.memory import Memory
from ropeode.problems.numpy_tracing import with_numpy
from ropeode.problems.python_rhs import MOST_CALLS, PythonRhs, python_rhs
from ropeode.problems.signatures import check_signature, required
from ropeode.problems.state_structure import is_tree
from ropeode.problems.traced import too_coarse
from ropeode.validation import bad_value, check_all, check_whole

# A traced function must agree with itself in NumPy so closely, relative to its largest component:
# both round, and what they compute may cancel.
_SAME = 1e-9
# A span is divided into so many frames, and no more than fit into memory.
_FRAMES, _MOST_FRAMES = 20, 10**8
# At so many times and states; a function that counts is found at a few.
_PROBES, _FEW = 64, 4
# A function that counts its calls shows it within so many, unless they take longer than so long.
_CALLS, _SECONDS = 150, 0.5


@dataclasses.dataclass(frozen=True)
class ScipyFunction:
    """A problem's right-hand side as SciPy's solvers call it, in float64.

    Arguments:
        rhs: of the problem.
        shape: of its state.
        args: of the problem.
    """

    rhs: Callable
    shape: tuple[int, ...]
    args: Any

    def __call__(self, t: float, y: Any, *args: Any) -> np.ndarray:
        """The derivative, ``(n,)``.

        Arguments:
            t: time.
            y: state, ``(n,)``.
            args: other arguments of the right-hand side, in place of the problem's.
        """
        return self._called(_slope, t, y, args)

    def jac(self, t: float, y: Any, *args: Any) -> np.ndarray:
        """The derivative of that by the state, ``(n, n)``; arguments are the same."""
        return self._called(_jacobian, t, y, args)

    @in_float64
    def _called(self, compiled: Callable, t: float, y: Any, args: tuple) -> np.ndarray:
        (own,) = args or (self.args,)
        # A copy, which the caller may write to.
        return np.array(compiled(self.rhs, self.shape)(t, np.asarray(y, dtype=float), own))


@functools.lru_cache(maxsize=64)
def _slope(rhs: Callable, shape: tuple[int, ...]) -> Callable:
    """``rhs`` of flat states, compiled; in Python, if that is where it runs."""

    def flat(t: Any, y: Any, args: Any) -> Any:
        own = rhs.in_numpy if isinstance(rhs, PythonRhs) else rhs
        return own(t, y.reshape(shape), args).ravel()

    return flat if isinstance(rhs, PythonRhs) else jax.jit(flat)


@functools.lru_cache(maxsize=64)
def _jacobian(rhs: Callable, shape: tuple[int, ...]) -> Callable:
    return jax.jit(jax.jacfwd(_slope(rhs, shape), argnums=1))


@in_float64
def scipy_form(
    fun: Callable, t_span_or_ts: Any, y0: Any, args: Any, frames: int | None
) -> dict[str, Any]:
    """What `Problem.from_scipy`, which describes arguments and exceptions, hands to `Problem`."""
    if not callable(fun):
        raise bad_value("fun", fun, "a function fun(t, y, *args)", "hand over the function itself")
    given, ts, y0 = check_all(
        lambda: _arguments(args),
        lambda: sample_times_of(t_span_or_ts, frames),
        lambda: _state(y0),
    )
    names = ["t", "y", *(f"a{i}" for i in range(len(given)))]
    check_signature("fun", fun, names, _what_else(fun, len(given)))
    numeric = all(np.asarray(leaf).dtype.kind in "iufb" for leaf in jax.tree.leaves(given))
    # Words, functions and other objects are no arguments of a program.
    bound = () if numeric else given
    free: Any = checks.numeric_pytree("args", given) if numeric and given else None
    own = python_rhs(fun, bound)
    own_name = getattr(fun, "__name__", type(fun).__name__)
    probes = _probes(ts, y0)
    expected = _values(own, free, probes)
    rhs: Any = own
    ways = itertools.product(((free, bound), (None, given)), (_as_it_is, with_numpy))
    memory = Memory(fun, bound)
    if coarse := memory.coarse():
        raise too_coarse("rhs", coarse[0])
    for t, y in probes[:_FEW]:
        _value_or_none(own, t, y, free)
    # What it counts may matter later, and a compiled program knows nothing of it.
    counts = bool(memory.changes())
    for (rest, fixed), call in () if counts else ways:
        tried = _in_jax(fun, fixed, call)
        agrees = _agrees(tried, rest, probes, expected)
        # It may remember what JAX traced, which means nothing later.
        memory.restore()
        if agrees:
            rhs, free = tried, rest
            break
    name = own_name if own_name.isidentifier() else "problem"
    return {"rhs": rhs, "y0": y0, "ts": ts, "args": free, "name": name}


def _arguments(args: Any) -> tuple[Any, ...]:
    if args is None:
        return ()
    if not isinstance(args, (tuple, list)):
        fix = "write args=(value,), with the comma; a method of solve_ivp has no place here"
        fix = fix if isinstance(args, str) else fix.partition(";")[0]
        raise bad_value("args", args, "a tuple of what fun takes after t and y", fix)
    return tuple(args)


def _what_else(fun: Callable, given: int) -> str:
    """What to write where a function does not take so many arguments behind `t` and `y`."""
    takes = required(fun) or []
    if len(takes) > 2 + given:
        return f", or hand over what else it takes ({', '.join(takes[2:])}): args=(...,)"
    return ", or hand over no more than it takes in args" if given else ""


def sample_times_of(given: Any, frames: int | None) -> np.ndarray:
    """Sample times; a span of two times is divided into frames.

    Arguments:
        given: the times.
        frames: of a span; 20 where that is None.

    Raises:
        InputError: they are neither, or a span of fewer floating-point numbers than frames, or
            frames are given with sample times.
    """
    times = real_array("ts", given, "the span (0, 10), or the sample times [0, 1, 2]")
    if np.shape(times) != (2,):
        if frames is not None:
            fix = "leave it out, or hand over the span alone"
            raise bad_value("frames", frames, "none with sample times", fix)
        return checks.sample_times(times)
    if times[1] < times[0]:
        fix = "solve for -t: `lambda t, y: -np.asarray(fun(-t, y))` over the span (-t0, -t1)"
        raise bad_value("ts", given, "a span that begins at its smaller time", fix)
    checks.sample_times(times)
    count = check_whole("frames", _FRAMES if frames is None else frames, at_least=1, example="20")
    resolution = np.spacing(np.max(np.abs(times)))
    if count > min(_MOST_FRAMES, (times[1] - times[0]) / resolution):
        allowed = (
            f"at most {_MOST_FRAMES:.0e}, and no more than there are floating-point numbers in the "
            f"span (times near {times[1]:g} have a resolution of {resolution:.1e})"
        )
        raise bad_value("frames", count, allowed, "ask for fewer, or count the time from 0")
    return np.linspace(times[0], times[1], count + 1)


def _state(y0: Any) -> np.ndarray:
    if is_tree(y0) and y0 is not None:
        fix = "write Problem(rhs, y0, ts) with rhs(t, y, args) in JAX, which takes pytrees"
        raise bad_value("y0", y0, "an array of one axis", fix)
    state = real_array("y0", y0)
    if state.ndim != 1:
        fix = "ravel it, and reshape y inside fun, as for solve_ivp"
        fix = fix if state.ndim else f"write [{state.item()!r}]"
        raise bad_value("y0", f"shape {state.shape}", "an array of one axis", fix)
    return state


def _probes(ts: np.ndarray, y0: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """Times and states at which a function is tried; the first is the start."""
    draws = np.random.default_rng(4).normal(size=(_PROBES, *y0.shape))
    size = np.max(np.abs(y0)) or 1.0
    near = [y0 * (1.0 + 0.1 * draw) + 0.01 * size * draw for draw in draws]
    times = np.linspace(ts[0], ts[-1], _PROBES).tolist()
    return [(float(ts[0]), y0), *zip(times, near, strict=True)]


def _values(own: PythonRhs, args: Any, probes: list[tuple[float, np.ndarray]]) -> list[Any]:
    """What a function returns in Python; None where it takes too long, or raises.

    It may raise anywhere but at the start: nobody knows whether the solution goes there.

    Raises:
        UserCodeError: it raises at the start, returns something that is no derivative, or keeps
            hidden state.
    """
    with np.errstate(all="ignore"), own.remembered() as history:
        started = time.perf_counter()
        first = own.evaluated(*probes[0], args)
        if not np.all(np.isfinite(first)):
            fix = "start where the right-hand side is defined"
            raise bad_value("rhs result", first, "finite numbers at the initial state", fix)
        values: list[Any] = [first]
        for t, y in probes[1:]:
            late = time.perf_counter() - started > _SECONDS
            values.append(None if late else _value_or_none(own, t, y, args))
        for _ in range(_CALLS):
            own.evaluated(*probes[0], args)
            if time.perf_counter() - started > _SECONDS:
                break
    history.require_no_memory()
    return values


def _value_or_none(own: PythonRhs, t: float, y: np.ndarray, args: Any) -> np.ndarray | None:
    try:
        return own.evaluated(t, y, args)
    except UserCodeError:
        return None


@contextlib.contextmanager
def without_memory(problem: Any, most: int = MOST_CALLS) -> Iterator[None]:
    """Run a problem; a right-hand side in Python must be the same function before and after.

    Arguments:
        problem: a `Problem`, or the first one of an ensemble.
        most: so many calls are kept for comparison, as `History` explains.

    Raises:
        UserCodeError: it is not, because it keeps a memory.
    """
    own = problem.rhs
    if not isinstance(own, PythonRhs):
        yield
        return
    with own.remembered(most) as history:
        with np.errstate(all="ignore"):
            for t, y in _probes(problem.ts, problem.y0)[: most // 4]:
                _value_or_none(own, t, y, problem.args)
        try:
            yield
        except RopeodeError:
            # It may have raised because of its memory.
            history.require_no_memory()
            raise
    history.require_no_memory()


def _as_it_is(function: Callable, *given: Any) -> Any:
    return function(*given)


def _in_jax(function: Callable, bound: tuple[Any, ...], call: Callable) -> Callable:
    """``function(t, y, *bound, *args)`` as ``rhs(t, y, args)``, which returns one array of JAX.

    Arguments:
        function, bound: the user's.
        call: `with_numpy` for a function in NumPy, `_as_it_is` for one in JAX.
    """
    return functools.partial(_rhs_in_jax, function, bound, call)


# Not inside `_in_jax`, so that pickles can name it.
def _rhs_in_jax(
    function: Callable, bound: tuple[Any, ...], call: Callable, t: Any, y: Any, args: Any
) -> Any:
    def whole(t: Any, y: Any, *args: Any) -> Any:
        return function(t, y, *bound, *args)

    slope = jnp.asarray(call(whole, t, y, *(args or ())), dtype=float)
    # Of a state of one number, SciPy takes the derivative as a number too.
    return slope.reshape(y.shape) if slope.ndim == 0 and y.shape == (1,) else slope


def _agrees(
    tried: Callable,
    args: Any,
    probes: list[tuple[float, np.ndarray]],
    expected: list[Any],
) -> bool:
    """Whether JAX can trace a function, and then computes what it computes in Python."""
    try:
        compiled = jax.jit(tried)
        with np.errstate(all="ignore"):
            values = [np.asarray(compiled(t, y, args)) for t, y in probes]
    except Exception:
        # Whatever it is: in Python it ran.
        return False
    return all(
        value.shape == like.shape
        and np.allclose(value, like, rtol=0.0, atol=_SAME * _size(like), equal_nan=True)
        for value, like in zip(values, expected, strict=True)
        if like is not None
    )


def _size(value: np.ndarray) -> float:
    finite = np.abs(value[np.isfinite(value)])
    return float(np.max(finite, initial=0.0))
