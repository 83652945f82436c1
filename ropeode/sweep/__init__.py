"""Sweeps: a grid or a random design of problems, steppers and step sizes, case by case."""
