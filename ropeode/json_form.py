"""What JSON says of a value: its fields, or what its class names in place of them."""

from __future__ import annotations

import functools
import json
import types
import typing
from collections.abc import Callable, Mapping
from typing import Annotated, Any, TypeVar, Union

import numpy as np
from pydantic import TypeAdapter, WithJsonSchema
from pydantic_core import core_schema
from typing_extensions import TypedDict

T = TypeVar("T")

# A number that may be infinite, or not a number: then it is null in JSON.
Unbounded = Annotated[float, WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "null"}]})]


def json_shows(*shown: str) -> Callable[[type[T]], type[T]]:
    """JSON shows these attributes of a class, in this order, and no others.

    Arguments:
        shown: an attribute, or ``attribute.attribute``, which is null where the first is None. Its
            key is the last name, or another that stands before it, as in ``dt=step.size``.
    """
    keys = {}
    for each in shown:
        key, _, path = each.rpartition("=")
        keys[key or path.rpartition(".")[2]] = path

    def form(cls: type) -> Any:
        types_of = {key: of_path(cls, path)[2] for key, path in keys.items()}
        made: Any = TypedDict(cls.__name__, types_of)  # type: ignore[operator]
        made.shows = cls, keys
        return made

    return _shown_as(form, lambda value: {key: _at(value, path) for key, path in keys.items()})


def json_as(kind: Any, convert: Callable[[Any], Any]) -> Callable[[type[T]], type[T]]:
    """JSON shows another value in place of those of a class.

    Arguments:
        kind: of the other value.
        convert: makes it.
    """
    return _shown_as(lambda _: kind, convert)


def _shown_as(form: Callable[[type], Any], convert: Any) -> Callable[[type[T]], type[T]]:
    def decorate(cls: type[T]) -> type[T]:
        @functools.cache
        def kind() -> Any:
            return form(cls)

        def schema(_: type, source: Any, handler: Any) -> Any:
            shown = core_schema.plain_serializer_function_ser_schema(
                convert, return_schema=handler.generate_schema(kind())
            )
            return core_schema.any_schema(serialization=shown)

        cls.__get_pydantic_core_schema__ = classmethod(schema)  # type: ignore[attr-defined]
        return cls

    return decorate


def of_path(cls: Any, path: str) -> tuple[type, str, Any]:
    """The class that has the last attribute of a path, its name, and the type that JSON has."""
    *way, name = path.split(".")
    missing = False
    for each in way:
        kinds = [kind for kind in _alternatives(_hint(cls, each)) if kind is not types.NoneType]
        missing |= len(kinds) < len(_alternatives(_hint(cls, each)))
        (cls,) = kinds
    hint = Union[tuple(map(_without_arrays, _alternatives(_hint(cls, name))))]  # noqa: UP007
    return cls, name, Union[hint, None] if missing else hint  # noqa: UP007


def _hint(cls: type, name: str) -> Any:
    own = getattr(cls, name, None)
    if isinstance(own, property):
        return typing.get_type_hints(own.fget, include_extras=True)["return"]
    return typing.get_type_hints(cls, include_extras=True)[name]


def _alternatives(hint: Any) -> tuple[Any, ...]:
    of = typing.get_origin(hint)
    return typing.get_args(hint) if of in (Union, types.UnionType) else (hint,)


def _without_arrays(hint: Any) -> Any:
    return list[Unbounded] if hint is np.ndarray else hint


def _at(value: Any, path: str) -> Any:
    for name in path.split("."):
        value = None if value is None else getattr(value, name)
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return dict(value) if isinstance(value, Mapping) else value


def json_of(value: Any) -> Any:
    """A value as JSON has it; numbers that are not finite are null."""
    # A number of NumPy is one, whatever pydantic says of its type.
    text = adapter(type(value)).dump_json(value, fallback=lambda n: n.tolist(), warnings=False)
    return json.loads(text)


@functools.cache
def adapter(kind: type) -> TypeAdapter[Any]:
    """What makes JSON of such values, and its schema."""
    return TypeAdapter(kind)
