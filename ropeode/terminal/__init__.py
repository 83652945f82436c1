"""What commands share at a terminal: progress, Ctrl-C, output and its formats."""
