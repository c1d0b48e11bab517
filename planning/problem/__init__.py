"""From a domain, a world and a goal to a problem that engines can be asked: only what matters, ground, positive."""
