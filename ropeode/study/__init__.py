"""Studies: many runs, judged together."""
