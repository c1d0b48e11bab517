"""A world model for a test, in a line or two of PDDL."""

from __future__ import annotations

from pathlib import Path

from knowledge_base.facts import Delta
from knowledge_base.language.effect_application import apply_effect
from knowledge_base.language.parser import parse_effect
from knowledge_base.language.terms import Bindings
from knowledge_base.pddl.domain_text import read_domain
from knowledge_base.pddl.problem_text import read_problem
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema

EMPTY = Schema()
"""What may be said where nothing needs to be known."""


def world(domain: Schema | Path | str = EMPTY, objects: str = "", facts: str = "") -> KnowledgeBase:
    """A knowledge base with these things and facts in it, as in a PDDL problem.

    Args:
        domain: a schema, a PDDL domain file, or its text.
        objects: as after `:objects`, e.g. `"cup1 cup2 - cup table - surface"`.
        facts: as after `:init`, e.g. `"(on cup1 table) (= (failures cup1) 2)"`.

    Raises:
        InputError: something is not declared, or does not have the form of PDDL.
    """
    schema = domain if isinstance(domain, Schema) else Schema.from_text(read_domain(domain))
    problem = f"(define (problem test) (:domain test) (:objects {objects}) (:init {facts}))"
    knowledge = KnowledgeBase(schema)
    knowledge.apply(read_problem(problem, schema, "world").delta(), "test")
    return knowledge


def change_of(what: Delta | str, knowledge: KnowledgeBase, bindings: Bindings | None = None) -> Delta:
    """A change as a value, or as a PDDL effect such as `(not (on ?item table))` on the world as it is now.

    Raises:
        InputError: the text is no effect, or names something that is not declared or not bound.
    """
    if isinstance(what, Delta):
        return what
    return apply_effect(parse_effect(what), knowledge.snapshot(), bindings or {})
