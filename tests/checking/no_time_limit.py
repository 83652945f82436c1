"""`check_stepper` without a time limit that a busy machine could reach."""

from __future__ import annotations

import functools

from ropeode import check_stepper as with_time_limit

SECONDS = 1e6
check_stepper = functools.partial(with_time_limit, time_limit=SECONDS)
