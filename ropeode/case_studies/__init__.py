"""Published experiments run again, claim by claim."""
