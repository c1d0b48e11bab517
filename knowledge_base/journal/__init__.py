"""History of a world: every change since the beginning or since a snapshot, in a file or in memory."""
