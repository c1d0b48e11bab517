"""Which part of a domain or goal asks something of an engine that not every engine can do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from knowledge_base.language.effect import effect_conditions
from knowledge_base.language.expression import Comparison, Expression, Term, parts_of
from knowledge_base.language.printer import to_text
from planning.posing.derived import derivation
from planning.posing.relevance import names_of, relevant

if TYPE_CHECKING:
    from collections.abc import Iterator

    from knowledge_base.errors import Place
    from planning.domain import PlanningDomain
    from planning.plan import NobodyCan


@dataclass(frozen=True, slots=True)
class Construct:
    """A condition on numbers that actions change.

    Attributes:
        owner: whose condition it is: `the goal`, or a planning action.
        text: the condition, in PDDL.
        place: where it is written.
    """

    owner: str
    text: str
    place: Place | None

    def __str__(self) -> str:
        """One line: `jars.pddl:7:9: planning action 'pour' compares numbers that actions change: (> (litres ?a) 0)`."""
        said = f"{self.owner} compares numbers that actions change: {self.text}"
        return f"{self.place}: {said}" if self.place else said


def numeric_constructs(domain: PlanningDomain, goal: Expression) -> Iterator[Construct]:
    """What makes the problem of reaching `goal` numeric: the goal's own conditions first, then those of actions."""
    derived = derivation(domain)
    goal = derived.expand(goal)
    matters = relevant(goal, None, derived.domain.actions.values())
    conditions = [("the goal", goal)]
    for action in matters.actions:
        owned = (action.precondition, *effect_conditions(action.effect))
        conditions += [(f"planning action '{action.name}'", one) for one in owned]
    for owner, condition in conditions:
        for comparison in _comparisons(condition):
            if not matters.changing.isdisjoint(names_of(comparison)):
                yield Construct(owner, to_text(comparison), comparison.place)


def why_no_engine(domain: PlanningDomain, goal: Expression, nobody: NobodyCan) -> str:
    """Why no engine can be asked, in one line: the construct, its place, who could, and how to get him.

    Args:
        domain: the planning domain.
        goal: what shall hold.
        nobody: what came of asking.
    """
    construct = next(numeric_constructs(domain, goal), None)
    return nobody.message if construct is None else f"{construct}; {nobody.who}"


def _comparisons(e: Expression | Term) -> Iterator[Comparison]:
    if isinstance(e, Comparison):
        yield e
    for part in parts_of(e):
        yield from _comparisons(part)
