"""Checked input: each field says what it allows, and all faults are reported at once."""

from __future__ import annotations

import difflib
import functools
import importlib
import inspect
import math
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import ModuleType
from typing import Annotated, Any, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    NonNegativeFloat,
    ValidationError,
)
from pydantic_core import PydanticCustomError

from ropeode.errors import InputError, RopeodeError, UserCodeError

T = TypeVar("T")

_TRACED = "a value that JAX traces"
_LONGEST_VALUE_SHOWN = 60
_LONGEST_TEXT_SHOWN = 200
_LONGEST_PART = 600
# Bytes that a sample time takes, in the problem and while it is checked.
_OF_A_TIME = 64
# Larger whole numbers are no longer all different in float64.
MOST_COUNTED = 2**53
# Of names that are allowed, all are shown up to so many; of more than that the likest ones.
_MOST_NAMES, _LIKEST = 24, 8


def field(default: Any, *, allowed: str, example: str) -> Any:
    """A field of an `Input`, with the words that its error message needs.

    Arguments:
        default: the value if the field is left out.
        allowed: what is allowed, as it ends the sentence "allowed: ...".
        example: a valid value, as the user types it.
    """
    return Field(default, json_schema_extra={"allowed": allowed, "example": example})


class Input(BaseModel):
    """Base of all checked input: immutable, finite numbers only, unknown names refused.

    Raises:
        InputError: with one line for each field that cannot be used.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True, defer_build=True)

    @classmethod
    def __pydantic_init_subclass__(cls, **others: Any) -> None:
        """Let help and completion show names and defaults, and no validators."""
        super().__pydantic_init_subclass__(**others)
        kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
        parameters = [
            inspect.Parameter(name, kind)
            if each.is_required()
            else inspect.Parameter(name, kind, default=each.default)
            for name, each in cls.model_fields.items()
        ]
        # Those without a default come first.
        parameters.sort(key=lambda each: each.default is not inspect.Parameter.empty)
        cls.__signature__ = inspect.Signature(parameters)

    def __init__(self, /, *values: Any, **named: Any):
        cls = type(self)
        if len(values) > len(cls.model_fields):
            raise InputError(
                f"{cls.__name__}: {len(values)} values given; allowed: at most "
                f"{len(cls.model_fields)}. Fix: name them, as in "
                f"{cls.__name__}({next(iter(cls.model_fields))}=...)."
            )
        try:
            super().__init__(**dict(zip(cls.model_fields, values, strict=False)), **named)
        except ValidationError as error:
            raise InputError(_lines(cls, error)) from None


def fault_of(name: str, given: Any, why: str) -> PydanticCustomError:
    """A fault that the check of one field reports about another.

    Arguments:
        name: the field to blame.
        given: its value.
        why: what is wrong with it.
    """
    return PydanticCustomError("fault_of", "{why}", {"name": name, "given": given, "why": why})


def _lines(model: type[Input], error: ValidationError) -> list[str]:
    """One line per field; a field with several faults is reported once."""
    lines: dict[str, str] = {}
    for fault in error.errors():
        context = fault.get("ctx", {})
        name = str(context["name"] if "name" in context else fault["loc"][0])
        cause = context.get("error")
        if isinstance(cause, InputError):
            lines.update({line: line for line in cause.problems})
            continue
        if fault["type"] == "extra_forbidden":
            lines[name] = unknown("field", name, model.model_fields)
            continue
        extra = model.model_fields[name].json_schema_extra
        words = extra if isinstance(extra, Mapping) else {}
        why = context.get("why", cause)
        lines.setdefault(
            name,
            complaint(
                name,
                ... if fault["type"] == "missing" else context.get("given", fault["input"]),
                f"{words.get('allowed')} ({why})" if why else str(words.get("allowed")),
                f"for example {name} = {words.get('example')}",
            ),
        )
    return list(lines.values())


def bad_value(name: str, given: Any, allowed: str, fix: str) -> InputError:
    """The exception for one bad value, to be raised; `complaint` is its message."""
    return InputError(complaint(name, given, allowed, fix))


def complaint(name: str, given: Any, allowed: str, fix: str) -> str:
    """The one form in which every bad value is reported; one that is missing is `...`."""
    if is_traced(given):
        return str(traced_value(name, allowed))
    words = "nothing" if given is ... else shown(given)
    # They too may hold what was given.
    name, allowed, fix = (cut(text, _LONGEST_PART) for text in (name, allowed, fix))
    return f"{name}: {words} given; allowed: {allowed}. Fix: {fix}."


def traced_value(name: str, allowed: str) -> InputError:
    """The exception for what JAX traces, to be raised.

    Arguments:
        name: of the value, or of the function that was called.
        allowed: in its place.
    """
    return InputError(
        f"{name}: {_TRACED} given; allowed: {allowed} outside of JAX's transformations, where "
        "ropeode computes in NumPy. Fix: in jit, grad and vmap use ropeode.jax_stepper(problem, "
        "stepper), made outside, whose `states` take traced y0 and args; "
        "docs/howto/jax.md shows how."
    )


def is_traced(value: Any) -> bool:
    """Whether JAX traces a value, or a part of it."""
    # What was never imported traces nothing.
    jax = sys.modules.get("jax")
    if jax is None:
        return False
    try:
        leaves = jax.tree.leaves(value)
    except ValueError:
        # No pytree.
        return False
    return any(isinstance(leaf, jax.core.Tracer) for leaf in leaves)


def check_kind(name: str, value: Any, kind: type, maker: str) -> None:
    """Refuse what is not a result of some type.

    Arguments:
        name: of the argument.
        value: to be checked.
        kind: what it must be.
        maker: the public function that returns such results.

    Raises:
        InputError: it is something else.
    """
    if not isinstance(value, kind):
        allowed = f"results of type {kind.__name__}"
        raise bad_value(name, value, allowed, f"make one with ropeode.{maker}")


def not_traced(name: str, value: Any) -> None:
    """Raises:
    InputError: JAX traces the value, or a part of it.
    """
    if is_traced(value):
        raise bad_value(name, value, "numbers", "")


def shown(value: Any) -> str:
    """A value in an error message, cut if it is long."""
    try:
        text = repr(value)
    except Exception:
        # Python writes no whole number of more than 4300 digits, and nothing nested deeply.
        text = f"a value of type {type(value).__name__}"
    longest = _LONGEST_TEXT_SHOWN if isinstance(value, str) else _LONGEST_VALUE_SHOWN
    return cut(" ".join(text.split()), longest)


def cut(text: str, longest: int = _LONGEST_TEXT_SHOWN) -> str:
    """A text of which no more than so many characters are left."""
    return text if len(text) <= longest else text[: longest - 3] + "..."


def listed(values: Iterable[Any]) -> str:
    """Words or numbers in a row, with "and" before the last."""
    *first, last = map(str, values)
    return f"{', '.join(first)} and {last}" if first else last


def numbered(noun: str, numbers: Iterable[int]) -> str:
    """Things by their numbers: node 1, nodes 2 and 3."""
    every = [*numbers]
    return f"{noun}{'' if len(every) == 1 else 's'} {listed(every)}"


def counted(number: int, noun: str) -> str:
    """A number of things: 1 run, 2 runs."""
    return f"{number} {noun}" + ("" if number == 1 else "s")


def in_one_line(error: Exception) -> str:
    """The message of an exception in one line, with its type unless it is one of ropeode's own."""
    text = " ".join(str(error).split()) or "no message"
    return text if isinstance(error, RopeodeError) else f"{type(error).__name__}: {text}"


def shortly(error: BaseException) -> str:
    """The type of an exception and the first line of its message, cut if it is long."""
    text = next((line.strip() for line in str(error).splitlines() if line.strip()), "no message")
    return cut(f"{type(error).__name__}: {text.rstrip('.')}")


def unknown(kind: str, name: str, allowed: Iterable[str], also: Iterable[str] = ()) -> str:
    """The complaint about a name that does not exist, with the nearest that does.

    Of many names that exist, only those are shown that are most like it.

    Arguments:
        kind: what it should name.
        name: that does not exist.
        allowed: all names.
        also: forms of further names, all of which are shown.
    """
    names = list(allowed)
    # A word of a name, as "euler" is of "explicit-euler", may be all that was meant to be typed.
    words = {word: each for each in reversed(names) for word in each.lower().split("-")}
    in_lower_case = words | {each.lower(): each for each in names}
    near = difflib.get_close_matches(name.lower(), in_lower_case, n=1, cutoff=0.4)
    fix = f"did you mean {in_lower_case[near[0]]!r}?" if near else "use one of these."
    named = names
    if len(names) > _MOST_NAMES:
        like = difflib.get_close_matches(name.lower(), in_lower_case, n=_MOST_NAMES, cutoff=0.3)
        likest = list(dict.fromkeys([*(in_lower_case[each] for each in like), *names]))[:_LIKEST]
        named = [*likest, f"{len(names) - len(likest)} others"]
    all_of_it = ", ".join([*named, *also])
    return f"{kind}: {shown(name)} given, which does not exist; allowed: {all_of_it}. Fix: {fix}"


def _refuse_traced(value: Any) -> None:
    # What is no array of JAX costs nothing.
    if hasattr(value, "aval") and is_traced(value):
        raise ValueError(_TRACED)


def plain(value: Any) -> Any:
    """NumPy and JAX arrays and scalars as nested lists and numbers.

    Raises:
        ValueError: JAX traces it.
    """
    _refuse_traced(value)
    return value.tolist() if hasattr(value, "tolist") else value


def require_all_digits(value: Any) -> None:
    """Raises:
    ValueError: it holds a number in less than float64 that would be another one in float64.
    """
    dtype = getattr(value, "dtype", None)
    _refuse_traced(value)
    if dtype is None or dtype.kind not in "fV" or dtype.itemsize >= 8:
        return
    for each in value.ravel():
        if float(str(each)) != float(each):
            raise ValueError(
                f"it is in {dtype}, where {each!s} is {float(each)!r}; arrays of JAX are float32 "
                "outside of its float64 mode"
            )


def finite_number(value: Any) -> float:
    """`value` as a finite float.

    Raises:
        ValueError: it is not a number, not a finite one, or has fewer digits than float64.
    """
    require_all_digits(value)
    value = plain(value)
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"{shown(value)} is not a number")
    try:
        number = float(value)
    except ValueError:
        raise ValueError(f"{shown(value)} is not a number") from None
    except OverflowError:
        raise ValueError(f"{shown(value)} does not fit into a float64") from None
    if not math.isfinite(number):
        raise ValueError(f"{number} is not finite")
    return number


def positive_number(value: Any) -> float:
    """`value` as a finite float above zero.

    Raises:
        ValueError: it is not one.
    """
    number = finite_number(value)
    if number <= 0:
        raise ValueError(f"{number} is not above zero")
    return number


def whole_number(value: Any, *, at_least: int) -> int:
    """`value` as an int not below `at_least`.

    Raises:
        ValueError: it is not a whole number, or too small, or so large that float64 cannot count.
    """
    number = finite_number(value)
    if abs(number) > MOST_COUNTED:
        raise ValueError(f"it is beyond {MOST_COUNTED}, up to which float64 counts")
    if number != int(number):
        raise ValueError(f"{shown(plain(value))} is not whole")
    if number < at_least:
        raise ValueError(f"{int(number)} is below {at_least}")
    return int(number)


def finite_numbers(
    value: Any, *, count: int | None = None, above_zero: bool = False
) -> tuple[float, ...]:
    """A sequence of finite floats as a tuple.

    Arguments:
        value: the sequence.
        count: how many there must be; None for any number.
        above_zero: whether each must be above zero.

    Raises:
        ValueError: it is not such a sequence.
    """
    require_all_digits(value)
    value = plain(value)
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise ValueError(f"{shown(value)} is not a list of numbers")
    numbers = tuple(finite_number(entry) for entry in value)
    if count is not None and len(numbers) != count:
        raise ValueError(f"{len(numbers)} given in place of {count}")
    if above_zero and min(numbers, default=1.0) <= 0:
        raise ValueError(f"{min(numbers)} is not above zero")
    return numbers


# Types of arguments. The last entry says what is allowed, as in `field`.
Finite = Annotated[float, BeforeValidator(finite_number), "a finite number"]
Positive = Annotated[float, BeforeValidator(positive_number), "a finite number > 0"]
NonNegative = Annotated[NonNegativeFloat, BeforeValidator(finite_number), "a finite number >= 0"]
FiniteTuple = Annotated[Sequence[float], BeforeValidator(finite_numbers), "finite numbers"]
FinitePair = Annotated[
    Sequence[float],
    BeforeValidator(functools.partial(finite_numbers, count=2)),
    "two finite numbers",
]
PositivePair = Annotated[
    Sequence[float],
    BeforeValidator(functools.partial(finite_numbers, count=2, above_zero=True)),
    "two finite numbers > 0",
]
FiniteTriple = Annotated[
    Sequence[float],
    BeforeValidator(functools.partial(finite_numbers, count=3)),
    "three finite numbers",
]
WholePositive = Annotated[
    int, BeforeValidator(functools.partial(whole_number, at_least=1)), "a whole number >= 1"
]


def check_whole(name: str, value: Any, *, at_least: int, example: str) -> int:
    """A plain argument that must be a whole number.

    Arguments:
        name: of the argument.
        value: of the argument.
        at_least: the smallest number allowed.
        example: a valid value, as the user types it.

    Raises:
        InputError: it is not a whole number, or too small.
    """
    check = functools.partial(whole_number, at_least=at_least)
    return _checked(name, value, check, f"a whole number >= {at_least}", example)


def check_positive(name: str, value: Any, *, example: str) -> float:
    """A plain argument that must be a positive finite number.

    Arguments:
        name: of the argument.
        value: of the argument.
        example: a valid value, as the user types it.

    Raises:
        InputError: it is not one.
    """
    return _checked(name, value, positive_number, "a finite number > 0", example)


def _checked(name: str, value: Any, check: Callable[[Any], T], allowed: str, example: str) -> T:
    try:
        return check(value)
    except ValueError as error:
        fix = f"for example {name}={example}"
        given = value if is_traced(value) else plain(value)
        raise bad_value(name, given, f"{allowed} ({error})", fix) from None


def check_memory(
    count: int,
    each: int = _OF_A_TIME,
    field: str = "frames",
    fix: str = "sample fewer frames, with more steps in each",
) -> None:
    """See that there is memory for all samples, before it is taken.

    Arguments:
        count: intervals between the samples, or what `field` counts.
        each: bytes of one; by default those of a sample's time.
        field, fix: of the message.

    Raises:
        InputError: there is not.
    """
    needed, there = count * each, os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if needed > there:
        raise bad_value(
            field,
            count,
            f"as many as fit into memory, {there / 2**30:.3g} GiB; these take "
            f"{needed / 2**30:.3g} GiB",
            fix,
        )


def check_all(*each: Callable[[], Any]) -> list[Any]:
    """Run every check, and raise all faults together.

    Returns:
        what the checks returned.

    Raises:
        InputError: with the lines of all the checks that failed, each line once.
        UserCodeError: the user's code raised; the traceback of its own exception is worth more
            than the other lines.
    """
    results: list[Any] = []
    faults: list[str] = []
    for check in each:
        try:
            results.append(check())
        except UserCodeError:
            raise
        except InputError as error:
            faults.extend(error.problems)
    if faults:
        raise InputError(dict.fromkeys(faults))
    return results


def require(package: str, extra: str, purpose: str) -> ModuleType:
    """A package that not every user needs, imported.

    Arguments:
        package: its name in `import`.
        extra: the extra of ropeode that installs it.
        purpose: what needs it, as a plural noun.

    Raises:
        InputError: it cannot be imported.
    """
    try:
        return importlib.import_module(package)
    except ImportError as error:
        raise InputError(
            f"{package}: it cannot be imported ({error}); allowed: {purpose} only with the extra "
            f"{extra!r}. Fix: in the folder of ropeode's source, pip install '.[{extra}]'"
        ) from None
