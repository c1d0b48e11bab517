"""This knowledge base: the same text each time, values as parameters."""

from collections.abc import Iterable

from knowledge.arcs import KINDS, Arc
from knowledge.contender import Answers, Contender
from knowledge_base import Delta, KnowledgeBase, Schema, fact

SCHEMA = Schema.parse(
    f"""(define (domain bench) (:types thing - object)
    (:predicates {" ".join(f"({kind} ?a ?b - thing)" for kind in KINDS)}))"""
)


class Own(Contender):
    """`kb.ask`, `kb.query` and `kb.apply` of a knowledge base in memory."""

    name = "this engine"
    package = "dynamic-state-charts"

    def __init__(self) -> None:
        self.kb = KnowledgeBase(SCHEMA)

    def insert(self, things: Iterable[str], arcs: Iterable[Arc]) -> None:
        self.kb.apply(Delta(dict.fromkeys(things, "thing"), added=tuple(fact(*arc) for arc in arcs)), "bench")

    def point(self, item: str, place: str) -> bool:
        return self.kb.ask("(on ?item ?place)", {"item": item, "place": place})

    def pattern(self, place: str) -> Answers:
        return self.kb.query("(on ?x ?place)", {"place": place})

    def rare(self, hall: str) -> Answers:
        return self.kb.query("(opens ?x ?hall)", {"hall": hall})

    def inside(self, hall: str, item: str) -> Answers:
        return self.kb.query("(and (in ?x ?hall) (near ?x ?item))", {"hall": hall, "item": item})

    def join(self, place: str) -> Answers:
        return self.kb.query("(and (on ?x ?place) (near ?x ?y))", {"place": place})

    def move(self, item: str, old: str, new: str) -> None:
        self.kb.apply(Delta(removed=(fact("on", item, old),), added=(fact("on", item, new),)), "bench")


CONTENDER = Own
