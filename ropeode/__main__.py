"""``python -m ropeode`` is the command `ropeode`."""

from ropeode.cli.main import run_process

run_process()
