"""Grounding: planning actions as joins over facts, and the ground operators of an action for given arguments."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from knowledge_base.facts import Fact, Value
from knowledge_base.language.checking.vocabulary import Vocabulary
from knowledge_base.language.evaluation.lookups import conjuncts
from knowledge_base.language.syntax.expression import Atom, Constant, Variable
from planning.model.cancellable_work import WorkLimit
from planning.model.domain import PlanningAction
from planning.model.plan import PlanStep
from planning.model.problem import UnsupportedActionError
from planning.model.quantities import Assignment, combined, fluents
from planning.problem.conditions import (
    Every,
    GroundEffect,
    Grounder,
    Leaf,
    Literal,
    Residual,
    alternatives,
    every,
    negation,
)
from planning.problem.task import GroundOperator, Numbering, ground_operator

_MOST_CONDITIONS = 6  # conditions of effects of one ground action; each doubles the number of operators
_MOST_ALTERNATIVES = 64
_AS_THEY_ARE = "planners that take ADL as it is, such as Fast Downward run by itself"


def ground_operators(
    action: PlanningAction, bindings: Mapping[str, Value], grounder: Grounder, numbering: Numbering
) -> Iterator[GroundOperator]:
    """Yield an operator of cost 1 for each alternative of the precondition and the conditional effects.

    Raises:
        UnsupportedActionError: there are too many alternatives, or two effects change one number in different ways.
    """
    precondition = grounder.precondition(action.precondition, bindings)
    if precondition is False:
        return
    step = PlanStep(action.name, tuple([str(bindings[p.name]) for p in action.parameters]))
    effects = _ease_conditions(list(grounder.effects(action.effect, bindings)))
    conditions: dict[Residual, None] = {}
    for one in effects:
        if one.condition is not True and negation(one.condition) not in conditions:
            conditions[one.condition] = None
    if len(conditions) > _MOST_CONDITIONS:
        raise UnsupportedActionError(
            f"planning action '{action.name}' has {len(conditions)} conditional effects for {step};"
            f" at most {_MOST_CONDITIONS} can be compiled away; supported by: {_AS_THEY_ARE}",
            place=action.place,
        )
    grounder.patience.spend()
    for taken in itertools.product((True, False), repeat=len(conditions)):
        chosen = [c if yes else negation(c) for c, yes in zip(conditions, taken, strict=True)]
        happening = {True, *chosen}
        changes = [e.what for e in effects if e.condition in happening]
        for condition in _list_alternatives(every([precondition, *chosen]), action):
            yield ground_operator(step, condition, _literals(changes), numbering, _assignments(changes, action))


def _ease_conditions(effects: list[GroundEffect]) -> list[GroundEffect]:
    """Return equivalent effects with weaker conditions.

    A delete needs no condition that its fact is true. An add needs no condition that its fact is false, unless another
    effect deletes the fact at the same time.
    """
    if all(one.condition is True for one in effects):
        return effects
    deleted = {one.what.fact for one in effects if isinstance(one.what, Literal) and not one.what.positive}
    return [
        GroundEffect(_except(one.condition, one.what.negated), one.what)
        if isinstance(one.what, Literal) and not (one.what.positive and one.what.fact in deleted)
        else one
        for one in effects
    ]


def _except(condition: Residual, known: Literal) -> Residual:
    parts = condition.parts if isinstance(condition, Every) else (condition,)
    return every(part for part in parts if part != known)


def _list_alternatives(condition: Residual, action: PlanningAction) -> list[tuple[Leaf, ...]]:
    found = list(itertools.islice(alternatives(condition), _MOST_ALTERNATIVES + 1))
    if len(found) > _MOST_ALTERNATIVES:
        raise UnsupportedActionError(
            f"the precondition of planning action '{action.name}' has over {_MOST_ALTERNATIVES} alternatives"
            f" ('or', 'imply' or 'exists' over what actions change); supported by: {_AS_THEY_ARE}",
            place=action.place,
        )
    return found


def _literals(changes: Iterable[Literal | Assignment]) -> tuple[Literal, ...]:
    literals = dict.fromkeys(c for c in changes if isinstance(c, Literal))
    # PDDL: a fact that is both deleted and added is true.
    return tuple([one for one in literals if one.positive or one.negated not in literals])


def _assignments(changes: Iterable[Literal | Assignment], action: PlanningAction) -> tuple[Assignment, ...]:
    found: dict[Fact, Assignment] = {}
    for change in changes:
        if isinstance(change, Assignment):
            first = found.get(change.fluent)
            found[change.fluent] = change if first is None else _both(first, change, action)
    return tuple(found.values())


def _both(first: Assignment, second: Assignment, action: PlanningAction) -> Assignment:
    if first.increase and second.increase:
        return Assignment(first.fluent, combined("+", (first.amount, second.amount)), increase=True)
    if first == second and first.fluent not in fluents(first.amount):
        return first
    raise UnsupportedActionError(
        f"planning action '{action.name}' changes {first.fluent} in two ways", place=action.place
    )


class ReachedFacts:
    """An index of facts by predicate, and by predicate, argument position and value."""

    def __init__(self, facts: Iterable[Fact] = ()) -> None:
        self._index: dict[tuple[Value, ...], list[Fact]] = {}
        for fact in facts:
            self.add(fact)

    def add(self, fact: Fact) -> None:
        """Add a fact that is not in the index."""
        for key in ((fact.predicate,), *((fact.predicate, i, v) for i, v in enumerate(fact.args))):
            self._index.setdefault(key, []).append(fact)

    def candidates(self, atom: Atom, bindings: Mapping[str, Value]) -> Sequence[Fact]:
        """Return a short list that contains at least every fact that matches `atom`."""
        found: Sequence[Fact] = self._index.get((atom.predicate,), ())
        for position, term in enumerate(atom.args):
            value = term.value if isinstance(term, Constant) else bindings.get(_name(term))
            if value is not None:
                narrower = self._index.get((atom.predicate, position, value), ())
                found = min(found, narrower, key=len)
        return found


def _name(term: object) -> str:
    return term.name if isinstance(term, Variable) else ""


@dataclass(frozen=True, slots=True)
class JoinRule:
    """A planning action as a join over facts.

    Attributes:
        action: the planning action.
        atoms: the positive conjuncts of the action's precondition.
        allowed: the objects that each parameter may have as its value.
    """

    action: PlanningAction
    atoms: tuple[Atom, ...]
    allowed: Mapping[str, Mapping[str, None]]

    @staticmethod
    def of(action: PlanningAction, grounder: Grounder) -> JoinRule:
        """Return the join rule of an action, with the objects of the grounder's world."""
        atoms = joined_atoms(action, grounder.world.schema)
        return JoinRule(action, atoms, {p.name: grounder.objects(p) for p in action.parameters})

    def unify(self, atom: Atom, fact: Fact, bindings: Mapping[str, Value]) -> dict[str, Value] | None:
        """Return the bindings, extended so that the atom equals the fact; `None` if that is not possible."""
        extended = dict(bindings)
        for term, value in zip(atom.args, fact.args, strict=True):
            if isinstance(term, Constant):
                fits = term.value == value
            else:
                name = _name(term)
                fits = extended.setdefault(name, value) == value and value in self.allowed.get(name, {value: None})
            if not fits:
                return None
        return extended

    def join(
        self, reached: ReachedFacts, atoms: tuple[Atom, ...], bindings: dict[str, Value], patience: WorkLimit
    ) -> Iterator[dict[str, Value]]:
        """Yield all bindings for which the atoms are reached; the join starts with the most selective atom.

        Raises:
            WorkLimitError: the limit has passed; each tested fact counts.
        """
        if not atoms:
            yield bindings
            return
        found = [reached.candidates(atom, bindings) for atom in atoms]
        best = min(range(len(atoms)), key=lambda i: len(found[i]))
        for fact in found[best]:
            patience.spend()
            extended = self.unify(atoms[best], fact, bindings)
            if extended is not None:
                yield from self.join(reached, atoms[:best] + atoms[best + 1 :], extended, patience)


def joined_atoms(action: PlanningAction, schema: Vocabulary) -> tuple[Atom, ...]:
    """Return the positive conjuncts of the action's precondition that a join can bind."""
    return tuple(
        atom
        for atom in conjuncts(action.precondition)
        if isinstance(atom, Atom)
        and atom.predicate in schema.predicates
        and all(isinstance(t, Variable | Constant) for t in atom.args)
    )
