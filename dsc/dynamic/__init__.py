"""Dynamic states choose their content among plots; rules and handlers expand into states and transitions."""
