"""Ready worlds, each with a PDDL domain, plots, components and a simulation."""
