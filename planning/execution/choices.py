"""Which plots were chosen to carry out planning actions, so that a step that failed can be done in another way."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from planning.generation.carried_steps import implementing

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dsc.dynamic.library import Library
    from dsc.engine.steps import Step
    from planning.domain import PlanningDomain
    from planning.plan import PlanStep


class Choices:
    """The last choice for each action and arguments.

    Args:
        domain: has the actions.
        library: has the plots.
    """

    def __init__(self, domain: PlanningDomain, library: Library) -> None:
        self._domain = domain
        self._library = library
        self._chosen: dict[tuple[str, frozenset[tuple[str, Any]]], str] = {}

    def note(self, step: Step) -> None:
        """Take note of what was chosen in a macrostep."""
        for made in step.decisions:
            decision = made.decision
            plot = None if decision.chosen is None else self._library.plot(decision.chosen)
            if plot is not None and plot.implements:
                self._chosen[plot.implements, frozenset(decision.arguments.items())] = plot.name

    def of(self, step: PlanStep) -> str | None:
        """The plot that was chosen last to carry out a step."""
        bindings = self._domain.bindings(step)
        for plot in implementing(step, self._library):
            own = frozenset((name, value) for name, value in bindings.items() if name in plot.parameters)
            if (step.action, own) in self._chosen:
                return self._chosen[step.action, own]
        return None

    def remember(self) -> list[Any]:
        """As plain data."""
        return [[action, dict(sorted(arguments)), plot] for (action, arguments), plot in self._chosen.items()]

    def recall(self, memory: Iterable[Any]) -> None:
        """The inverse of `remember`."""
        self._chosen = {(action, frozenset(arguments.items())): plot for action, arguments, plot in memory}
