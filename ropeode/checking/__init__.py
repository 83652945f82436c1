"""Steppers that users bring: checked, diagnosed, and graded from their trajectories."""
