"""A command that is interrupted by Ctrl-C."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

from tests.time_limit import HANGS_AFTER_S


def interrupt(arguments, after, folder, environment):
    """Exit code, output and errors of a process that is interrupted.

    Arguments:
        arguments: of the command, which would take minutes.
        after: seconds from the moment on that it has begun to import JAX.
        folder: in which it runs.
        environment: its variables.
    """
    process = subprocess.Popen(
        [sys.executable, "-m", "ropeode", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
        env=environment,
    )
    maps = Path(f"/proc/{process.pid}/maps")
    while "numpy" not in maps.read_text():
        time.sleep(0.01)
    time.sleep(after)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=HANGS_AFTER_S)
    return process.returncode, out, err
