"""The one language of conditions, queries, guards, goals and effects: PDDL's, with free variables."""
