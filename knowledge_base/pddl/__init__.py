"""PDDL texts as they are written, before anything in them is given a meaning."""
