"""What a trajectory is worth: errors, round-off, observed order."""
