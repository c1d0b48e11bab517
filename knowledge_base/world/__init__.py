"""A world in memory: what may be said of it, what is true in it, and what a change would make of it."""
