"""What can be done with every result: a line of it, a page of blocks, and rows of numbers."""

from __future__ import annotations

import functools
import importlib
from typing import Any

from ropeode.render.markup import Block, Paragraph

# The module that writes a kind of result, where it is not one of the small ones. It is imported
# with the first such result: few commands have two kinds.
_MODULES = {
    "AccuracyTable": "accuracy_table",
    "CheckReport": "check",
    "Explanation": "explanation",
    "Facts": "reference",
    "Horizon": "horizon",
    "SweepSummary": "sweep",
    "WorkPrecision": "work_precision",
}


@functools.singledispatch
def line(result: Any) -> str:
    """A result in a line, without its type."""
    return _registered(line, result)(result)


@functools.singledispatch
def blocks(result: Any) -> list[Block]:
    """A result as headings, paragraphs, tables and pictures; by default its line."""
    try:
        found = _registered(blocks, result)
    except TypeError:
        return [Paragraph(f"{type(result).__name__}: {line(result)}")]
    return found(result)


@functools.singledispatch
def rows(result: Any) -> Any:
    """The numbers of a result: a list of rows, each a value by column, or columns by name."""
    return _registered(rows, result)(result)


def _registered(function: Any, result: Any) -> Any:
    """What a function does with such a result, once the module that says so is imported."""
    kind = type(result)
    importlib.import_module(f"ropeode.render.{_MODULES.get(kind.__name__, 'small_results')}")
    found = function.dispatch(kind)
    if found is function.dispatch(object):
        raise TypeError(f"no renderer for {kind.__name__}")
    return found
