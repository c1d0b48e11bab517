"""Text forms of plots: reading and writing of YAML, text diagrams, JSON Schema."""
