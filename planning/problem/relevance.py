"""Relevance for a goal (S1.5; exact, as in `reduction`), and relevant constructs that engines do not support."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass

from knowledge_base.errors import Place
from knowledge_base.language.syntax.effect import Add, Delete, NumericEffect, effect_leaves
from knowledge_base.language.syntax.expression import Atom, Comparison, Expression, Term
from knowledge_base.language.syntax.rewriting import inside, name_in, names_of
from knowledge_base.language.syntax.text import to_text
from planning.model.domain import PlanningAction, PlanningDomain
from planning.model.plan import Unsupported
from planning.model.problem import UnsupportedActionError, UnsupportedGoalError
from planning.problem.derived import Derivation, derivation
from planning.problem.expressions import changed, conditions_of, name_of


@dataclass(frozen=True, slots=True)
class Relevant:
    """The relevant part of a domain for a goal.

    Attributes:
        actions: the planning actions that change a predicate or function that the goal or a relevant condition reads.
        changing: the predicates that these actions change, and the changed functions that a condition or cost reads.
    """

    actions: tuple[PlanningAction, ...]
    changing: frozenset[str]


def relevant(goal: Expression, metric: Term | None, actions: Iterable[PlanningAction]) -> Relevant:
    """Return the actions that change what the goal or a relevant action reads; `metric` adds functions, not actions."""
    actions, needed = tuple(actions), frozenset(names_of(goal))
    while True:
        found = tuple(action for action in actions if needed & changed(action.effect))
        leaves = [leaf for action in found for leaf in effect_leaves(action.effect)]
        read = [names_of(condition) for action in found for condition in conditions_of(action)]
        more = needed.union(*read, *_amounts(leaves, needed))
        if more == needed:
            break
        needed = more
    priced = () if metric is None else names_of(metric)
    counted = needed.union(priced, *_amounts(leaves, priced))
    changing = [name_of(one) for one in leaves if not isinstance(one, NumericEffect) or name_of(one) in counted]
    return Relevant(found, frozenset(changing))


def _amounts(leaves: Iterable[Add | Delete | NumericEffect], of: Collection[str]) -> list[list[str]]:
    """Return the names in each amount that is assigned to one of these functions."""
    return [names_of(one.value) for one in leaves if isinstance(one, NumericEffect) and name_of(one) in of]


def refuse_unsupported(goal: Expression, actions: Iterable[PlanningAction], derived: Derivation) -> None:
    """Raise an error if the goal or a relevant action has a condition that no engine can foresee.

    Args:
        goal: the goal, with derived predicates expanded.
        actions: the relevant actions, with derived predicates expanded.
        derived: the derivation of the domain.

    Raises:
        UnsupportedGoalError, UnsupportedActionError: the message contains the condition, the reason and the place.
    """
    schema = derived.domain.schema
    content = {name for name in derived.changing & schema.functions.keys() if schema.result(name) != "number"}
    if not content and not schema.computed and not derived.unsupported:
        return
    for asked, why in _unforeseeable(goal, derived, content):
        raise UnsupportedGoalError(f"the goal asks for {why}", place=asked.place)
    for action in actions:
        for condition in conditions_of(action):
            for asked, why in _unforeseeable(condition, derived, content):
                raise UnsupportedActionError(f"planning action '{action.name}' asks for {why}", place=asked.place)


def _unforeseeable(e: Expression, derived: Derivation, content: set[str]) -> Iterator[tuple[Expression, str]]:
    """Yield the conditions in `e` that no engine can foresee, each with the reason."""
    for part in inside(e):
        if isinstance(part, Atom):
            if part.predicate in derived.unsupported:
                yield part, derived.why(part.predicate)
            for read in _read_by(part, derived):
                told = f"{to_text(part)} reads {to_text(read)}"
                yield part, f"what is computed from something that planning actions change: {told}"
        if isinstance(part, Comparison | Atom) and not content.isdisjoint(names_of(part)):
            yield part, f"a value that planning actions change, and which is no number: {to_text(part)}"


def _read_by(atom: Atom, derived: Derivation) -> Iterator[Expression | Term]:
    """Yield the changeable expressions that a computed atom reads, directly or through other computed atoms."""
    computed = derived.domain.schema.computed
    for read in computed[atom.predicate].inputs(atom.args) if atom.predicate in computed else ():
        for part in inside(read):
            if name_in(part) in derived.changing:
                yield part
            if isinstance(part, Atom):
                yield from _read_by(part, derived)


@dataclass(frozen=True, slots=True)
class Construct:
    """A condition on numbers that actions change.

    Attributes:
        owner: `the goal`, or the planning action that contains the condition.
        text: the condition, in PDDL.
        place: the place of the condition in the source file.
    """

    owner: str
    text: str
    place: Place | None

    def __str__(self) -> str:
        """Return one line, e.g. `jars.pddl:7:9: planning action 'pour' compares numbers ...: (> (litres ?a) 0)`."""
        said = f"{self.owner} compares numbers that actions change: {self.text}"
        return f"{self.place}: {said}" if self.place else said


def numeric_constructs(domain: PlanningDomain, goal: Expression) -> Iterator[Construct]:
    """Yield the numeric conditions relevant to `goal`: first conditions of the goal, then conditions of actions."""
    derived = derivation(domain)
    goal = derived.expand(goal)
    matters = relevant(goal, None, derived.domain.actions.values())
    conditions = [("the goal", goal)]
    for action in matters.actions:
        conditions += [(f"planning action '{action.name}'", one) for one in conditions_of(action)]
    for owner, condition in conditions:
        for one in inside(condition):
            if isinstance(one, Comparison) and not matters.changing.isdisjoint(names_of(one)):
                yield Construct(owner, to_text(one), one.place)


def why_no_engine(domain: PlanningDomain, goal: Expression, nobody: Unsupported) -> str:
    """Return one line: the construct that no installed engine supports, its place, and an engine to install.

    Args:
        domain: the planning domain.
        goal: the condition to reach.
        nobody: the refusal by the choice of engines.
    """
    construct = next(numeric_constructs(domain, goal), None)
    return nobody.message if construct is None else f"{construct}; {nobody.who}"
