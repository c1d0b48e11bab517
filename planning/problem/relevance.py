"""Relevance for a goal (S1.5; exact, like `reduction`), and relevant constructs that engines cannot plan with."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass

from knowledge_base.errors import Place
from knowledge_base.language.syntax.effect import Add, Delete, NumericEffect, effect_conditions, effect_leaves
from knowledge_base.language.syntax.expression import Atom, Call, Comparison, Expression, Term, parts_of
from knowledge_base.language.syntax.text import to_text
from knowledge_base.world.schema import Schema
from planning.domain import PlanningAction, PlanningDomain
from planning.plan import NobodyCan
from planning.problem.derived import derivation
from planning.problem.expressions import changed, name_of, names_of
from planning.strips import UnsupportedActionError, UnsupportedGoalError


@dataclass(frozen=True, slots=True)
class Relevant:
    """The relevant part of a domain for a goal.

    Attributes:
        actions: the planning actions that change a predicate or function that a goal or relevant condition reads.
        changing: the predicates that these actions change, and those changed functions that a condition or cost reads.
    """

    actions: tuple[PlanningAction, ...]
    changing: frozenset[str]


def relevant(goal: Expression, metric: Term | None, actions: Iterable[PlanningAction]) -> Relevant:
    """Return the actions that change what the goal or another relevant action reads; `metric` adds none."""
    actions, needed = tuple(actions), frozenset(names_of(goal))
    while True:
        found = tuple(action for action in actions if needed & changed(action.effect))
        more = needed.union(*(_asked(action, needed) for action in found))
        if more == needed:
            break
        needed = more
    leaves = [leaf for action in found for leaf in effect_leaves(action.effect)]
    counted = needed | _counted(metric, leaves)
    return Relevant(
        found,
        frozenset(name_of(one) for one in leaves if not isinstance(one, NumericEffect) or name_of(one) in counted),
    )


def _asked(action: PlanningAction, needed: Collection[str]) -> Iterator[str]:
    """Yield the names that the action reads, without amounts of functions that are not needed."""
    yield from names_of(action.precondition)
    for condition in effect_conditions(action.effect):
        yield from names_of(condition)
    yield from _amounts(effect_leaves(action.effect), needed)


def _amounts(leaves: Iterable[Add | Delete | NumericEffect], of: Collection[str]) -> Iterator[str]:
    """Yield the names in amounts assigned to these functions."""
    for leaf in leaves:
        if isinstance(leaf, NumericEffect) and name_of(leaf) in of:
            yield from names_of(leaf.value)


def _counted(metric: Term | None, leaves: Collection[Add | Delete | NumericEffect]) -> frozenset[str]:
    """Return the functions in the metric, and those in the amounts by which these change."""
    own = frozenset() if metric is None else frozenset(names_of(metric))
    return own.union(_amounts(leaves, own))


def refuse_unforeseeable(goal: Expression, actions: Iterable[PlanningAction], domain: PlanningDomain) -> None:
    """Raise an error if the goal or a relevant action has a condition that no engine can foresee.

    Raises:
        UnsupportedGoalError, UnsupportedActionError: with the place and the condition.
    """
    schema = domain.schema
    changing = frozenset[str]().union(*(changed(action.effect) for action in domain.actions.values()))
    content = {name for name in changing & schema.functions.keys() if schema.result(name) != "number"}
    if not content and not schema.computed:
        return
    for asked, why in _unforeseeable(goal, schema, changing, content):
        raise UnsupportedGoalError(f"the goal asks for {why}", place=asked.place)
    for action in actions:
        for condition in (action.precondition, *effect_conditions(action.effect)):
            for asked, why in _unforeseeable(condition, schema, changing, content):
                raise UnsupportedActionError(f"planning action '{action.name}' asks for {why}", place=asked.place)


def _unforeseeable(
    e: Expression, schema: Schema, changing: Collection[str], content: Collection[str]
) -> Iterator[tuple[Expression, str]]:
    for atom, read in _computed_from(e, schema, changing):
        told = f"{to_text(atom)} reads {to_text(read)}"
        yield atom, f"what is computed from something that planning actions change: {told}"
    for part in _parts(e):
        if isinstance(part, Comparison | Atom) and any(_name(inner) in content for inner in _parts(part)):
            yield part, f"a value that planning actions change, and which is no number: {to_text(part)}"


def _computed_from(
    e: Expression | Term, schema: Schema, changing: Collection[str]
) -> Iterator[tuple[Atom, Expression | Term]]:
    """Yield the computed atoms in `e`, each with the expressions it reads from `changing`."""
    if isinstance(e, Atom) and e.predicate in schema.computed:
        for read in schema.computed[e.predicate].inputs(e.args):
            yield from ((e, part) for part in _parts(read) if _name(part) in changing)
            yield from ((e, inner) for _, inner in _computed_from(read, schema, changing))
    for part in parts_of(e):
        yield from _computed_from(part, schema, changing)


def _parts(e: Expression | Term) -> Iterator[Expression | Term]:
    yield e
    for part in parts_of(e):
        yield from _parts(part)


def _name(e: Expression | Term) -> str | None:
    """Return the function or predicate of the expression."""
    return e.function if isinstance(e, Call) else e.predicate if isinstance(e, Atom) else None


@dataclass(frozen=True, slots=True)
class Construct:
    """A condition on numbers that actions change.

    Attributes:
        owner: `the goal`, or the planning action with the condition.
        text: the condition, in PDDL.
        place: its place in the source file.
    """

    owner: str
    text: str
    place: Place | None

    def __str__(self) -> str:
        """One line: `jars.pddl:7:9: planning action 'pour' compares numbers that actions change: (> (litres ?a) 0)`."""
        said = f"{self.owner} compares numbers that actions change: {self.text}"
        return f"{self.place}: {said}" if self.place else said


def numeric_constructs(domain: PlanningDomain, goal: Expression) -> Iterator[Construct]:
    """Yield the numeric conditions relevant to `goal`: the goal's own first, then those of actions."""
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
    """Return in one line the construct that no installed engine supports, its place, and an engine to install.

    Args:
        domain: the planning domain.
        goal: the condition to reach.
        nobody: the engine selection's answer.
    """
    construct = next(numeric_constructs(domain, goal), None)
    return nobody.message if construct is None else f"{construct}; {nobody.who}"


def _comparisons(e: Expression | Term) -> Iterator[Comparison]:
    if isinstance(e, Comparison):
        yield e
    for part in parts_of(e):
        yield from _comparisons(part)
