"""The working memory of a robot as a graph with kinds of arcs, after Figure 6 of the BICA paper (S4.3, S4.17).

Each module of the robot declares its predicates in a fragment of the domain. The name of the fragment is the kind of
its arcs. `python examples/working_memory.py FILE.svg` draws the graph.
"""

from __future__ import annotations

import sys
from pathlib import Path

from knowledge_base import KnowledgeBase
from knowledge_base.drawing import draw
from planning import PlanningDomain

PLANNING = """
(define (domain planning)
  (:types place door robot person - object)
  (:constants leia - robot)
  (:predicates (robot-at ?r - robot ?p - place) (connected ?a ?b - place) (open ?d - door))
  (:action go
    :parameters (?r - robot ?a ?b - place)
    :precondition (and (robot-at ?r ?a) (connected ?a ?b))
    :effect (and (not (robot-at ?r ?a)) (robot-at ?r ?b))))
"""
PERCEPTION = """
(define (domain perception)
  (:predicates (sees ?r - robot ?what - object)))
"""
TRANSFORM = """
(define (domain transform)
  (:functions (pose ?what ?frame - object) - geometry))
"""
DIALOGUE = """
(define (domain dialogue)
  (:predicates (ask ?from - robot ?to - person ?topic - text)
               (want-to-talk ?who - person ?to - robot)))
"""


def working_memory() -> KnowledgeBase:
    """Return the working memory while the robot asks a person."""
    domain = PlanningDomain.from_fragments([PLANNING, PERCEPTION, TRANSFORM, DIALOGUE])
    knowledge = KnowledgeBase(domain.schema)
    with knowledge.transaction(author="map") as world:
        for name, kind in {"anna": "person", "hall": "place", "kitchen": "place", "door1": "door"}.items():
            world.add_node(name, kind)
        for one in [("robot-at", "leia", "hall"), ("connected", "hall", "kitchen"), ("connected", "kitchen", "hall")]:
            world.tell(*one)
        world.tell("open", "door1")
    with knowledge.transaction(author="camera") as world:
        world.tell("sees", "leia", "anna")
        world.tell("sees", "leia", "door1")
        world.set("pose", "anna", "leia", (1.2, 0.0, 0.0))
    with knowledge.transaction(author="speech") as world:
        world.tell("want-to-talk", "anna", "leia")
        world.tell("ask", "leia", "anna", "Which floor?")
    return knowledge


def arcs(knowledge: KnowledgeBase, kind: str) -> list[tuple[str, str, str]]:
    """Return the arcs of a kind, as start, end and predicate."""
    found = knowledge.graph.edges(keys=True, data="kind")
    return sorted((start, end, name) for start, end, name, of in found if of == kind)


def main() -> None:
    """Print the arcs of each kind, and draw the graph."""
    knowledge = working_memory()
    for kind in ("planning", "perception", "transform", "dialogue"):
        print(kind, *(f"{start} -{name}-> {end}" for start, end, name in arcs(knowledge, kind)), sep="\n  ")
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(draw(knowledge))


if __name__ == "__main__":
    main()

# Expected output:
# planning
#   door1 -open-> door1
#   hall -connected-> kitchen
#   kitchen -connected-> hall
#   leia -robot-at-> hall
# perception
#   leia -sees-> anna
#   leia -sees-> door1
# transform
#   anna -pose-> leia
# dialogue
#   anna -want-to-talk-> leia
