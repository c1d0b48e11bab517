"""Values of planning: domains with their actions, ground problems, plans with their schedule, and limits of work."""
