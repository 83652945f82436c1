"""Solvers that references and their witnesses are computed with."""
