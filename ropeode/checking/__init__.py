"""Checks of users' steppers, the diagnosis of wrong ones, and grades for trajectories."""
