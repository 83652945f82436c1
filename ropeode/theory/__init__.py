"""A stepper as a map near dt = 0: what it solves, of which order, and where it is unstable."""
