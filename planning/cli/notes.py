"""What deserves a look in a problem, and only shows when its domain and its plan are known."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from knowledge_base.facts import Fact
from knowledge_base.language.effect import AllOf, Assign, Effect, When, effect_conditions
from knowledge_base.language.expression import Call, Constant, Expression, Term, parts_of

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from knowledge_base.exchange.pddl import ProblemText
    from planning.domain import PlanningDomain
    from planning.plan import Plan


def without_derived(read: ProblemText, domain: PlanningDomain, file: Path) -> ProblemText:
    """The problem without facts that only follow from others, with a note for each predicate."""
    derived = {axiom.predicate for axiom in domain.axioms}
    said = dict.fromkeys(fact.predicate for fact in read.init if fact.predicate in derived)
    notes = [f"{file}: what :init says of '{name}' is not heeded: it is derived" for name in said]
    kept = tuple(fact for fact in read.init if fact.predicate not in derived)
    return replace(read, init=kept, notes=(*read.notes, *notes))


def valueless(plan: Plan, domain: PlanningDomain, read: ProblemText) -> list[str]:
    """A note for each number that a step of the plan asks for and nobody has given a value; it counts as 0."""
    given, missing = set(read.values), dict[Fact, None]()
    for step in plan.steps:
        ground = domain.ground(step)
        asked = [*_fluents(ground.condition), *(one for e in effect_conditions(ground.effect) for one in _fluents(e))]
        changed = list(_assigned(ground.effect))
        asked += [one for _, amount in changed for one in _fluents(amount)]
        missing.update(dict.fromkeys(one for one in asked if one not in given))
        given.update(fluent for fluent, _ in changed)
    return [f"{fluent} has no value and counts as 0" for fluent in missing]


def _assigned(effect: Effect) -> Iterator[tuple[Fact, Term]]:
    match effect:
        case AllOf(parts):
            for part in parts:
                yield from _assigned(part)
        case When(_, inner):
            yield from _assigned(inner)
        case Assign(_, call, amount):
            for fluent in _fluents(call):
                yield fluent, amount


def _fluents(e: Expression | Term) -> Iterator[Fact]:
    """Those that are named without variables."""
    if isinstance(e, Call) and all(isinstance(arg, Constant) for arg in e.args):
        yield Fact(e.function, tuple(arg.value for arg in e.args if isinstance(arg, Constant)))
    for part in parts_of(e):
        yield from _fluents(part)
