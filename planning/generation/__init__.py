"""Generation of action plots from plans."""
