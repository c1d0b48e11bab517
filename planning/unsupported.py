"""Errors for valid PDDL that planning does not support."""

from __future__ import annotations

from knowledge_base.errors import InputError


class UnsupportedGoalError(InputError):
    """The goal has a construct without support by any engine; the message names it."""


class UnsupportedActionError(InputError):
    """A relevant planning action has a construct without support by any engine."""
