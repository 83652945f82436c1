"""What several tests of this room share."""

from __future__ import annotations

import dataclasses

import pytest

from ropeode import reference


@pytest.fixture(scope="session")
def known(small_rope):
    """The reference of the rope whose trajectories are graded.

    Without parameters it has no rope of the other kind, whose reference takes long;
    test_other_ropes.py has both.
    """
    return dataclasses.replace(reference(small_rope), problem=small_rope.changed(parameters={}))
