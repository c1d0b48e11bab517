"""Situation and chart: the engine's only interfaces to knowledge and plots; conditions that the engine answers itself.

`(in-state NAME)` tests whether a state of the same plot is active, SCXML's `In()` (5.9.1). Dialect `scxml` only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from dsc.engine.tables import CompiledPlot
from dsc.model.states import DynamicState
from knowledge_base.facts import Delta
from knowledge_base.language.syntax.effect import Effect
from knowledge_base.language.syntax.expression import (
    TRUE,
    And,
    Atom,
    Constant,
    Exists,
    Expression,
    Forall,
    Imply,
    Not,
    Or,
    Term,
    parts_of,
)

IN_STATE = "in-state"
"""The predicate's name."""
FALSE = Or(())
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


class Chart(Protocol):
    """Provider of plots: by name, or bound as a value."""

    def compiled(self, name: str) -> CompiledPlot:
        """Return the plot of that name; raise `UnknownNameError`."""
        ...

    def bind(self, form: Mapping[str, Any]) -> CompiledPlot:
        """Compile a plot given as data, e.g. one made from a plan; raise `InputError`."""
        ...


def asked_states(e: Expression) -> list[str]:
    """Return the names of the states that the condition tests with `in-state`."""
    if isinstance(e, Atom):
        return [str(e.args[0].value)] if _asks(e) and isinstance(e.args[0], Constant) else []
    inner = [part for part in parts_of(e) if isinstance(part, Expression)]
    return [name for part in inner for name in asked_states(part)]


def settle(e: Expression, active: Callable[[str], bool]) -> Expression:
    """Replace every `in-state` in the condition by its truth value; the knowledge base evaluates the rest."""
    match e:
        case Atom(_, args) if _asks(e):
            return TRUE if isinstance(args[0], Constant) and active(str(args[0].value)) else FALSE
        case And(parts) | Or(parts):
            return replace(e, parts=tuple(settle(part, active) for part in parts))
        case Not(body) | Exists(_, body) | Forall(_, body):
            return replace(e, body=settle(body, active))
        case Imply(premise, conclusion):
            return replace(e, premise=settle(premise, active), conclusion=settle(conclusion, active))
        case _:
            return e


def _asks(e: Atom) -> bool:
    return e.predicate == IN_STATE and len(e.args) == 1
