"""World models for tests, in a line or two of PDDL."""

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
"""Schema of a world without declared names."""


def world(domain: Schema | Path | str = EMPTY, objects: str = "", facts: str = "") -> KnowledgeBase:
    """Return a knowledge base with these objects and facts, as in a PDDL problem.

    Args:
        domain: a schema, a PDDL domain file, or its text.
        objects: as after `:objects`, e.g. `"cup1 cup2 - cup table - surface"`.
        facts: as after `:init`, e.g. `"(on cup1 table) (= (failures cup1) 2)"`.

    Raises:
        InputError: a name is not declared, or a text is not PDDL.
    """
    schema = domain if isinstance(domain, Schema) else Schema.from_text(read_domain(domain))
    problem = f"(define (problem test) (:domain test) (:objects {objects}) (:init {facts}))"
    knowledge = KnowledgeBase(schema)
    knowledge.apply(read_problem(problem, schema, "world").delta(), "test")
    return knowledge


def change_of(what: Delta | str, knowledge: KnowledgeBase, bindings: Bindings | None = None) -> Delta:
    """Return a change as a value; a PDDL effect such as `(not (on ?item table))` applies to the present world.

    Raises:
        InputError: the text is not an effect, or names an undeclared or unbound element.
    """
    if isinstance(what, Delta):
        return what
    return apply_effect(parse_effect(what), knowledge.snapshot(), bindings or {})
