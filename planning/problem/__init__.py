"""Problem construction: from a domain, a world and a goal to a relevant, ground, positive problem for an engine."""
