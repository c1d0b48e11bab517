"""What the engine asks the world: the one window through which a macrostep sees knowledge and candidates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from dsc.model.states import DynamicState
from knowledge_base.facts import Delta
from knowledge_base.language.effect import Effect
from knowledge_base.language.expression import Expression, Term

Bindings = Mapping[str, Any]
"""Values of chart variables, parameters and `event.attribute`s by name."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """Why one candidate was, or was not, chosen.

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
    """The decision record of one entry into a dynamic state (S0.4): what was chosen, and why.

    Attributes:
        chosen: the plot to be bound; `None` if none fits.
        arguments: values for its parameters.
        satisfied: the state's goal holds already, so nothing is bound and the state is done.
        verdicts: one for each candidate, in the order of preference.
        version: version of the knowledge it was taken on.
    """

    chosen: str | None
    arguments: Mapping[str, Any] = field(default_factory=dict)
    satisfied: bool = False
    verdicts: tuple[Verdict, ...] = ()
    version: int = 0


class Situation(Protocol):
    """The knowledge at one version plus what this macrostep itself told.

    Deterministic: equal calls in an equal order give equal answers. Made anew for every macrostep.
    Every method raises `InputError` for a name that is unknown or unbound.
    """

    def holds(self, expression: Expression, bindings: Bindings) -> bool:
        """Whether the condition is true."""
        ...

    def value(self, term: Term, bindings: Bindings) -> Any:
        """What the term stands for."""
        ...

    def tell(self, effect: Effect, bindings: Bindings) -> Delta:
        """The change the effect makes here; visible to the following calls, committed by the caller."""
        ...

    def choose(self, state: DynamicState, holder: str, bindings: Bindings) -> Decision:
        """The content of a dynamic state that stands in the plot named `holder`."""
        ...
