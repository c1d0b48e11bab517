"""Situation of the engine on a knowledge base: one version plus the changes of the macrostep."""

from __future__ import annotations

from typing import Any

from dsc.dynamic.candidate_selection import choose, plain, scalars
from dsc.dynamic.library import Library
from dsc.engine.situation import Bindings, Decision
from dsc.model.states import DynamicState
from knowledge_base.facts import Delta
from knowledge_base.language.evaluation.evaluator import apply_effect, evaluate_term, holds
from knowledge_base.language.syntax.effect import Effect
from knowledge_base.language.syntax.expression import Expression, Term
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.overlay import Overlay


class KnowledgeSituation:
    """A `Situation` for one macrostep; it leaves the knowledge base unchanged."""

    def __init__(self, knowledge: KnowledgeBase, library: Library) -> None:
        self._version = knowledge.version
        self._knowledge = knowledge
        self._library = library
        self._pending: Overlay | None = None

    @property
    def _world(self) -> Overlay:
        """The knowledge with the macrostep's changes, created on first use: most steps neither read nor change it."""
        if self._pending is None:
            self._pending = self._knowledge.overlay()
        return self._pending

    def holds(self, expression: Expression, bindings: Bindings) -> bool:
        """See `Situation`."""
        return holds(expression, self._world, bindings)

    def value(self, term: Term, bindings: Bindings) -> Any:
        """See `Situation`."""
        return plain(evaluate_term(term, self._world, bindings))

    def tell(self, effect: Effect, bindings: Bindings) -> Delta:
        """See `Situation`."""
        delta = apply_effect(effect, self._world, scalars(bindings))
        self._world.apply(delta)
        return delta

    def choose(self, state: DynamicState, holder: str, bindings: Bindings) -> Decision:
        """See `Situation`."""
        return choose(state, holder, bindings, self._world, self._library, self._version)
