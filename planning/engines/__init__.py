"""Planning engines and their worker processes; the only package that runs unified-planning's engines."""
