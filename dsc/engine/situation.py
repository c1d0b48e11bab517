"""Situation and chart, the engine's only interfaces to knowledge and plots."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from dsc.engine.exclusion import FailedCandidate
from dsc.engine.tables import CompiledPlot
from dsc.model.states import DynamicState
from knowledge_base.facts import Delta
from knowledge_base.language.syntax.effect import Effect
from knowledge_base.language.syntax.expression import Expression, Term
from knowledge_base.notebook import table

Bindings = Mapping[str, Any]
"""Values of chart variables, parameters and `event.attribute`s by name."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """Result for one candidate of a dynamic state, with the reason.

    Attributes:
        plot: name of the candidate.
        fits: whether the candidate's condition is true.
        reason: the part of the condition that determines the result, as text.
        explanation: the whole condition as a tree with truth values, as plain data.
        score: the number by which the state chooses; `None` if the state chooses by order, or if the number is unknown.
        learned: the tries from which a learned number follows, as text; empty without any.
    """

    plot: str
    fits: bool
    reason: str
    explanation: Mapping[str, Any] = field(default_factory=dict)
    score: float | None = None
    learned: str = ""


@dataclass(frozen=True, slots=True)
class Decision:
    """The decision record of one entry into a dynamic state (S0.4): the chosen plot and the reasons.

    Attributes:
        chosen: name of the plot to bind; `None` if no candidate fits.
        arguments: values for the parameters of the chosen plot.
        satisfied: whether the state's goal is already true; then no plot is bound and the state is done.
        verdicts: a verdict for each candidate, in the order of preference.
        version: version of the knowledge at the decision.
        by: the choice among candidates that fit, see `choose` of `DynamicState`.
        holder: the plot of the dynamic state.
        situation: the conditions under `situation` of the state, as texts, with their truth.
        explored: whether the candidate was chosen at random.
    """

    chosen: str | None
    arguments: Mapping[str, Any] = field(default_factory=dict)
    satisfied: bool = False
    verdicts: tuple[Verdict, ...] = ()
    version: int = 0
    by: str = "order"
    holder: str = ""
    situation: Mapping[str, bool] = field(default_factory=dict)
    explored: bool = False

    def _repr_html_(self) -> str:
        title = "the goal holds" if self.satisfied else f"chosen: {self.chosen or 'no candidate fits'}"
        rows = [("✓" if one.fits else "✕", one.plot, one.reason) for one in self.verdicts]
        return table(f"{title} (version {self.version})", ("", "candidate", "reason"), rows)


class Situation(Protocol):
    """The knowledge at one version, with the changes of the current macrostep.

    A situation is deterministic: equal calls in an equal order return equal results. Each macrostep uses a new
    situation. Every method raises `InputError` for an unknown or unbound name.
    """

    def holds(self, expression: Expression, bindings: Bindings) -> bool:
        """Return whether the condition is true."""
        ...

    def answers(self, expression: Expression, bindings: Bindings) -> Iterator[dict[str, Any]]:
        """Yield the values of the other free variables that make the condition true, in the order of a query."""
        ...

    def value(self, term: Term, bindings: Bindings) -> Any:
        """Return the value of the term."""
        ...

    def tell(self, effect: Effect, bindings: Bindings) -> Delta:
        """Apply an effect and return its change: later calls read the change, and the caller commits it."""
        ...

    def choose(
        self,
        state: DynamicState,
        holder: str,
        bindings: Bindings,
        failed: Sequence[FailedCandidate] = (),
        activation: int = 0,
    ) -> Decision:
        """Return the decision on the content of a dynamic state.

        Args:
            state: the dynamic state.
            holder: the name of the state's plot.
            bindings: values of variables.
            failed: the remembered failures of candidates, see `exclusion`.
            activation: serial number of the state's activation, on which random choices depend.
        """
        ...

    def now(self) -> float:
        """Return the second of run time, which is equal in the whole macrostep."""
        ...


class Chart(Protocol):
    """Provider of compiled plots, by name or from a plot given as data."""

    def compiled(self, name: str) -> CompiledPlot:
        """Return the compiled plot of that name; raise `UnknownNameError` if there is none."""
        ...

    def bind(self, form: Mapping[str, Any] | str) -> CompiledPlot:
        """Compile a plot given as data, e.g. one made from a plan; raise `InputError` for data that are not a plot."""
        ...
