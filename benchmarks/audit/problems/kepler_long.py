"""The Kepler problem with a frame for each unit of time, for runs over many of them."""

import math

from ropeode.problems.kepler import kepler


def kepler_long(frames=64):
    """A period is 2 pi."""
    return kepler(frames=frames, periods=frames / (2.0 * math.pi))
