"""Trajectories that other programs wrote: read in blocks, and checked as they are read."""
