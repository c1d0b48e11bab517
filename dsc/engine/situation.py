"""Situation: the engine's only interface to knowledge and candidates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from dsc.model.states import DynamicState
from knowledge_base.facts import Delta
from knowledge_base.language.syntax.effect import Effect
from knowledge_base.language.syntax.expression import Expression, Term

Bindings = Mapping[str, Any]
"""Values of chart variables, parameters and `event.attribute`s by name."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """The judgement of one candidate, with its reason.

    Attributes:
        plot: the candidate.
        fits: whether its condition held.
        reason: the leaf of its condition that decided, as text.
        explanation: the whole condition as a tree with truth values, as plain data.
    """

    plot: str
    fits: bool
    reason: str
    explanation: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Decision:
    """The decision record of one entry into a dynamic state (S0.4): the chosen plot and the reasons.

    Attributes:
        chosen: the plot to be bound; `None` if none fits.
        arguments: values for its parameters.
        satisfied: the state's goal holds already; nothing is bound and the state is done.
        verdicts: one for each candidate, in the order of preference.
        version: version of the knowledge at the decision.
    """

    chosen: str | None
    arguments: Mapping[str, Any] = field(default_factory=dict)
    satisfied: bool = False
    verdicts: tuple[Verdict, ...] = ()
    version: int = 0


class Situation(Protocol):
    """The knowledge at one version plus the changes of this macrostep.

    Deterministic: equal calls in an equal order give equal answers. Each macrostep gets a new one. Every method raises
    `InputError` for an unknown or unbound name.
    """

    def holds(self, expression: Expression, bindings: Bindings) -> bool:
        """Return whether the condition is true."""
        ...

    def value(self, term: Term, bindings: Bindings) -> Any:
        """Return the value of the term."""
        ...

    def tell(self, effect: Effect, bindings: Bindings) -> Delta:
        """Return the change of the effect in this world; later calls see it, the caller commits it."""
        ...

    def choose(self, state: DynamicState, holder: str, bindings: Bindings) -> Decision:
        """Choose the content of a dynamic state of the plot named `holder`."""
        ...
