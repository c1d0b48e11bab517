"""Posing a problem: the slice of the world and of the domain that matters for a goal, ready for an engine.

The steps of it: choose the relevant actions; ground them along what is reachable; evaluate what cannot
change; make negative conditions positive; turn a disjunctive goal into bookkeeping actions after the last
real one; leave out what cannot matter; leave out objects that others can stand in for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from knowledge_base.facts import Fact
from knowledge_base.language.check import check
from knowledge_base.language.effect import Assign
from knowledge_base.language.evaluation import holds
from knowledge_base.language.expression import Atom, Call, Comparison, Expression, Term, parts_of
from knowledge_base.language.printer import to_text
from knowledge_base.schema import ROOT_TYPE
from planning.conditions import Every, Grounder, Literal, Residual, Some
from planning.errors import UnsupportedActionError, UnsupportedGoalError
from planning.grounding import Variant, ground
from planning.interchange import spared, without
from planning.relevance import (
    changed_predicates,
    effect_conditions,
    effect_leaves,
    pruned,
    reachable,
    relevant_actions,
)
from planning.strips import GroundAction, Problem

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Sequence

    from knowledge_base.language.evaluation import World
    from knowledge_base.schema import Schema
    from planning.domain import PlanningAction, PlanningDomain

# Names with blanks, which no declared name can clash with.
_ACTING, _FINISHED = Fact("still acting"), Fact("finished acting")
_NOT, _ONE_OF = "not ", "one of"


@dataclass(frozen=True, slots=True)
class Grounded:
    """A problem before anything that cannot contribute is left out.

    Attributes:
        actions: the planning actions that may matter.
        grounder: evaluates conditions as far as these actions do not change them.
        wanted: what is left of the goal; `False` if it can never hold.
        init: facts that hold now, in positive normal form.
        goal: facts that shall hold.
        ways: the ground actions.
    """

    actions: tuple[PlanningAction, ...]
    grounder: Grounder
    wanted: Residual
    init: tuple[Fact, ...] = ()
    goal: tuple[Fact, ...] = ()
    ways: tuple[GroundAction, ...] = ()


def pose(domain: PlanningDomain, world: World, goal: Expression) -> Problem:
    """The problem of reaching `goal` from `world`, which stays as it is.

    Raises:
        InputError: the goal has a free variable, or names something that is not declared or not known.
        UnsupportedGoalError: the goal asks about a number that actions change, or about what is computed from
            something that they change.
        UnsupportedActionError: so does an action that matters, or it has too many alternatives.
    """
    check_goal(goal, world)
    if holds(goal, world):
        return Problem(domain.name, {}, (), (), ())
    whole = grounded(domain, world, goal)
    if whole.wanted is False:
        return Problem(domain.name, {}, (), (), (), unreachable=(to_text(goal),))
    reached, possible = reachable(whole.init, whole.ways)
    missing = dict.fromkeys(_said(fact, goal) for fact in whole.goal if fact not in reached)
    if missing:
        return Problem(domain.name, {}, (), (), (), unreachable=tuple(missing))
    parts = pruned(whole.init, whole.goal, possible)
    return _sliced(_problem(domain.name, world, *parts), world)


def _said(missing: Fact, goal: Expression) -> str:
    """A goal fact as its reader knows it."""
    if missing.predicate.startswith(_NOT):
        return f"(not {Fact(missing.predicate.removeprefix(_NOT), missing.args)})"
    return to_text(goal) if missing.predicate == _ONE_OF else str(missing)


def check_goal(goal: Expression, world: World) -> None:
    """Raise an `InputError` unless the goal says something about the things of this world."""
    known = {name: world.type_of(name) or ROOT_TYPE for name in world.objects(ROOT_TYPE)}
    check(goal, world.schema, objects=known)


def grounded(domain: PlanningDomain, world: World, goal: Expression) -> Grounded:
    """The problem of reaching a checked goal, with everything evaluated that cannot change.

    Raises:
        UnsupportedGoalError, UnsupportedActionError: as for `pose`.
    """
    actions = relevant_actions(goal, domain.actions.values())
    _refuse_numbers(goal, actions, domain)
    _refuse_computed(goal, actions, domain)
    changing = frozenset(p for action in actions for p in changed_predicates(action.effect))
    grounder = Grounder(world, changing)
    wanted = replace(grounder, keep_false=True).residual(goal, {})
    if wanted is False:
        return Grounded(actions, grounder, wanted)
    ways, literals = _with_conjunctive_goal(ground(actions, grounder), wanted)
    facts, ground_actions = _positive(ways, literals, world)
    return Grounded(actions, grounder, wanted, facts, tuple(map(as_fact, literals)), ground_actions)


def _sliced(whole: Problem, world: World) -> Problem:
    left_out = spared(whole.init, whole.goal, whole.actions, whole.objects)
    if not left_out:
        return whole
    possible = without(whole.actions, left_out)
    reached, _ = reachable(whole.init, possible)
    if not reached.issuperset(whole.goal):
        return whole
    slice_ = _problem(whole.domain, world, *pruned(whole.init, whole.goal, possible))
    return replace(slice_, whole=whole)


def _problem(
    name: str,
    world: World,
    init: tuple[Fact, ...],
    goal: tuple[Fact, ...],
    actions: tuple[GroundAction, ...],
) -> Problem:
    mentioned = dict.fromkeys(v for a in actions for v in (a.step.args if a.step else ()))
    mentioned.update(dict.fromkeys(str(v) for fact in (*init, *goal) for v in fact.args))
    types = {one: world.type_of(one) for one in mentioned}
    return Problem(name, {one: kind for one, kind in types.items() if kind is not None}, init, goal, actions)


def _with_conjunctive_goal(ways: list[Variant], goal: Residual) -> tuple[list[Variant], tuple[Literal, ...]]:
    """The goal as literals; a disjunction in it becomes a fact that bookkeeping actions can add.

    They can be taken only after the last real action: a disjunct that held once might be undone later.
    """
    bookkeeping: list[Variant] = []
    literals = _conjunction(goal, bookkeeping)
    if not bookkeeping:
        return ways, literals
    acting, finished = Literal(_ACTING), Literal(_FINISHED)
    real = [Variant(w.step, (*w.condition, acting), w.adds, w.deletes) for w in ways]
    finish = Variant(None, (acting,), (_FINISHED,), (_ACTING,))
    closing = [Variant(None, (*w.condition, finished), w.adds) for w in bookkeeping]
    return [*real, finish, *closing], literals


def _conjunction(goal: Residual, bookkeeping: list[Variant]) -> tuple[Literal, ...]:
    match goal:
        case Literal():
            return (goal,)
        case Every(parts):
            return tuple(literal for part in parts for literal in _conjunction(part, bookkeeping))
        case Some(parts):
            choices = [_conjunction(part, bookkeeping) for part in parts]
            chosen = Fact(_ONE_OF, (len(bookkeeping),))
            bookkeeping.extend(Variant(None, choice, (chosen,)) for choice in choices)
            return (Literal(chosen),)
        case _:
            return ()


def _positive(
    ways: Iterable[Variant], goal: Iterable[Literal], world: World
) -> tuple[tuple[Fact, ...], tuple[GroundAction, ...]]:
    """Initial facts and actions in positive normal form."""
    ways = list(ways)
    asked = dict.fromkeys([*goal, *(literal for way in ways for literal in way.condition)])
    opposite = {literal.fact: as_fact(literal) for literal in asked if not literal.positive}
    facts = tuple(as_fact(literal) for literal in asked if _holds(literal, world))
    return facts, tuple(_ground_action(way, opposite) for way in ways)


def _ground_action(way: Variant, opposite: dict[Fact, Fact]) -> GroundAction:
    return GroundAction(
        way.step,
        tuple(map(as_fact, way.condition)),
        (*way.adds, *(opposite[f] for f in way.deletes if f in opposite)),
        (*way.deletes, *(opposite[f] for f in way.adds if f in opposite)),
    )


def as_fact(literal: Literal) -> Fact:
    """The literal in positive normal form."""
    return literal.fact if literal.positive else Fact(_NOT + literal.fact.predicate, literal.fact.args)


def _holds(literal: Literal, world: World) -> bool:
    fact = literal.fact
    if fact.predicate not in world.schema.predicates:
        return fact == _ACTING
    return world.holds(fact.predicate, fact.args) is literal.positive


def _refuse_numbers(goal: Expression, actions: Sequence[PlanningAction], domain: PlanningDomain) -> None:
    """Conditions on numbers that actions change are out of reach of the engines."""
    leaves = [leaf for a in domain.actions.values() for leaf in effect_leaves(a.effect)]
    changed = {leaf.call.function for leaf in leaves if isinstance(leaf, Assign)}
    for comparison in _comparisons(goal):
        if _functions(comparison) & changed:
            raise UnsupportedGoalError(
                f"the goal asks for a value that planning actions change: {to_text(comparison)}",
                place=comparison.place,
            )
    for action in actions:
        for condition in (action.precondition, *effect_conditions(action.effect)):
            for comparison in _comparisons(condition):
                if _functions(comparison) & changed:
                    raise UnsupportedActionError(
                        f"planning action '{action.name}' asks for a value that planning actions change:"
                        f" {to_text(comparison)}",
                        place=comparison.place,
                    )


def _refuse_computed(goal: Expression, actions: Sequence[PlanningAction], domain: PlanningDomain) -> None:
    """What a function makes of things that actions change, no engine can foresee."""
    leaves = [leaf for a in domain.actions.values() for leaf in effect_leaves(a.effect)]
    changed = {leaf.call.function if isinstance(leaf, Assign) else leaf.atom.predicate for leaf in leaves}
    for atom, read in _computed_from(goal, domain.schema, changed):
        raise UnsupportedGoalError(
            f"the goal asks for what is computed from something that planning actions change:"
            f" {to_text(atom)} reads {to_text(read)}",
            place=atom.place,
        )
    for action in actions:
        for condition in (action.precondition, *effect_conditions(action.effect)):
            for atom, read in _computed_from(condition, domain.schema, changed):
                raise UnsupportedActionError(
                    f"planning action '{action.name}' asks for what is computed from something that planning"
                    f" actions change: {to_text(atom)} reads {to_text(read)}",
                    place=atom.place,
                )


def _computed_from(
    e: Expression | Term, schema: Schema, changed: Collection[str]
) -> Iterator[tuple[Atom, Expression | Term]]:
    """The computed atoms in `e`, each with what it reads of the functions and predicates in `changed`."""
    if isinstance(e, Atom) and e.predicate in schema.computed:
        for read in schema.computed[e.predicate].inputs(e.args):
            yield from ((e, part) for part in _parts(read) if _name(part) in changed)
            yield from ((e, inner) for _, inner in _computed_from(read, schema, changed))
    for part in parts_of(e):
        yield from _computed_from(part, schema, changed)


def _parts(e: Expression | Term) -> Iterator[Expression | Term]:
    yield e
    for part in parts_of(e):
        yield from _parts(part)


def _name(e: Expression | Term) -> str | None:
    """The function or predicate that it asks about."""
    return e.function if isinstance(e, Call) else e.predicate if isinstance(e, Atom) else None


def _comparisons(e: Expression | Term) -> list[Comparison | Atom]:
    """The conditions in which what functions are worth can count: as a side, or as an argument."""
    own = [e] if isinstance(e, Comparison | Atom) else []
    return own + [found for part in parts_of(e) for found in _comparisons(part)]


def _functions(e: Expression | Term) -> set[str]:
    own = {e.function} if isinstance(e, Call) else set()
    return own.union(*(_functions(part) for part in parts_of(e)))
