"""A question to submissions that are lines of code, which may do any harm."""

from __future__ import annotations

import dataclasses
import os
import signal
import time

from ropeode.classroom import Asked
from ropeode.errors import RopeodeError
from ropeode.sandbox import MEBIBYTE, Limits


@dataclasses.dataclass(frozen=True)
class Harm(Asked):
    """Runs the code, without a check, which would take longer than what is tested."""

    refused, ahead = "refused", ()
    limits = Limits(cpu=1.0, wall=8.0, memory=300.0 * MEBIBYTE)

    def report(self, where, folder, scratch, say):
        say("harm")
        exec(where[0], {"os": os, "signal": signal, "time": time})
        raise RopeodeError(f"it lives, in {len(os.listdir())} files")
