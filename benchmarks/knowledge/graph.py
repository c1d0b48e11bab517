"""networkx: a `MultiDiGraph` with the kind as key, through its public API."""

from collections.abc import Iterable

import networkx as nx

from knowledge.arcs import Arc
from knowledge.contender import Answers, Contender


class Graph(Contender):
    """Arcs are indexed by node but not by kind; joins are loops that begin at the node with few arcs."""

    name = package = "networkx"

    def __init__(self) -> None:
        self.graph = nx.MultiDiGraph()

    def insert(self, things: Iterable[str], arcs: Iterable[Arc]) -> None:
        self.graph.add_nodes_from(things)
        self.graph.add_edges_from((one, other, kind) for kind, one, other in arcs)

    def point(self, item: str, place: str) -> bool:
        return self.graph.has_edge(item, place, key="on")

    def pattern(self, place: str) -> Answers:
        return [{"x": x} for x, _, kind in self.graph.in_edges(place, keys=True) if kind == "on"]

    def rare(self, hall: str) -> Answers:
        return [{"x": x} for x, _, kind in self.graph.in_edges(hall, keys=True) if kind == "opens"]

    def inside(self, hall: str, item: str) -> Answers:
        has = self.graph.has_edge
        near = (x for x, _, kind in self.graph.in_edges(item, keys=True) if kind == "near")
        return [{"x": x} for x in near if has(x, hall, key="in")]

    def join(self, place: str) -> Answers:
        graph = self.graph
        return [
            {"x": x, "y": y}
            for x, _, kind in graph.in_edges(place, keys=True)
            if kind == "on"
            for _, y, other in graph.out_edges(x, keys=True)
            if other == "near"
        ]

    def move(self, item: str, old: str, new: str) -> None:
        self.graph.remove_edge(item, old, key="on")
        self.graph.add_edge(item, new, key="on")


CONTENDER = Graph
