"""The plots that dynamic states chose for plan steps, so that a failed step can try another candidate."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from planning.generation.carried_steps import implementing
from planning.model.plan import PlanStep

if TYPE_CHECKING:
    from dsc.dynamic.library import Library
    from dsc.engine.steps import Step
    from planning.model.domain import PlanningDomain


class Choices:
    """The last chosen plot for each plan step, so that another candidate can be tried after a failure.

    Args:
        domain: the planning domain.
        library: the plots.

    Attributes:
        refusals: the candidates of the last decision that chose none, with the reasons.
    """

    def __init__(self, domain: PlanningDomain, library: Library) -> None:
        self._domain = domain
        self._library = library
        self.refusals: list[str] = []
        self._chosen: dict[tuple[str, frozenset[tuple[str, Any]]], str] = {}

    def note(self, step: Step) -> None:
        """Store the choices of a macrostep."""
        for made in step.decisions:
            decision = made.decision
            if decision.chosen is None:
                self.refusals = [f"{one.plot}: {one.reason}" for one in decision.verdicts if not one.fits]
            plot = None if decision.chosen is None else self._library.plot(decision.chosen)
            if plot is not None and plot.implements:
                self._chosen[plot.implements, frozenset(decision.arguments.items())] = plot.name

    def of(self, step: PlanStep) -> str | None:
        """Return the name of the last plot that was chosen for a step, or `None`."""
        bindings = self._domain.bindings(step)
        for plot in implementing(step, self._library):
            own = frozenset((name, value) for name, value in bindings.items() if name in plot.parameters)
            if (step.action, own) in self._chosen:
                return self._chosen[step.action, own]
        return None

    def remember(self) -> list[Any]:
        """Return the choices as plain data."""
        return [[action, dict(sorted(arguments)), plot] for (action, arguments), plot in self._chosen.items()]

    def recall(self, memory: Iterable[Any]) -> None:
        """Restore the choices that `remember` returned."""
        self._chosen = {(action, frozenset(arguments.items())): plot for action, arguments, plot in memory}
