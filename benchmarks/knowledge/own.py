"""This knowledge base: prepared queries, and the same as text each time."""

from collections.abc import Iterable

from knowledge.arcs import KINDS, Arc
from knowledge.contender import Answers, Contender
from knowledge_base import Delta, KnowledgeBase, Schema, fact

SCHEMA = Schema.parse(
    f"""(define (domain bench) (:types thing - object)
    (:predicates {" ".join(f"({kind} ?a ?b - thing)" for kind in KINDS)}))"""
)


class Own(Contender):
    """Prepared queries and `kb.apply` of a knowledge base in memory."""

    name = "this engine"
    package = "dynamic-state-charts"

    def __init__(self) -> None:
        self.kb = kb = KnowledgeBase(SCHEMA)
        self._point = kb.prepare("(on ?item ?place)", "item", "place")
        self._pattern = kb.prepare("(on ?x ?place)", "place")
        self._rare = kb.prepare("(opens ?x ?hall)", "hall")
        self._inside = kb.prepare("(and (in ?x ?hall) (near ?x ?item))", "hall", "item")
        self._join = kb.prepare("(and (on ?x ?place) (near ?x ?y))", "place")

    def insert(self, things: Iterable[str], arcs: Iterable[Arc]) -> None:
        self.kb.apply(Delta(dict.fromkeys(things, "thing"), added=tuple(fact(*arc) for arc in arcs)), "bench")

    def point(self, item: str, place: str) -> bool:
        return self._point.ask(item, place)

    def pattern(self, place: str) -> Answers:
        return self._pattern.query(place)

    def rare(self, hall: str) -> Answers:
        return self._rare.query(hall)

    def inside(self, hall: str, item: str) -> Answers:
        return self._inside.query(hall, item)

    def join(self, place: str) -> Answers:
        return self._join.query(place)

    def point_by_text(self, item: str, place: str) -> bool:
        return self.kb.ask("(on ?item ?place)", {"item": item, "place": place})

    def join_by_text(self, place: str) -> Answers:
        return self.kb.query("(and (on ?x ?place) (near ?x ?y))", {"place": place})

    def move(self, item: str, old: str, new: str) -> None:
        self.kb.apply(Delta(removed=(fact("on", item, old),), added=(fact("on", item, new),)), "bench")


CONTENDER = Own
