"""How long a test waits for a process."""

# Only so that one that hangs ends some day; no test may depend on how busy the machine is.
HANGS_AFTER_S = 600
