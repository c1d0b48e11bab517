"""Names that can occur in a run, so that a predicate with a misspelt name raises an error."""

from __future__ import annotations

from collections.abc import Iterable

from dsc.events import AFTER, EVERY
from dsc.model.actions import Trigger, flat
from dsc.model.plot import ActionPlot
from dsc.model.states import AnyState, State
from dsc.model.transitions import TransitionSource
from knowledge_base.errors import UnknownNameError

ALWAYS = "always"


class KnownNames:
    """States, triggers, rules and skills of some plots.

    Attributes:
        states: names of states.
        triggers: labels of transitions; `None` if one of the plots takes events by prefix (SCXML 3.12.1).
        rules: labels of rules.
        skills: `component.skill` of every skill that a state starts.
    """

    def __init__(self, plots: Iterable[ActionPlot]) -> None:
        self.states: set[str] = set()
        self.triggers: set[str] | None = {AFTER, EVERY, ALWAYS}
        self.rules: set[str] = set()
        self.skills: set[str] = set()
        for plot in plots:
            if plot.dialect == "scxml":
                self.triggers = None
            self.rules.update(rule.label for rule in plot.rules)
            self.rules.update(handler.label for handler in plot.handlers)
            for name, state, _ in plot.walk():
                self.states.add(name)
                self._add(state)

    def _add(self, state: AnyState) -> None:
        if not isinstance(state, TransitionSource):
            return
        for trigger, transition in state.transitions():
            if self.triggers is not None:
                self.triggers.add(trigger)
            if transition.rule is not None:
                self.rules.add(transition.rule)
        actions = flat((*state.entry, *state.exit, *state.on_break)) if isinstance(state, State) else ()
        self.skills.update(action.trigger for action in actions if isinstance(action, Trigger))

    def check(self, *, state: str | None = None, trigger: str | None = None, rule: str | None = None,
              skill: str | None = None) -> None:  # fmt: skip
        """Raise `UnknownNameError` for a name that cannot occur; a state may be given by its path."""
        for name in state.split("/") if state is not None else ():
            _check("state", name, self.states)
        if self.triggers is not None:
            _check("transition on", trigger, self.triggers)
        _check("rule", rule, self.rules)
        _check("skill", skill, self.skills)


def _check(kind: str, name: str | None, valid: set[str]) -> None:
    if name is not None and name not in valid:
        raise UnknownNameError(f"no plot of this run has a {kind} '{name}'", found=name, valid=valid)
