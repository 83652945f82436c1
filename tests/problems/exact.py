"""Which problems of the library have an exact solution.

A list, because building every problem takes seconds; a test compares it with the library.
"""

EXACT = ("oscillator", "linear-chain", "kepler", "forced", "pendulum")
