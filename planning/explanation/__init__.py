"""Explanations of 'no plan': goal facts out of reach, mutexes, and the missing facts of the nearest action."""
