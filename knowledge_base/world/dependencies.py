"""Dependencies among derived predicates: which follow from each other, and in which order they are derived."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import networkx as nx

from knowledge_base.errors import SchemaError
from knowledge_base.language.syntax.rewriting import denied, names_of
from knowledge_base.world.axioms import Axiom


class Dependencies:
    """The graph with an edge from each derived predicate to each of its inputs.

    Args:
        axioms: the axioms by predicate.

    Attributes:
        circles: the sets of predicates that follow from each other, each set after its inputs.

    Raises:
        SchemaError: a predicate follows from its own negation.
    """

    def __init__(self, axioms: Mapping[str, Sequence[Axiom]]) -> None:
        self._graph: nx.DiGraph[str] = nx.DiGraph()
        every = [axiom for those in axioms.values() for axiom in those]
        for axiom in every:
            self._graph.add_node(axiom.predicate)
            self._graph.add_edges_from((axiom.predicate, name) for name in names_of(axiom.condition))
        for axiom in every:
            self._check(axiom)
        self.circles = [part for part in self._components() if self._is_circle(part)]

    def inputs(self, name: str) -> set[str]:
        """Return the names from which a derived predicate follows, and its own name."""
        return {name, *nx.descendants(self._graph, name)}

    def _check(self, axiom: Axiom) -> None:
        for atom in denied(axiom.condition, wanted=True):
            if atom.predicate in self._graph and nx.has_path(self._graph, atom.predicate, axiom.predicate):
                raise SchemaError(
                    f"the derived predicate '{axiom.predicate}' follows from its own negation, through"
                    f" '{atom.predicate}'",
                    place=atom.place or axiom.place,
                )

    def _components(self) -> Iterator[frozenset[str]]:
        """Yield the strongly connected sets of predicates, each after its inputs."""
        components = nx.condensation(self._graph)
        for number in reversed(list(nx.topological_sort(components))):
            yield frozenset(components.nodes[number]["members"])

    def _is_circle(self, component: frozenset[str]) -> bool:
        return len(component) > 1 or any(self._graph.has_edge(name, name) for name in component)
