"""A world in memory: its schema, its state, and pending changes on top of the state."""
