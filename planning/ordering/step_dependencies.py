"""What a step needs of the world it is taken in, and what it changes there: the stuff that orders are made of.

A condition is split into ground conditions that must all hold. Each of them is traced to its *support*: facts, as
they are, and numbers on which its truth rests. Of a disjunction, one part that holds is enough.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import chain

from knowledge_base.errors import SchemaError
from knowledge_base.facts import Delta, Fact
from knowledge_base.language.effect import Add, AllOf, Delete, Effect, ForEach, NumericEffect, When, substitute_effect
from knowledge_base.language.effect_application import apply_effect, choices
from knowledge_base.language.evaluation import World, evaluate_argument, holds
from knowledge_base.language.expression import (
    And,
    Arithmetic,
    Atom,
    Call,
    Comparison,
    Constant,
    Exists,
    Expression,
    Forall,
    Imply,
    Not,
    Or,
    Term,
    parts_of,
    substitute,
)
from knowledge_base.world.overlay import Overlay
from planning.problem.conditions import Literal

Ground = Literal | Fact
"""A fact as it is wanted, or a numeric fluent (written as a `Fact`) whose value counts."""
Support = frozenset[Ground]
"""What a condition's truth rests on."""
Rank = Callable[[Support], int]
"""Of several supports the one with the lowest rank is taken."""

_COMMUTING = frozenset({"increase", "decrease"})
_DIRECTIONS = {">": 1, ">=": 1, "<": -1, "<=": -1}


@dataclass(slots=True)
class Changes:
    """What an effect does to a world, and what it depends on there.

    Attributes:
        conditions: those of its conditional effects, each in the form that holds.
        makes: facts that are true or false at some time while it happens; both, if it deletes and adds one.
        numbers: the fluents it changes, and whether only by adding to them, which may be done in any order.
        reads: fluents whose values it uses.
    """

    conditions: list[Expression] = field(default_factory=list)
    makes: dict[Literal, None] = field(default_factory=dict)
    numbers: dict[Fact, bool] = field(default_factory=dict)
    reads: set[Fact] = field(default_factory=set)

    def delta(self) -> Delta:
        """The changed facts; what is both deleted and added is true, as in PDDL."""
        added = tuple([one.fact for one in self.makes if one.positive])
        return Delta(added=added, removed=tuple([o.fact for o in self.makes if not o.positive and o.fact not in added]))


def changes(effect: Effect, world: World, after: Effect | None = None) -> Changes:
    """What a ground effect does in `world`, which stays as it is.

    Args:
        effect: of an action.
        world: where it happens.
        after: of a durative action, its effect at the start, which comes first.
    """
    found = Changes()
    if after is not None:
        _collect(after, world, found)
        ahead = Overlay(world)
        ahead.apply(apply_effect(after, world))
        world = ahead
    _collect(effect, world, found)
    return found


def _collect(effect: Effect, world: World, found: Changes) -> None:
    match effect:
        case Add(atom) | Delete(atom):
            found.makes[Literal(ground(atom, world), isinstance(effect, Add))] = None
        case AllOf(parts):
            for part in parts:
                _collect(part, world, found)
        case ForEach():
            for chosen in choices(effect.variables, world):
                _collect(substitute_effect(effect.effect, chosen), world, found)
        case When(condition, inner):
            happens = holds(condition, world, {})
            found.conditions += conjuncts(condition, world, wanted=happens)
            if happens:
                _collect(inner, world, found)
        case NumericEffect(operator, call, value):
            fluent = ground(call, world)
            found.numbers[fluent] = operator in _COMMUTING and found.numbers.get(fluent, True)
            found.reads |= set(_fluents(value, world))


def conjuncts(e: Expression, world: World, *, wanted: bool = True) -> Iterator[Expression]:
    """Ground conditions that together say what `e` says (the opposite if not `wanted`)."""
    match e:
        case Not(body):
            yield from conjuncts(body, world, wanted=not wanted)
        case And() | Or() | Imply() | Forall() | Exists() if _is_conjunction(e, wanted=wanted):
            for part in _parts(e, world):
                yield from conjuncts(part, world, wanted=wanted)
        case _:
            yield e if wanted else Not(e)


def support(e: Expression, world: World, rank: Rank, *, wanted: bool = True) -> Support | None:
    """What the truth of a ground condition (its falsehood if not `wanted`) rests on; `None` if it is otherwise."""
    match e:
        case Atom(predicate) if predicate in world.schema.predicates:
            fact = ground(e, world)
            as_wanted = world.holds(fact.predicate, fact.args) is wanted
            return frozenset({Literal(fact, wanted)}) if as_wanted else None
        case Not(body):
            return support(body, world, rank, wanted=not wanted)
        case Atom() | Comparison():  # a type never changes
            as_wanted = holds(e, world, {}) is wanted
            return frozenset(chain(*(_fluents(part, world) for part in parts_of(e)))) if as_wanted else None
        case _:
            found = (support(part, world, rank, wanted=wanted) for part in _parts(e, world))
            return _all(found) if _is_conjunction(e, wanted=wanted) else _best(found, rank)


def favours(e: Expression, fluent: Fact, world: World) -> float | None:
    """The factor by which a greater number is good for a comparison: positive, negative, or 0 if it does not matter.

    `None` if that cannot be said of the condition by itself.
    """
    match e:
        case Not(Comparison(operator, left, right)) if operator in _DIRECTIONS:
            sign = -_DIRECTIONS[operator]
        case Comparison(operator, left, right) if operator in _DIRECTIONS:
            sign = _DIRECTIONS[operator]
        case _:
            return None
    more, less = _slope(left, fluent, world), _slope(right, fluent, world)
    return None if more is None or less is None else sign * (more - less)


def _slope(term: Term, fluent: Fact, world: World) -> float | None:
    match term:
        case Call():
            return float(ground(term, world) == fluent)
        case Arithmetic("+" | "-" as operator, args):
            slopes = [_slope(arg, fluent, world) for arg in args]
            if None in slopes:
                return None
            first, *rest = (slope or 0.0 for slope in slopes)
            if operator == "+":
                return first + sum(rest)
            return first - sum(rest) if rest else -first
        case Arithmetic():
            return None if fluent in _fluents(term, world) else 0.0
        case _:
            return 0.0


def ground(form: Atom | Call, world: World) -> Fact:
    """The fact or fluent that a form without variables names."""
    name = form.predicate if isinstance(form, Atom) else form.function
    return Fact(name, tuple(t.value if isinstance(t, Constant) else evaluate_argument(t, world) for t in form.args))


def _is_conjunction(e: Expression, *, wanted: bool) -> bool:
    """Whether all parts are needed; of the others, one is enough. De Morgan's laws swap them."""
    return isinstance(e, And | Forall) is wanted


def _parts(e: Expression, world: World) -> Iterable[Expression]:
    match e:
        case And(parts) | Or(parts):
            return parts
        case Imply(premise, conclusion):
            return Not(premise), conclusion
        case Exists(variables, body) | Forall(variables, body):
            return (substitute(body, chosen) for chosen in choices(variables, world))
        case _:
            raise SchemaError(f"{e} has no parts")


def _all(found: Iterable[Support | None]) -> Support | None:
    together: set[Ground] = set()
    for one in found:
        if one is None:
            return None
        together |= one
    return frozenset(together)


def _best(found: Iterable[Support | None], rank: Rank) -> Support | None:
    return min((one for one in found if one is not None), key=lambda one: (rank(one), len(one)), default=None)


def _fluents(e: Expression | Term, world: World) -> Iterator[Fact]:
    if isinstance(e, Call):
        yield ground(e, world)
    for part in parts_of(e):
        yield from _fluents(part, world)
