"""Text forms of plots: YAML in and out, text diagrams, JSON Schema."""
