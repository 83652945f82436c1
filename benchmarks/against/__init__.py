"""What `benchmarks/peers.py` runs: the work, each peer's way to do it, and the tables."""
