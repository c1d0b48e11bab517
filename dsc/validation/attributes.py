"""What the events that come to a state carry, as far as it is known where they come from."""

from __future__ import annotations

from collections.abc import Mapping

from dsc.dynamic.library import Library
from dsc.dynamic.outcomes import outcomes_of, outputs_of
from dsc.events import DONE
from dsc.model.actions import Trigger
from dsc.model.plot import ActionPlot
from dsc.model.states import State
from dsc.skills import SkillSignature

Attributes = Mapping[str, str | None]
"""Names -> types as they were declared; `None` is anything."""
Skills = Mapping[str, SkillSignature] | None
"""The skills that are deployed by `component.skill`; `None` if that is not known."""


def attributes_of(event: str, state: State, plot: ActionPlot, library: Library, skills: Skills) -> Attributes | None:
    """The attributes of an event that a state of the plot listens to; `None` if they are not known."""
    declared = outcomes_of(state, library)
    if event in declared:
        return declared[event] or {}
    if event in plot.receives:
        return plot.receives[event] or {}
    if event == DONE:
        return outputs_of(state, library)
    return _of_skill(event, state, skills or {})


def _of_skill(event: str, state: State, skills: Mapping[str, SkillSignature]) -> Attributes | None:
    for action in state.entry:
        if isinstance(action, Trigger) and action.trigger in skills:
            for original, attributes in skills[action.trigger].outcomes.items():
                if action.names.get(original, original) == event:
                    return attributes
    return None
