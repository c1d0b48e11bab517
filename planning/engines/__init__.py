"""Planning engines and the process they run in; the only place that meets unified-planning."""
