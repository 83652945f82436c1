"""Work that compiles tells so, and is left off between two programs."""

from __future__ import annotations

import importlib
import sys

import jax
import jax.numpy as jnp
import pytest

from ropeode.laboratory import told_of


class LeftOff(BaseException):
    pass


def leave_off(*_):
    raise LeftOff


def test_each_program_is_a_sign_of_life_and_work_is_left_off_between_two():
    said, shape = [], jnp.ones(3)
    double = jax.jit(lambda x: 2.0 * jnp.sin(x))
    with told_of(lambda *what: said.append(what)) as progress:
        progress("begun", 0.25)
        double(1.0)
        before = len(said)
        double(2.0)
    assert before > 1
    assert said == before * [("begun", 0.25)]

    with pytest.raises(LeftOff), told_of(leave_off):
        double(shape)
    # It can be done again, and is no longer heard of.
    assert double(0.0 * shape).tolist() == [0.0] * 3
    assert len(said) == before


def test_what_is_imported_is_imported_to_its_end(tmp_path, monkeypatch):
    (tmp_path / "compiles_when_imported.py").write_text(
        "import jax\nfound = jax.jit(lambda x: x + 1.25)(1.0)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with told_of(leave_off):
        module = importlib.import_module("compiles_when_imported")
    assert module.found == 2.25
    del sys.modules["compiles_when_imported"]
