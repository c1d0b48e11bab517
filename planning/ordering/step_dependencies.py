"""Dependencies of a step on its world: the conditions that it needs, and the facts and numbers that it changes.

A condition is divided into ground conditions that must all hold. The *support* of each ground condition consists of the
literals and numeric fluents that decide its truth. One true part suffices as the support of a disjunction.

A quantified condition with more than `MOST_INSTANCES` instances is not divided. A query finds the few instances whose
truth depends on facts that steps change, as for a condition of a plot.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import chain, islice
from math import prod

from knowledge_base.errors import SchemaError
from knowledge_base.facts import Delta, Fact
from knowledge_base.language.checking.vocabulary import ROOT_TYPE
from knowledge_base.language.evaluation.evaluator import apply_effect, choices, evaluate_argument, holds, rows
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax import effect as eff
from knowledge_base.language.syntax import expression as ex
from knowledge_base.language.syntax.effect import Effect
from knowledge_base.language.syntax.expression import Atom, Expression, Term
from knowledge_base.language.syntax.rewriting import inside, name_in
from knowledge_base.world.derived import type_test
from knowledge_base.world.overlay import Overlay
from planning.problem.conditions import Literal

MOST_INSTANCES = 300
"""Number of instances up to which a quantified condition is divided into them."""
MOST_UNDECIDED = 1000
"""Number of instances from which the false facts of a predicate together are one reason to wait."""


@dataclass(frozen=True, slots=True)
class Unlisted:
    """Facts that decide a condition with many instances, and that its support does not list.

    Attributes:
        predicate: the predicate, all of whose false facts must stay false; without one, facts that no step changes.
    """

    predicate: str = ""


Ground = Literal | Fact | Unlisted
"""A literal, a numeric fluent (written as a `Fact`) whose value matters, or unlisted facts."""
Names = frozenset[str]
"""Names of predicates and functions."""
Support = frozenset[Ground]
"""The literals and fluents that decide the truth of a condition."""
Rank = Callable[[Support], int]
"""Returns the rank of a support; among several supports the one with the lowest rank is chosen."""

_COMMUTING = frozenset({"increase", "decrease"})
_DIRECTIONS = {">": 1, ">=": 1, "<": -1, "<=": -1}


@dataclass(slots=True)
class Changes:
    """The changes by an effect in a world, and the conditions and numbers that the effect reads there.

    Attributes:
        conditions: the conditions of conditional effects; a false condition is negated.
        makes: the literals that are true at some time during the effect; both literals of a fact that is deleted and
            added.
        numbers: the fluents that the effect changes; true if it only adds to the fluent, because additions commute.
        reads: the fluents whose values the effect uses.
    """

    conditions: list[Expression] = field(default_factory=list)
    makes: dict[Literal, None] = field(default_factory=dict)
    numbers: dict[Fact, bool] = field(default_factory=dict)
    reads: set[Fact] = field(default_factory=set)

    def delta(self) -> Delta:
        """Return the changed facts; a fact that is both deleted and added is true, as in PDDL."""
        added = tuple([one.fact for one in self.makes if one.positive])
        return Delta(added=added, removed=tuple([o.fact for o in self.makes if not o.positive and o.fact not in added]))


def changes(effect: Effect, world: World, after: Effect | None = None) -> Changes:
    """Return the changes by a ground effect in `world`, which stays unchanged.

    Args:
        effect: the effect of an action.
        world: the world before the effect.
        after: the start effect of a durative action, which precedes `effect`.
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
        case eff.Add(atom) | eff.Delete(atom):
            found.makes[Literal(ground(atom, world), isinstance(effect, eff.Add))] = None
        case eff.AllOf(parts):
            for part in parts:
                _collect(part, world, found)
        case eff.ForEach():
            for chosen in choices(effect.variables, world):
                _collect(eff.substitute_effect(effect.effect, chosen), world, found)
        case eff.When(condition, inner):
            happens = holds(condition, world, {})
            found.conditions += ground_conjuncts(condition, world, wanted=happens)
            if happens:
                _collect(inner, world, found)
        case eff.NumericEffect(operator, call, value):
            fluent = ground(call, world)
            found.numbers[fluent] = operator in _COMMUTING and found.numbers.get(fluent, True)
            found.reads |= set(_fluents(value, world))


def ground_conjuncts(e: Expression, world: World, *, wanted: bool = True) -> Iterator[Expression]:
    """Yield ground conditions whose conjunction is equivalent to `e`; to its negation if `wanted` is false."""
    match e:
        case ex.Not(body):
            yield from ground_conjuncts(body, world, wanted=not wanted)
        case ex.Forall() | ex.Exists() if _has_many_instances(e, world):
            yield e if wanted else ex.Not(e)
        case ex.And() | ex.Or() | ex.Imply() | ex.Forall() | ex.Exists() if _is_conjunction(e, wanted=wanted):
            for part in _parts(e, world):
                yield from ground_conjuncts(part, world, wanted=wanted)
        case _:
            yield e if wanted else ex.Not(e)


def support(
    e: Expression, world: World, rank: Rank, changing: Names | None = None, *, wanted: bool = True
) -> Support | None:
    """Return the support of a ground condition, or `None` if the condition is false.

    Args:
        e: the condition.
        world: the world in which the condition is needed.
        rank: the rank of a support.
        changing: the predicates and functions that steps change; `None` if they are unknown.
        wanted: whether `e` is needed, or else its negation.
    """
    match e:
        case Atom(predicate) if predicate in world.schema.predicates:
            fact = ground(e, world)
            as_wanted = world.holds(fact.predicate, fact.args) is wanted
            return frozenset({Literal(fact, wanted)}) if as_wanted else None
        case ex.Not(body):
            return support(body, world, rank, changing, wanted=not wanted)
        case ex.Forall() | ex.Exists() if _has_many_instances(e, world):
            return _support_of_many(e, world, rank, changing, wanted=wanted)
        case Atom() | ex.Comparison():  # a type never changes
            as_wanted = holds(e, world, {}) is wanted
            return frozenset(chain(*(_fluents(part, world) for part in ex.parts_of(e)))) if as_wanted else None
        case _:
            found = (support(part, world, rank, changing, wanted=wanted) for part in _parts(e, world))
            return _all(found) if _is_conjunction(e, wanted=wanted) else _best(found, rank)


def _has_many_instances(e: ex.Forall | ex.Exists, world: World) -> bool:
    """Return whether a query is to find the instances; it cannot test a type whose name is also a predicate."""
    kinds = [variable.types or (ROOT_TYPE,) for variable in e.variables]
    if not all(world.schema.is_type(one, 1) for types in kinds for one in types):
        return False
    return prod(sum(1 for one in types for _ in world.objects(one)) for types in kinds) > MOST_INSTANCES


def _support_of_many(
    e: ex.Forall | ex.Exists, world: World, rank: Rank, changing: Names | None, *, wanted: bool
) -> Support | None:
    """Return the support of a quantified condition with many instances; arguments as for `support`."""
    if not _is_conjunction(e, wanted=wanted):
        true = islice(_instances(e, _in_normal_form(e.body, wanted=wanted), world), MOST_INSTANCES)
        return _best((support(one, world, rank, changing, wanted=wanted) for one in true), rank)
    undecided = _Undecided(world, changing, by_absence=False)
    instances = list(islice(_instances(e, undecided.part(e.body, wanted=wanted), world), MOST_UNDECIDED))
    if len(instances) == MOST_UNDECIDED:
        undecided = _Undecided(world, changing, by_absence=True)
        instances = list(_instances(e, undecided.part(e.body, wanted=wanted), world))
    found = _all(support(one, world, rank, changing, wanted=wanted) for one in instances)
    return None if found is None else found | {Unlisted(), *map(Unlisted, undecided.absent)}


def _instances(e: ex.Forall | ex.Exists, condition: Expression, world: World) -> Iterator[Expression]:
    """Yield the bodies of those instances for which a condition on the variables is true, found by a join."""
    typed = tuple(type_test(variable, ex.Variable(variable.name)) for variable in e.variables)
    for chosen in rows(ex.And((*typed, condition)), world):
        yield ex.substitute(e.body, chosen)


def _in_normal_form(e: Expression, *, wanted: bool) -> Expression:
    """Return `e`, or its negation, with `not` only at its leaves and quantifiers, so that a join can use the atoms."""
    match e:
        case ex.Not(body):
            return _in_normal_form(body, wanted=not wanted)
        case ex.Imply(premise, conclusion):
            return _in_normal_form(ex.Or((ex.Not(premise), conclusion)), wanted=wanted)
        case ex.And(parts) | ex.Or(parts):
            join = ex.And if isinstance(e, ex.And) is wanted else ex.Or
            return join(tuple(_in_normal_form(part, wanted=wanted) for part in parts))
        case _:
            return e if wanted else ex.Not(e)


@dataclass(slots=True)
class _Undecided:
    """Conditions for those instances of a body whose truth may depend on facts that steps change.

    Attributes:
        world: the present world.
        changing: the predicates and functions that steps change; `None` if they are unknown.
        by_absence: whether false facts of one predicate decide instances.
        absent: the predicate whose false facts decide other instances; only one, as each is a reason to wait.
    """

    world: World
    changing: Names | None
    by_absence: bool
    absent: set[str] = field(default_factory=set)

    def part(self, e: Expression, *, wanted: bool) -> Expression:
        """Return the condition for `e`, or for its negation: false if the instance stays true in any case."""
        match e:
            case ex.Not(body):
                return self.part(body, wanted=not wanted)
            case ex.Imply(premise, conclusion):
                return self.part(ex.Or((ex.Not(premise), conclusion)), wanted=wanted)
            case ex.And(parts) | ex.Or(parts):
                join = ex.Or if isinstance(e, ex.And) is wanted else ex.And
                return join(tuple(self.part(part, wanted=wanted) for part in parts))
            case _ if not self._may_change(e):
                return ex.Not(e) if wanted else e
            case Atom(predicate) if self.by_absence and not wanted and self.absent <= {predicate}:
                self.absent.add(predicate)
                return e
            case _:
                return ex.And(())

    def _may_change(self, e: Expression) -> bool:
        return any(self._is_changing(one) for one in inside(e))

    def _is_changing(self, e: Expression | Term) -> bool:
        name = name_in(e)
        if name is None or (isinstance(e, Atom) and name not in self.world.schema.predicates):  # a type, or computed
            return False
        return self.changing is None or name in self.changing


def favours(e: Expression, fluent: Fact, world: World) -> float | None:
    """Return the factor by which an increase of the number helps a comparison to be true.

    The factor is positive, negative, or 0 without influence. It is `None` if it depends on more than the condition.
    """
    match e:
        case ex.Not(ex.Comparison(operator, left, right)) if operator in _DIRECTIONS:
            sign = -_DIRECTIONS[operator]
        case ex.Comparison(operator, left, right) if operator in _DIRECTIONS:
            sign = _DIRECTIONS[operator]
        case _:
            return None
    more, less = _slope(left, fluent, world), _slope(right, fluent, world)
    return None if more is None or less is None else sign * (more - less)


def _slope(term: Term, fluent: Fact, world: World) -> float | None:
    match term:
        case ex.Call():
            return float(ground(term, world) == fluent)
        case ex.Arithmetic("+" | "-" as operator, args):
            slopes = [_slope(arg, fluent, world) for arg in args]
            if None in slopes:
                return None
            first, *rest = (slope or 0.0 for slope in slopes)
            if operator == "+":
                return first + sum(rest)
            return first - sum(rest) if rest else -first
        case ex.Arithmetic():
            return None if fluent in _fluents(term, world) else 0.0
        case _:
            return 0.0


def ground(form: Atom | ex.Call, world: World) -> Fact:
    """Return the fact or numeric fluent of an expression without variables."""
    name = form.predicate if isinstance(form, Atom) else form.function
    return Fact(name, tuple(t.value if isinstance(t, ex.Constant) else evaluate_argument(t, world) for t in form.args))


def _is_conjunction(e: Expression, *, wanted: bool) -> bool:
    """Return whether all parts are needed, since one part suffices otherwise; `wanted` applies De Morgan's laws."""
    return isinstance(e, ex.And | ex.Forall) is wanted


def _parts(e: Expression, world: World) -> Iterable[Expression]:
    match e:
        case ex.And(parts) | ex.Or(parts):
            return parts
        case ex.Imply(premise, conclusion):
            return ex.Not(premise), conclusion
        case ex.Exists(variables, body) | ex.Forall(variables, body):
            return (ex.substitute(body, chosen) for chosen in choices(variables, world))
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
    if isinstance(e, ex.Call):
        yield ground(e, world)
    for part in ex.parts_of(e):
        yield from _fluents(part, world)
