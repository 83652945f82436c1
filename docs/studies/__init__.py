"""Studies of the published report's open questions, which only the documentation shows."""
