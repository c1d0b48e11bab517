"""Text and pictures of plots: YAML in and out, drawings."""
