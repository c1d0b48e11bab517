"""Checks of conditions, terms and effects against the declarations of a schema, before their evaluation."""
