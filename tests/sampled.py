"""Tests of everything that is registered, of which the fast tests take a sample."""

from __future__ import annotations

from collections.abc import Iterable

import pytest


def sampled(names: Iterable[str], fast: Iterable[str]) -> list:
    """A parameter for each name; those that are not among the fast ones are slow."""
    marks = {name: () if name in fast else pytest.mark.slow for name in names}
    return [pytest.param(name, marks=mark) for name, mark in marks.items()]
