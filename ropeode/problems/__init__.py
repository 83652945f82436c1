"""Initial value problems: what is solved."""
