"""What a stepper that failed a check solves instead, or what costs it its order."""
