"""`check_stepper` without a time limit that a busy machine could reach."""

from __future__ import annotations

import functools

from ropeode.checking import check

SECONDS = 1e6
check_stepper = functools.partial(check.check_stepper, time_limit=SECONDS)
