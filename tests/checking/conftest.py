"""What several tests of this room share."""

from __future__ import annotations

import pytest

from tests.exact_reference import rope_reference


@pytest.fixture(scope="session")
def known(small_rope):
    """The reference of the rope whose trajectories are graded.

    Without parameters it has no rope of the other kind, whose reference takes long;
    test_other_ropes.py has both.
    """
    return rope_reference(small_rope.changed(parameters={}))
