"""Studies: many runs, compared with one reference."""
