"""What a sweep runs: cases from a grid or a random design."""
