"""References in more digits than float64 has, by Taylor series of the same right-hand side."""
