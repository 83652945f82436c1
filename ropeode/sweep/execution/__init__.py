"""How a sweep runs: engines that compute tasks, and the rows of a task."""
