"""``python -m ropeode`` is the command `ropeode`."""

from ropeode.cli import run_process

run_process()
