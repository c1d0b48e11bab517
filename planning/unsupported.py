"""What cannot be planned for, told apart from what is written wrongly."""

from __future__ import annotations

from knowledge_base.errors import InputError


class UnsupportedGoalError(InputError):
    """The goal uses a construct that the planning engines cannot be asked about; the message names it."""


class UnsupportedActionError(InputError):
    """A planning action needed for the goal uses a construct that the engines cannot be asked about."""
