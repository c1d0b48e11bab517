"""Conditions, terms and effects compared with the declarations of a schema, before evaluation."""
