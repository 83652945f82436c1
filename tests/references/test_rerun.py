"""Witnesses made again are the same runs."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode import reference
from ropeode.norms import distance
from ropeode.references import largest_norms, witness_runs


@pytest.mark.parametrize("rtol", [None, 1e-9])
def test_they_have_the_differences_of_the_certificate(small_rope, rtol):
    known = reference(small_rope, rtol=rtol)
    check(known)


def check(known):
    again = list(witness_runs(known))
    assert [role for role, _ in again] == [w.role for w in known.certificate.witnesses]
    for (_, run), witness in zip(again, known.certificate.witnesses, strict=True):
        assert (run.solver, run.rtol) == (witness.solver, witness.tolerance)
        for quantity, norm in largest_norms(known.problem).items():
            apart = distance(known.problem, norm, run.states, known.states)
            np.testing.assert_array_equal(apart, witness.differences[quantity][: len(apart)])
