"""pyoxigraph: a store in memory, queried by patterns; loops over them are faster here than its SPARQL."""

from collections.abc import Iterable

from pyoxigraph import NamedNode, Quad, Store

from knowledge.arcs import Arc
from knowledge.contender import Answers, Contender

BASE = "http://example.org/"
ON, IN, NEAR, OPENS = (NamedNode(BASE + kind) for kind in ("on", "in", "near", "opens"))


class Oxigraph(Contender):
    """Queries by `quads_for_pattern` and `in`."""

    name = package = "pyoxigraph"

    def __init__(self) -> None:
        self.store = Store()

    def term(self, name: str) -> NamedNode:
        return NamedNode(BASE + name)

    def name_of(self, term: NamedNode) -> str:
        return term.value.removeprefix(BASE)

    def insert(self, things: Iterable[str], arcs: Iterable[Arc]) -> None:  # noqa: ARG002  only triples are stored
        node = NamedNode
        self.store.extend(Quad(node(BASE + one), node(BASE + kind), node(BASE + other)) for kind, one, other in arcs)

    def point(self, item: NamedNode, place: NamedNode) -> bool:
        return Quad(item, ON, place) in self.store

    def pattern(self, place: NamedNode) -> Answers:
        return [{"x": quad.subject} for quad in self.store.quads_for_pattern(None, ON, place)]

    def rare(self, hall: NamedNode) -> Answers:
        return [{"x": quad.subject} for quad in self.store.quads_for_pattern(None, OPENS, hall)]

    def inside(self, hall: NamedNode, item: NamedNode) -> Answers:
        store = self.store
        near = (quad.subject for quad in store.quads_for_pattern(None, NEAR, item))
        return [{"x": x} for x in near if Quad(x, IN, hall) in store]

    def join(self, place: NamedNode) -> Answers:
        matches = self.store.quads_for_pattern
        return [
            {"x": one.subject, "y": two.object}
            for one in matches(None, ON, place)
            for two in matches(one.subject, NEAR, None)
        ]

    def move(self, item: NamedNode, old: NamedNode, new: NamedNode) -> None:
        self.store.remove(Quad(item, ON, old))
        self.store.add(Quad(item, ON, new))


CONTENDER = Oxigraph
