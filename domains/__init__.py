"""Ready worlds: PDDL, plots, skills and a simulation each."""
