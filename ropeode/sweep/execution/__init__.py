"""Where and how a sweep runs: tasks, worker processes, and the rows that they return."""
