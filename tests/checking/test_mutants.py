"""The checks reject wrong steppers: a stored record of all, and a part of them again here."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ropeode.checking import CHECKS
from tests.checking.mutants.all import (
    AT_LAST,
    LOOPS,
    MUTANTS,
    REFUSED,
    SURVIVORS,
    UNCLAIMED,
    rejected_by,
)
from tests.checking.mutants.kept import KEPT
from tests.checking.mutants.mutant import from_source, source_of
from tests.checking.mutants.originals import trajectory

# Made by benchmarks/mutants.py, with all checks.
RECORD = {
    line["name"]: line
    for line in map(
        json.loads,
        (Path(__file__).parents[2] / "docs/data/mutants.jsonl").read_text().splitlines(),
    )
}
# Every so many-th mutant is checked again, by the cheapest of the checks that reject it: a few
# steps or the runs of one problem, rather than long runs and derivatives. Of those, and of the
# programs, every so many-th is checked at each change; the others are slow tests.
EVERY, EVERY_FAST = 9, 25
LAST = ("symplectic", *AT_LAST)
ORDERS = tuple(name for name in CHECKS if name.startswith("order-"))
CHEAP = [name for name in CHECKS if name not in (*ORDERS, *LAST, *UNCLAIMED)] + [*ORDERS]
AGAIN = [
    name for name in list(MUTANTS)[::EVERY] if name not in SURVIVORS and MUTANTS[name] not in LOOPS
]


def mostly_slow(values):
    return [
        pytest.param(value, marks=pytest.mark.slow if i % EVERY_FAST else [])
        for i, value in enumerate(values)
    ]


def test_the_record_is_of_these_mutants_and_says_why_one_survives():
    assert set(RECORD) == set(MUTANTS)
    for name, mutant in MUTANTS.items():
        assert (mutant.family, mutant.change) == (RECORD[name]["family"], RECORD[name]["change"])
    assert len(MUTANTS) >= 300
    assert {name for name, line in RECORD.items() if not line["rejected_by"]} == set(SURVIVORS)


@pytest.mark.parametrize("name", mostly_slow(AGAIN))
def test_wrong_steppers_are_rejected(name):
    by = RECORD[name]["rejected_by"]
    if by == [REFUSED]:
        assert rejected_by(MUTANTS[name]) == by
    elif MUTANTS[name] in KEPT:
        # What it does depends on earlier calls.
        assert rejected_by(MUTANTS[name], CHEAP)
    else:
        only = [next(check for check in (*CHEAP, *UNCLAIMED, *LAST) if check in by)]
        assert rejected_by(MUTANTS[name], only) == only


@pytest.mark.slow
@pytest.mark.parametrize("name", SURVIVORS)
def test_survivors_are_not_rejected_by_the_checks_that_take_little_time(name):
    assert rejected_by(MUTANTS[name], CHEAP) == []


@pytest.mark.parametrize("mutant", mostly_slow(LOOPS), ids=lambda mutant: mutant.name)
def test_wrong_programs_are_rejected(mutant):
    assert rejected_by(mutant) == RECORD[mutant.name]["rejected_by"] != []


def test_the_right_program_is_not():
    assert rejected_by(from_source(trajectory, "right", "nothing", source_of(trajectory))) == []
