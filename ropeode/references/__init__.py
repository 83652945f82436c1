"""Reference trajectories and their certificates. Knows nothing of steppers."""
