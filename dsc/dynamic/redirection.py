"""Redirection of a state's transitions."""

from __future__ import annotations

from typing import Protocol, TypeVar

from dsc.model.connectors import ChoiceState, SelectState
from dsc.model.states import AnyState, State
from dsc.model.transitions import Transition

Way = TypeVar("Way", bound=Transition)


class Redirect(Protocol):
    """Maps a transition to its replacement; timed transitions stay timed."""

    def __call__(self, way: Way, /) -> Way:
        """Return the replacement of a transition."""
        ...


def redirected(state: AnyState, redirect: Redirect) -> AnyState:
    """Return the state with redirected transitions."""
    if isinstance(state, State):
        return state.model_copy(update={
            "on": {event: tuple(map(redirect, ways)) for event, ways in state.on.items()},
            "after": tuple(map(redirect, state.after)),
            "every": tuple(map(redirect, state.every)),
            "always": tuple(map(redirect, state.always)),
        })  # fmt: skip
    if isinstance(state, ChoiceState):
        return state.model_copy(update={"choice": tuple(map(redirect, state.choice))})
    if isinstance(state, SelectState):
        cases = {key: redirect(case) for key, case in state.cases.items()}
        return state.model_copy(update={"cases": cases, "otherwise": redirect(state.otherwise)})
    return state
