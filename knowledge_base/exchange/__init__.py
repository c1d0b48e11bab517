"""Worlds, changes and schemas as JSON, for stores and for other programs."""
