"""``python -m ropeode`` is the command `ropeode`."""

from ropeode.cli.main import main

main()
