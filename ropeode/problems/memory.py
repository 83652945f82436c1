"""What a function in Python can remember from one call to the next.

Its memory is what can change in the variables that it reads besides its arguments (of closures, of
modules, default values, attributes), and in the containers, arrays and objects in them. It is taken
down place by place, so that it can be compared later, and put back. What lies outside of Python
objects, such as files, is not seen.
"""

from __future__ import annotations

import collections
import copy
import dataclasses
import functools
import itertools
import os
import sys
import sysconfig
import types
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from ropeode.validation import shown

# Places beyond the first so many, and arrays beyond so many bytes, are not looked at.
_MOST_PLACES, _MOST_BYTES = 1000, 2**26
# Types of numbers that are no float64, and would be taken for ones.
TOO_COARSE = ("float32", "float16", "bfloat16", "complex64")
# A message names so many changes.
_MOST_NAMED = 3
_PLAIN = (type(None), bool, int, float, complex, str, bytes, np.generic)
_FOLDERS = (
    os.path.dirname(os.path.dirname(__file__)),
    *(sysconfig.get_path(each) for each in ("stdlib", "purelib", "platlib")),
)
_LIBRARIES = ("<frozen", *(folder + os.sep for folder in _FOLDERS))
_ABSENT = object()
# With these a function reaches variables that are not named in it.
_ANY_NAME = {"globals", "vars", "setattr", "exec", "eval", "modules", "__dict__", "open"}


@dataclasses.dataclass(frozen=True)
class _Place:
    """Something that can change.

    Arguments:
        name: of what kind it is, in one word, and its path; it ends in a point where the entries
            of a dict are attributes.
        look: returns what is there.
        put: puts something there.
        take: returns what is there as it stays, whatever happens to the place.
    """

    name: str
    look: Callable[[], Any]
    put: Callable[[Any], Any]
    take: Callable[[], Any]


class Memory:
    """What a function can remember, as it is now.

    Arguments:
        function: or an object that can be called.
        bound: arguments that it is always given.
    """

    def __init__(self, function: Any, bound: Any):
        self._places, self._caches, self._is_whole = _places(
            ("attribute self", function), ("bound-argument args", bound)
        )
        self._then = [place.take() for place in self._places]

    def restore(self) -> Callable[[], None]:
        """Put everything back as it was, with empty caches; returns what undoes that."""
        changed = list(self._changed())
        for cached in self._caches:
            cached.cache_clear()
        for place, then, _ in changed:
            place.put(then)

        def undo() -> None:
            for place, _, now in changed:
                place.put(now)

        return undo

    def changes(self) -> list[str]:
        """What is different now, as in ``closure variable `tripped`: False -> True``."""
        found = []
        for place, then, now in self._changed():
            if not isinstance(then, dict):
                found.append(_line(place.name, then, now))
                continue
            for key in {**then, **now}:
                was, has = (each.get(key, _ABSENT) for each in (then, now))
                if not _same(was, has):
                    path = f"{key}" if place.name[-1] == "." else f"[{key!r}]"
                    found.append(_line(f"{place.name}{path}", was, has))
        return found[:_MOST_NAMED]

    def may_have_changed(self) -> bool:
        """Whether something is different now, or may be where nobody can look."""
        return not self._is_whole or any(True for _ in self._changed())

    def coarse(self) -> list[str]:
        """Numbers with fewer digits than float64, as in ``closure variable `a` in float32``."""
        return [
            f"{_called(place.name)} in {then.dtype}"
            for place, then in zip(self._places, self._then, strict=True)
            if isinstance(then, np.ndarray | np.generic) and str(then.dtype) in TOO_COARSE
        ]

    def _changed(self) -> Iterator[tuple[_Place, Any, Any]]:
        for place, then in zip(self._places, self._then, strict=True):
            if not _same(then, place.look()):
                yield place, then, place.take()


def _line(name: str, was: Any, has: Any) -> str:
    return f"{_called(name)}: {_words(was)} -> {_words(has)}"


def _called(name: str) -> str:
    kind, path = name.split(" ", 1)
    return f"{kind.replace('-', ' ')} `{path}`"


def _words(value: Any) -> str:
    if isinstance(value, list | collections.deque | set) and len(value) > _MOST_NAMED:
        return f"{type(value).__name__} of {len(value)}"
    value = value.item() if isinstance(value, np.generic) else value
    return "nothing" if value is _ABSENT else shown(value)


def _same(a: Any, b: Any) -> bool:
    """Whether two contents are the same: numbers by value, objects in them by identity."""
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        same_kind = (a.shape, a.dtype) == (b.shape, b.dtype)
        return same_kind and bool(np.all((a == b) | (a != a) & (b != b)))
    if isinstance(a, _PLAIN):
        return a == b or (a != a and b != b)
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(_same(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple | collections.deque):
        return len(a) == len(b) and all(map(_same, a, b))
    return isinstance(a, set) and a == b


def _places(*roots: tuple[str, Any]) -> tuple[list[_Place], list[Any], bool]:
    """All places that can be reached from named things, the nearest first; the functions on the
    way that cache what they return; and whether that is all.
    """
    found: list[_Place] = []
    # By identity, and alive, so that no other object has that one.
    seen: dict[int, Any] = {}
    size = 0
    waiting = collections.deque(roots)
    while waiting and len(found) < _MOST_PLACES and len(seen) < 10 * _MOST_PLACES:
        name, thing = waiting.popleft()
        if id(thing) in seen or isinstance(thing, _PLAIN):
            continue
        seen[id(thing)] = thing
        if isinstance(thing, np.ndarray):
            size += thing.nbytes
            if not thing.flags.writeable or thing.dtype.hasobject or size > _MOST_BYTES:
                continue
        own, inner = _looked_into(name, thing)
        found += own
        waiting += inner
    caches = [each for each in seen.values() if isinstance(each, functools._lru_cache_wrapper)]
    return found, caches, not waiting and not any(map(_hides, seen.values()))


def _hides(thing: Any) -> bool:
    """Whether a thing may remember what nobody can look at."""
    if isinstance(thing, types.FunctionType) and not _of_a_library(thing.__code__.co_filename):
        return not _ANY_NAME.isdisjoint(_names(thing.__code__))
    return isinstance(thing, Iterator)


Named = list[tuple[str, Any]]


def _looked_into(name: str, thing: Any) -> tuple[list[_Place], Named]:
    """The places of a thing itself, and what is in it, by name."""
    if isinstance(thing, np.ndarray):
        put = functools.partial(thing.__setitem__, ...)
        return [_Place(name, lambda: thing, put, thing.copy)], []
    if isinstance(thing, dict):
        own = [_container(name, thing, "update")]
        return own, [(f"{name}[{key!r}]", each) for key, each in _some(thing.items())]
    if isinstance(thing, list | collections.deque):
        own = [_container(name, thing, "extend")]
        return own, [(f"{name}[{index}]", each) for index, each in _some(enumerate(thing))]
    if isinstance(thing, set):
        return [_container(name, thing, "update")], []
    if isinstance(thing, tuple | frozenset):
        return [], [(name, each) for each in _some(thing)]
    if isinstance(thing, types.FunctionType):
        return _function(thing)
    if isinstance(thing, types.MethodType):
        return [], [(name, thing.__func__), ("attribute self", thing.__self__)]
    if isinstance(thing, functools.partial):
        given = [("bound-argument args", thing.args), ("bound-argument keywords", thing.keywords)]
        return [], [(name, thing.func), *given]
    if isinstance(thing, type):
        return _class(thing)
    if isinstance(thing, types.ModuleType):
        return [], []
    return _object(name, thing)


def _some(entries: Iterable[Any]) -> Iterable[Any]:
    return itertools.islice(entries, _MOST_PLACES)


def _container(name: str, thing: Any, fill: str) -> _Place:
    def put(content: Any) -> None:
        thing.clear()
        getattr(thing, fill)(content)

    return _Place(name, lambda: thing, put, lambda: copy.copy(thing))


def _function(function: Any) -> tuple[list[_Place], Named]:
    if _of_a_library(function.__code__.co_filename):
        return [], []
    found, inner = [], []
    cells = function.__closure__ or ()
    for name, cell in zip(function.__code__.co_freevars, cells, strict=True):
        own = _attribute(f"closure-variable {name}", cell, "cell_contents")
        found.append(own)
        inner.append((own.name, own.take()))
    names = set(_names(function.__code__))
    spaces = [("", function.__globals__)]
    for name in names & function.__globals__.keys():
        value = function.__globals__[name]
        if isinstance(value, types.ModuleType) and not _of_a_library(_file_of(value)):
            spaces.append((f"{name}.", vars(value)))
    for prefix, space in spaces:
        for name in sorted(names & space.keys()):
            own = _entry(f"global-variable {prefix}{name}", space, name)
            found.append(own)
            inner.append((own.name, own.take()))
    code, defaults = function.__code__, function.__defaults__ or ()
    named = dict(zip(code.co_varnames[code.co_argcount - len(defaults) :], defaults, strict=False))
    named |= function.__kwdefaults__ or {}
    inner += [(f"default-value {name}", value) for name, value in named.items()]
    attributes = f"attribute {function.__name__}."
    found.append(_container(attributes, function.__dict__, "update"))
    inner += [(f"{attributes}{name}", value) for name, value in vars(function).items()]
    return found, inner


def _names(code: types.CodeType) -> Iterator[str]:
    """The names of global variables and attributes in a function, and in functions in it."""
    yield from code.co_names
    for each in code.co_consts:
        if isinstance(each, types.CodeType):
            yield from _names(each)


def _class(kind: type) -> tuple[list[_Place], Named]:
    found, inner = [], []
    for one in kind.__mro__:
        if _of_a_library(_file_of(sys.modules.get(one.__module__))) or one is object:
            continue
        for name, value in vars(one).items():
            if isinstance(value, types.FunctionType | staticmethod | classmethod | property):
                function = getattr(value, "fget", getattr(value, "__func__", value))
                inner.append((f"attribute {kind.__name__}.{name}", function))
            elif not name.startswith("__"):
                found.append(_attribute(f"attribute {one.__name__}.{name}", one, name))
                inner.append((found[-1].name, value))
    return found, inner


def _object(name: str, thing: Any) -> tuple[list[_Place], Named]:
    found = []
    own = getattr(thing, "__dict__", None)
    inner: Named = [(name, type(thing))]
    if isinstance(own, dict):
        found.append(_container(f"{name}.", own, "update"))
        inner += [(f"{name}.{key}", value) for key, value in own.items()]
    for one in type(thing).__mro__:
        slots = one.__dict__.get("__slots__", ())
        for slot in (slots,) if isinstance(slots, str) else tuple(slots):
            if slot not in ("__dict__", "__weakref__") and not slot.startswith("__"):
                found.append(_attribute(f"{name}.{slot}", thing, slot))
                inner.append((found[-1].name, found[-1].take()))
    return found, inner


def _attribute(name: str, thing: Any, key: str) -> _Place:
    def take() -> Any:
        try:
            return getattr(thing, key)
        except (AttributeError, ValueError):
            # Of a cell that is empty.
            return _ABSENT

    def put(value: Any) -> None:
        delattr(thing, key) if value is _ABSENT else setattr(thing, key, value)

    return _Place(name, take, put, take)


def _entry(name: str, space: dict[str, Any], key: str) -> _Place:
    def put(value: Any) -> None:
        if value is _ABSENT:
            space.pop(key, None)
        else:
            space[key] = value

    look = functools.partial(space.get, key, _ABSENT)
    return _Place(name, look, put, look)


def _file_of(module: Any) -> str:
    """The file of a module; that of a built-in one counts as frozen."""
    if module is None or module.__name__ == "__main__":
        return ""
    return getattr(module, "__file__", None) or (
        "<frozen>" if module.__name__ in sys.builtin_module_names else ""
    )


def _of_a_library(file: str) -> bool:
    return file.startswith(_LIBRARIES)
