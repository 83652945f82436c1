"""Sweeps: steppers run on a grid or a random design of problems, one row for each case."""
