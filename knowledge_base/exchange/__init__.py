"""The knowledge base's texts in and out: PDDL domain and problem files."""
