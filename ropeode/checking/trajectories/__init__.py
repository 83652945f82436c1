"""Trajectories that other programs wrote: read in blocks and checked while reading."""
