"""Dynamic plots: dynamic states choose their content, and rules and handlers expand into states and transitions."""
