"""Planning engines and their worker processes; no other package runs engines of unified-planning."""
