"""A world as the text of a PDDL problem, which `read_problem` reads back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from knowledge_base.facts import Fact
from knowledge_base.language.expression import TRUE, Expression
from knowledge_base.language.printer import to_text, value_text
from knowledge_base.view import View


def problem_text(world: View, name: str, domain: str, goal: Expression = TRUE) -> str:
    """The problem whose first state is `world`: its things but for the domain's constants, facts and numbers.

    Args:
        world: the first state.
        name: the problem's name.
        domain: the name of the domain that it is for.
        goal: what is wanted; nothing, if left out.
    """
    constants = world.schema.constants
    objects = [f"{value_text(thing)} - {own}" for thing, own in world.nodes().items() if thing not in constants]
    facts = [_fact(fact) for fact in world.facts()]
    numbers = [f"(= {_fact(fluent)} {value_text(number)})" for fluent, number in world.values().items()]
    return "\n".join(
        (
            f"(define (problem {value_text(name.lower())})",
            f"  (:domain {value_text(domain)})",
            *_section(":objects", objects),
            *_section(":init", (*facts, *numbers)),
            f"  (:goal {to_text(goal)}))",
        )
    )


def _section(keyword: str, items: Iterable[str]) -> Iterator[str]:
    lines = [f"    {item}" for item in items]
    yield "\n".join((f"  ({keyword}", *lines)) + ")"


def _fact(fact: Fact) -> str:
    return "(" + " ".join((fact.predicate, *map(value_text, fact.args))) + ")"
