"""rdflib: a graph in its default store, queried by patterns; loops over them are faster than its SPARQL."""

from collections.abc import Iterable

from rdflib import Graph, URIRef

from knowledge.arcs import Arc
from knowledge.contender import Answers, Contender

BASE = "http://example.org/"
ON, IN, NEAR, OPENS = (URIRef(BASE + kind) for kind in ("on", "in", "near", "opens"))


class Rdf(Contender):
    """Queries by `subjects`, `objects` and `in`."""

    name = package = "rdflib"
    most = 10_000

    def __init__(self) -> None:
        self.graph = Graph()

    def term(self, name: str) -> URIRef:
        return URIRef(BASE + name)

    def name_of(self, term: URIRef) -> str:
        return term.removeprefix(BASE)

    def insert(self, things: Iterable[str], arcs: Iterable[Arc]) -> None:  # noqa: ARG002  only triples are stored
        for kind, one, other in arcs:
            self.graph.add((URIRef(BASE + one), URIRef(BASE + kind), URIRef(BASE + other)))

    def point(self, item: URIRef, place: URIRef) -> bool:
        return (item, ON, place) in self.graph

    def pattern(self, place: URIRef) -> Answers:
        return [{"x": x} for x in self.graph.subjects(ON, place)]

    def rare(self, hall: URIRef) -> Answers:
        return [{"x": x} for x in self.graph.subjects(OPENS, hall)]

    def inside(self, hall: URIRef, item: URIRef) -> Answers:
        return [{"x": x} for x in self.graph.subjects(NEAR, item) if (x, IN, hall) in self.graph]

    def join(self, place: URIRef) -> Answers:
        graph = self.graph
        return [{"x": x, "y": y} for x in graph.subjects(ON, place) for y in graph.objects(x, NEAR)]

    def move(self, item: URIRef, old: URIRef, new: URIRef) -> None:
        self.graph.remove((item, ON, old))
        self.graph.add((item, ON, new))


CONTENDER = Rdf
