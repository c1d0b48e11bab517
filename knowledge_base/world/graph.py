"""World graph: the world model as a networkx graph, for readers and graph algorithms.

Each object is a node with a `type`. A fact about two objects is an arc from the first to the second object, with the
predicate as key. A fact about one object is an arc from the object to itself (S4.4). A fluent of one or two objects is
also such an arc, with its content as `value` (S4.3: symbolic or geometric content). Each other fact or fluent is a
node: the `Fact` itself, with its name as `relation`, and for a fluent its `value`. An arc leads from this node to each
object in the fact, with the argument position as key. A fluent with a bound source has the reference of the source as
`source` (S4.9). Arcs and nodes of facts have the `kind` of their predicate or function, if it has one (S4.17).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

import networkx as nx

from knowledge_base.facts import Content, Delta, Fact
from knowledge_base.language.checking.vocabulary import VALUE_TYPES, Signature
from knowledge_base.world.state import WorldState

Graph: TypeAlias = "nx.MultiDiGraph[Any]"


class WorldGraph:
    """The graph of a world, updated by each committed change."""

    def __init__(self, state: WorldState) -> None:
        declared = {**state.schema.predicates, **state.schema.functions}
        self._arcs = frozenset(name for name, signature in declared.items() if _is_arc(signature))
        self._kinds = {name: {"kind": kind} if kind else {} for name, kind in state.schema.kinds.items()}
        self._things = {name: _thing_positions(signature) for name, signature in declared.items()}
        self._graph: Graph = nx.MultiDiGraph()
        self.view: Graph = self._graph.copy(as_view=True)
        """The graph as a read-only view that shows later changes."""
        self.commit(Delta(nodes=state.nodes, added=tuple(state.facts), values=state.values))
        for fluent, reference in state.references.items():
            self.feed(fluent, reference, state.value(fluent.predicate, fluent.args))

    def commit(self, effective: Delta) -> None:
        """Apply an effective change to the graph."""
        for fact in effective.removed:
            self._remove(fact)
        for name in effective.removed_nodes:
            self._remove_node(name)
        for name, type_name in effective.nodes.items():
            self._graph.add_node(name, type=type_name)
        for fact in effective.added:
            self._put(fact, {})
        for fluent, content in effective.values.items():
            self._put(fluent, {"value": content})

    def feed(self, fluent: Fact, reference: str, content: Content) -> None:
        """Set the latest value of a fluent that is bound to a source."""
        self._put(fluent, {"value": content, "source": reference})

    def unfeed(self, fluent: Fact, kept: Content | None) -> None:
        """Remove the source of a fluent; `kept` is the value that a change has set, if any."""
        self._remove(fluent)
        if kept is not None:
            self._put(fluent, {"value": kept})

    def _put(self, fact: Fact, content: Mapping[str, Content]) -> None:
        content = {**content, **self._kinds[fact.predicate]}
        if fact.predicate in self._arcs:
            self._graph.add_edge(fact.args[0], fact.args[-1], key=fact.predicate, **content)
            return
        self._graph.add_node(fact, relation=fact.predicate, **content)
        for position in self._things[fact.predicate]:
            self._graph.add_edge(fact, fact.args[position], key=position)

    def _remove(self, fact: Fact) -> None:
        if fact.predicate in self._arcs:
            self._graph.remove_edge(fact.args[0], fact.args[-1], key=fact.predicate)
        else:
            self._graph.remove_node(fact)

    def _remove_node(self, name: str) -> None:
        relations = [n for n in self._graph.predecessors(name) if isinstance(n, Fact)]
        self._graph.remove_nodes_from([name, *relations])


def _is_arc(signature: Signature) -> bool:
    return signature.arity in (1, 2) and len(_thing_positions(signature)) == signature.arity


def _thing_positions(signature: Signature) -> list[int]:
    return [i for i, p in enumerate(signature.parameters) if not set(p.types) & set(VALUE_TYPES)]
