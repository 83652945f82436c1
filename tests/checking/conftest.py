"""What several tests of this room share."""

from __future__ import annotations

import pytest

from ropeode import reference


@pytest.fixture(scope="session")
def known(small_rope):
    """The reference of the rope whose trajectories are graded."""
    return reference(small_rope)
