"""Text of Python controllers: modules that each of them contains."""
