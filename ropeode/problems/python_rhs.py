"""Right-hand sides that run in Python, as functions of JAX.

A compiled program calls them with its arrays and goes on with what they return. The call is a
`buffer_callback`, not a `pure_callback`: that one converts arrays by JAX in threads of XLA, where
float64 is off (the results are refused, or rounded to float32), takes twenty times as long, and may
wait for itself.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import itertools
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Literal, NamedTuple, NoReturn

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jax.experimental.buffer_callback import buffer_callback

from ropeode import callbacks
from ropeode.errors import RopeodeError, UserCodeError
from ropeode.precision import rhs_in_float64
from ropeode.problems.memory import Memory
from ropeode.validation import bad_value, is_traced, shortly, shown

# A function may write to arrays of its own before it returns them, which are the same in all
# threads. Whoever calls one holds this.
_one_at_a_time = threading.RLock()
_serial = itertools.count(1)
_MOST_KEPT = 64
# Of calls that are repeated later, so many from the beginning and from all that follow; and of
# these so many with the memory of the beginning, for so many seconds.
MOST_CALLS = 512
_MOST_RENEWED, _SECONDS = 64, 0.5
# So many calls are the first ones.
_FIRST = 8
# Balances the rounding of a central difference against its error.
_NUDGE = np.finfo(np.float64).eps ** (1 / 3)


class PythonRhs:
    """A right-hand side in Python, which JAX can compile into programs.

    ``rhs(t, y, args)`` is for JAX, `in_numpy` for NumPy. No two are equal, because nobody knows
    what a function in Python reads; `python_rhs` returns the same one for the same function.

    It can be differentiated once, with respect to time and state: by central differences.

    Arguments:
        function: ``function(t, y, *bound, *args)`` returns the derivative of `y`, as an array or a
            list.
        bound: arguments that are not numbers.
    """

    def __init__(self, function: Callable, bound: tuple[Any, ...] = ()):
        self.function, self.bound = function, bound
        self._histories: list[History] = []
        # A call that shows a memory which could not be put back.
        self.evidence: list[KeptCall] = []
        self._name = f"{getattr(function, '__name__', type(function).__name__)} #{next(_serial)}"

    def __repr__(self) -> str:
        # Programs are told apart by this; memory addresses are used again.
        return f"PythonRhs({self._name})"

    def __deepcopy__(self, memo: Any) -> PythonRhs:
        return self

    def __reduce__(self) -> tuple:
        return python_rhs, (self.function, self.bound)

    def __call__(self, t: Any, y: Any, args: Any) -> Any:
        """The derivative, in a program of JAX."""
        return rhs_in_float64(self._in_program, t, y, args)

    def _in_program(self, t: Any, y: Any, args: Any) -> Any:
        return _value(self, jnp.asarray(t, dtype=float), jnp.asarray(y, dtype=float), args)

    def in_numpy(self, t: Any, y: Any, args: Any) -> Any:
        """The derivative as a new NumPy array, without a program; where JAX traces, as in one.

        Raises:
            UserCodeError: the function raised, or returned something that is no derivative.
        """
        if is_traced((t, y, args)):
            return self(t, y, args)
        return self.evaluated(float(t), np.asarray(y), args)

    def evaluated(self, t: float, y: np.ndarray, args: Any) -> np.ndarray:
        """As `in_numpy`, of arrays."""
        # The caller's arrays stay as they are, whatever the function does to its own.
        own = np.array(y, dtype=np.float64)
        leaves, structure = jax.tree.flatten(args)
        plain = structure.unflatten(map(_plain, leaves)) or ()
        try:
            with _one_at_a_time, jax.enable_x64(True):
                value = self.function(t, own, *self.bound, *plain)
        except RopeodeError:
            raise
        except (Exception, SystemExit) as error:
            raise UserCodeError(
                f"rhs: it raised {shortly(error)} at {_place(t, y)}; allowed: a function that "
                "returns numbers wherever the solution goes. Fix: mend the error above, or end "
                "earlier."
            ) from error
        value = _derivative(value, t, y)
        for history in self._histories:
            history.add(t, y, args, value)
        return value

    @contextlib.contextmanager
    def remembered(self, most: int = MOST_CALLS) -> Iterator[History]:
        """The calls inside the block, of which so many are kept."""
        history = History(self, most)
        self._histories.append(history)
        try:
            yield history
        finally:
            self._histories.remove(history)

    def slopes(self, t: float, y: np.ndarray, args: Any) -> np.ndarray:
        """Its derivatives by the components of the state, which are counted by the last axis."""
        steps = _NUDGE * np.where(y == 0, np.max(np.abs(y)) or 1.0, np.abs(y))
        columns = []
        for index in np.ndindex(y.shape):
            up, down = np.array(y), np.array(y)
            up[index] += steps[index]
            down[index] -= steps[index]
            rise = self.evaluated(t, up, args) - self.evaluated(t, down, args)
            columns.append(rise / (up[index] - down[index]))
        return np.stack(columns, axis=-1)

    def rate(self, t: float, y: np.ndarray, args: Any) -> np.ndarray:
        """Its derivative by time."""
        late, early = (t + sign * _NUDGE * max(abs(t), 1.0) for sign in (1.0, -1.0))
        return (self.evaluated(late, y, args) - self.evaluated(early, y, args)) / (late - early)


class KeptCall(NamedTuple):
    """A call of a function, and what it returned."""

    t: float
    y: np.ndarray
    args: Any
    value: np.ndarray


class History:
    """Calls of a function in Python, and the memory that it had before them.

    Arguments:
        own: the function.
        most: how many calls are kept from the beginning, and half to all as many from those that
            follow, spread evenly.
    """

    def __init__(self, own: PythonRhs, most: int):
        self._own, self._most = own, most
        # Another thread may be calling it.
        with _one_at_a_time:
            self._before = Memory(own.function, own.bound)
        self._first = list(own.evidence)
        self._later: list[KeptCall] = []
        self._calls, self._every = 0, 1

    def add(self, t: float, y: np.ndarray, args: Any, value: np.ndarray) -> None:
        """A call, and what it returned."""
        self._calls += 1
        kept = self._first if len(self._first) < self._most else self._later
        if kept is self._later and self._calls % self._every:
            return
        # A program's own arrays do not outlive the call.
        kept.append(KeptCall(t, np.array(y), jax.tree.map(np.array, args), value.copy()))
        if len(self._later) >= self._most:
            del self._later[::2]
            self._every *= 2

    def require_no_memory(self) -> None:
        """See that the function depends on its arguments alone.

        Each call is made again, the last one first, and must return the same to the last bit. If
        the memory has changed, some are made again from what it was before all calls: a counter, a
        cache or an array for results makes no difference then. A function that is found out gets
        that memory back, or else such a call is kept, so that it is found out again.

        Raises:
            UserCodeError: it does not.
        """
        calls = [*self._first, *self._later][::-1]
        with _one_at_a_time, np.errstate(all="ignore"):
            found = self._first_that_differs(calls)
            changes = self._before.changes()
            if found is None and changes:
                found = self._first_that_differs_from_before(calls)
            if found is None:
                return
            self._before.restore()
            # What is no Python object is as it was left.
            lasting = self._first_that_differs(self._first[:_FIRST])
            self._own.evidence = [lasting[0]] if lasting else []
        _, values = found
        why = "keeps hidden state from call to call"
        if changes:
            why += f" (what has changed: {', '.join(changes)})"
        else:
            why += ", draws random numbers, or reads what changes (a clock, a file)"
        raise UserCodeError(
            f"rhs: not deterministic: at the same t and y it returned {values}, because it {why}; "
            "allowed: a function of its arguments alone. Fix: make what it remembers a part of the "
            "state; end at an event, and go on from there with another problem; draw random "
            "numbers once, before the problem is made, and hand them over in args."
        )

    def _differs(self, call: KeptCall) -> str | None:
        again = self._own.evaluated(call.t, call.y, call.args)
        if np.array_equal(again, call.value, equal_nan=True):
            return None
        values = f"{shown(call.value.tolist())} and later {shown(again.tolist())}"
        return f"{values} at {_place(call.t, call.y)}"

    def _first_that_differs(self, calls: Iterable[KeptCall]) -> tuple[KeptCall, str] | None:
        return next(((each, values) for each in calls if (values := self._differs(each))), None)

    def _first_that_differs_from_before(self, calls: list[KeptCall]) -> tuple[KeptCall, str] | None:
        until = time.perf_counter() + _SECONDS
        for call in calls[:: -(-len(calls) // _MOST_RENEWED)]:
            undo = self._before.restore()
            try:
                if found := self._first_that_differs([call]):
                    return found
            except UserCodeError:
                # What cannot be put back may be missed.
                return None
            finally:
                undo()
            if time.perf_counter() > until:
                break
        return None


# By what they are made of, which they keep alive, so that no other has that identity.
_kept: dict[tuple[int, ...], PythonRhs] = {}


def python_rhs(function: Callable, bound: tuple[Any, ...]) -> PythonRhs:
    """The `PythonRhs` of a function and its bound arguments: the same object for the same ones."""
    key = tuple(map(id, (function, *bound)))
    if key not in _kept and len(_kept) >= _MOST_KEPT:
        _kept.clear()
    return _kept.setdefault(key, PythonRhs(function, bound))


def _place(t: float, y: np.ndarray) -> str:
    """Where the function was evaluated, for messages."""
    return f"t = {t:g}, y = {' '.join(str(y).split())}"


def _plain(leaf: Any) -> Any:
    """A number as Python's own, as the function's author handed it over."""
    return np.asarray(leaf).item() if np.ndim(leaf) == 0 else np.array(leaf)


def _derivative(value: Any, t: float, y: np.ndarray) -> np.ndarray:
    """What the function returned, copied: it may return an array that it writes to again.

    Of a state of one number, SciPy takes the derivative as a number too.
    """
    try:
        array = np.array(value)
    except (TypeError, ValueError):
        array = np.array(None)
    if array.shape == () and y.shape == (1,):
        array = array.reshape(1)
    if array.dtype.kind not in "iuf" or array.shape != y.shape:
        what = f"numbers of type {array.dtype}, shape {array.shape}"
        what = what if array.dtype.kind in "iufbc" else f"{shown(value)} ({type(value).__name__})"
        fix = "return one number for each component of y"
        raise UserCodeError(
            f"rhs: it returned {what} at {_place(t, y)}; allowed: real numbers in the shape of the "
            f"state, {y.shape}. Fix: {fix}{', with `return`' if value is None else ''}."
        )
    if array.dtype.kind == "f" and array.dtype.itemsize < 8:
        raise UserCodeError(
            f"rhs: it returned numbers of type {array.dtype} at {_place(t, y)}; allowed: float64. "
            "Fix: remove casts and 32-bit arrays."
        )
    return array.astype(np.float64, copy=False)


@dataclasses.dataclass(frozen=True)
class _Call:
    """What a program calls: one of the functions of a `PythonRhs`."""

    own: PythonRhs
    name: Literal["evaluated", "slopes", "rate"]

    def __call__(self, context: Any, out: Any, t: Any, y: Any, args: Any) -> None:
        """Write the result into the buffer `out`; members of a `vmap` are called in turn."""
        del context
        leaves, structure = jax.tree.flatten(args)
        result, t, y, *leaves = (np.asarray(buffer) for buffer in (out, t, y, *leaves))
        function = getattr(self.own, self.name)
        try:
            if t.ndim == 0:
                result[...] = function(t.item(), y, structure.unflatten(leaves))
                return
            members = result.shape[: t.ndim]
            # What does not vary has axes of length 1.
            t, y, *leaves = (
                np.broadcast_to(leaf, members + leaf.shape[t.ndim :]) for leaf in (t, y, *leaves)
            )
            for index in np.ndindex(members):
                args = structure.unflatten([leaf[index] for leaf in leaves])
                result[index] = function(t[index].item(), y[index], args)
        except BaseException as error:
            callbacks.keep(self.own, error)
            result[...] = np.nan

    def in_program(self, more: tuple[int, ...], t: Any, y: Any, args: Any) -> Any:
        """Its result, which has these axes behind those of the state."""
        shape = jax.ShapeDtypeStruct((*y.shape, *more), y.dtype)
        return buffer_callback(self, shape, vmap_method="expand_dims")(t, y, args)


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _value(own: PythonRhs, t: Any, y: Any, args: Any) -> Any:
    return _Call(own, "evaluated").in_program((), t, y, args)


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _slopes(own: PythonRhs, t: Any, y: Any, args: Any) -> Any:
    return _Call(own, "slopes").in_program((y.size,), t, y, args)


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _rate(own: PythonRhs, t: Any, y: Any, args: Any) -> Any:
    return _Call(own, "rate").in_program((), t, y, args)


def _differentiated(own: PythonRhs, inputs: tuple, tangents: tuple) -> tuple[Any, Any]:
    t, y, args = inputs
    by_time, by_state, by_args = tangents
    if not all(isinstance(leaf, SymbolicZero) for leaf in jax.tree.leaves(by_args, is_leaf=_zero)):
        _refuse_derivative(own)
    value = _value(own, t, y, args)
    change = jnp.zeros_like(value)
    if not _zero(by_state):
        change += (_slopes(own, t, y, args) @ by_state.reshape(-1)).reshape(value.shape)
    if not _zero(by_time):
        change += _rate(own, t, y, args) * by_time
    return value, change


def _zero(tangent: Any) -> bool:
    return isinstance(tangent, SymbolicZero)


def _refuse_derivative(own: PythonRhs, *_: Any) -> NoReturn:
    raise bad_value(
        "rhs",
        own,
        "one derivative by time or state, because it runs in Python",
        "write it with jax.numpy",
    )


_value.defjvp(_differentiated, symbolic_zeros=True)
_slopes.defjvp(_refuse_derivative)
_rate.defjvp(_refuse_derivative)
