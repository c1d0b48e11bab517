"""Ready worlds; each consists of a PDDL domain, plots, components and a simulation."""
