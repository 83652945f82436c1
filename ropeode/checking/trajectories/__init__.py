"""Trajectories that other programs wrote: read and checked."""
