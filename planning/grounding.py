"""From planning actions with parameters to the ground actions that can ever be taken.

Relaxed reachability by a worklist (semi-naive, as in Helmert 2009, *Concise finite-domain
representations*): a fact that was newly reached is joined with those reached before, so that only argument
tuples are met whose positive preconditions can all become true.
"""

from __future__ import annotations

import itertools
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from knowledge_base.facts import Fact, Value
from knowledge_base.language.expression import And, Atom, Constant, Expression, Variable
from planning.conditions import ConditionalFact, Grounder, Literal, Residual, alternatives, every, negation
from planning.errors import UnsupportedActionError
from planning.plan import PlanStep

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from planning.domain import PlanningAction

_MOST_CONDITIONS = 6  # of one ground action; each doubles the number of ways to take it
_MOST_ALTERNATIVES = 64


@dataclass(frozen=True, slots=True)
class Variant:
    """One way to take a step: a conjunction of literals and unconditional effects."""

    step: PlanStep | None
    condition: tuple[Literal, ...]
    adds: tuple[Fact, ...]
    deletes: tuple[Fact, ...] = ()


def ground(actions: Sequence[PlanningAction], grounder: Grounder) -> list[Variant]:
    """Every way to take every step that is reachable when deletions and negative conditions are ignored.

    Raises:
        UnsupportedActionError: an action has too many conditional effects or alternatives.
    """
    return list(_Reachability(actions, grounder).variants())


def variants(action: PlanningAction, bindings: Mapping[str, Value], grounder: Grounder) -> Iterator[Variant]:
    """The ways to take one step: one for each alternative of its precondition and conditional effects."""
    precondition = grounder.residual(action.precondition, bindings)
    if precondition is False:
        return
    step = PlanStep(action.name, tuple(str(bindings[p.name]) for p in action.parameters))
    effects = list(grounder.effects(action.effect, bindings))
    conditions = list(dict.fromkeys(e.condition for e in effects if e.condition is not True))
    if len(conditions) > _MOST_CONDITIONS:
        raise UnsupportedActionError(
            f"planning action '{action.name}' has {len(conditions)} conditional effects for {step};"
            f" at most {_MOST_CONDITIONS} can be planned with",
            place=action.place,
        )
    for taken in itertools.product((True, False), repeat=len(conditions)):
        chosen = [c if yes else negation(c) for c, yes in zip(conditions, taken, strict=True)]
        happening = {True, *(c for c, yes in zip(conditions, taken, strict=True) if yes)}
        for condition in _bounded(every([precondition, *chosen]), action):
            yield _variant(step, condition, [e for e in effects if e.condition in happening])


def _bounded(condition: Residual, action: PlanningAction) -> list[tuple[Literal, ...]]:
    found = list(itertools.islice(alternatives(condition), _MOST_ALTERNATIVES + 1))
    if len(found) > _MOST_ALTERNATIVES:
        raise UnsupportedActionError(
            f"the precondition of planning action '{action.name}' has over {_MOST_ALTERNATIVES} alternatives"
            " ('or', 'imply' or 'exists' over what actions change)",
            place=action.place,
        )
    return found


def _variant(step: PlanStep, condition: tuple[Literal, ...], effects: Iterable[ConditionalFact]) -> Variant:
    adds: dict[Fact, None] = {}
    deletes: dict[Fact, None] = {}
    for effect in effects:
        (adds if effect.added else deletes)[effect.fact] = None
    kept = tuple(d for d in deletes if d not in adds)  # PDDL: a fact both deleted and added is true
    return Variant(step, condition, tuple(adds), kept)


class Reached:
    """Facts by predicate and by predicate, position and value."""

    def __init__(self, facts: Iterable[Fact] = ()) -> None:
        self._index: dict[tuple[Value, ...], list[Fact]] = {}
        for fact in facts:
            self.add(fact)

    def add(self, fact: Fact) -> None:
        """Also this one, which was not there before."""
        for key in ((fact.predicate,), *((fact.predicate, i, v) for i, v in enumerate(fact.args))):
            self._index.setdefault(key, []).append(fact)

    def candidates(self, atom: Atom, bindings: Mapping[str, Value]) -> Sequence[Fact]:
        """A short list that contains every fact which fits `atom`."""
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
class Rule:
    """An action as a join.

    Attributes:
        action: the planning action.
        atoms: the positive conjuncts of its precondition.
        allowed: what each parameter may stand for.
    """

    action: PlanningAction
    atoms: tuple[Atom, ...]
    allowed: Mapping[str, Mapping[str, None]]

    @staticmethod
    def of(action: PlanningAction, grounder: Grounder) -> Rule:
        """The rule for an action."""
        predicates = grounder.world.schema.predicates
        atoms = tuple(
            atom
            for atom in _conjuncts(action.precondition)
            if atom.predicate in predicates and all(isinstance(t, Variable | Constant) for t in atom.args)
        )
        return Rule(action, atoms, {p.name: grounder.objects(p) for p in action.parameters})

    def unify(self, atom: Atom, fact: Fact, bindings: Mapping[str, Value]) -> dict[str, Value] | None:
        """The bindings extended so that the atom is the fact, if that is possible."""
        extended = dict(bindings)
        for term, value in zip(atom.args, fact.args, strict=True):
            if isinstance(term, Constant):
                fits = term.value == value
            else:
                name = _name(term)
                fits = extended.setdefault(name, value) == value and value in self.allowed.get(
                    name, {value: None}
                )
            if not fits:
                return None
        return extended

    def join(
        self, reached: Reached, atoms: tuple[Atom, ...], bindings: dict[str, Value]
    ) -> Iterator[dict[str, Value]]:
        """All bindings under which the atoms are reached; the most selective atom first."""
        if not atoms:
            yield bindings
            return
        found = [reached.candidates(atom, bindings) for atom in atoms]
        best = min(range(len(atoms)), key=lambda i: len(found[i]))
        for fact in found[best]:
            extended = self.unify(atoms[best], fact, bindings)
            if extended is not None:
                yield from self.join(reached, atoms[:best] + atoms[best + 1 :], extended)


class _Reachability:
    def __init__(self, actions: Sequence[PlanningAction], grounder: Grounder) -> None:
        self._grounder = grounder
        self._reached = Reached()
        self._queue: deque[Fact] = deque()
        self._met: set[Fact] = set()
        self._done: set[PlanStep] = set()
        self._rules = [Rule.of(action, grounder) for action in actions]
        self._triggers: dict[str, list[tuple[Rule, int]]] = {}
        for rule in self._rules:
            for position, atom in enumerate(rule.atoms):
                self._triggers.setdefault(atom.predicate, []).append((rule, position))

    def variants(self) -> Iterator[Variant]:
        for predicate in self._triggers:
            arity = len(self._grounder.world.schema.predicates[predicate].parameters)
            for args in self._grounder.world.match(predicate, (None,) * arity):
                self._meet(Fact(predicate, args))
        for rule in self._rules:
            if not rule.atoms:
                yield from self._take(rule, {})
        while self._queue:
            fact = self._queue.popleft()
            self._reached.add(fact)
            for rule, position in self._triggers.get(fact.predicate, ()):
                start = rule.unify(rule.atoms[position], fact, {})
                rest = rule.atoms[:position] + rule.atoms[position + 1 :]
                for bindings in rule.join(self._reached, rest, start) if start is not None else ():
                    yield from self._take(rule, bindings)

    def _meet(self, fact: Fact) -> None:
        if fact not in self._met:
            self._met.add(fact)
            self._queue.append(fact)

    def _take(self, rule: Rule, bindings: dict[str, Value]) -> Iterator[Variant]:
        open_parameters = [p for p in rule.action.parameters if p.name not in bindings]
        for full in self._grounder.choices(open_parameters, bindings):
            step = PlanStep(rule.action.name, tuple(str(full[p.name]) for p in rule.action.parameters))
            if step not in self._done:
                self._done.add(step)
                for variant in variants(rule.action, full, self._grounder):
                    for fact in variant.adds:
                        self._meet(fact)
                    yield variant


def _conjuncts(e: Expression) -> Iterator[Atom]:
    if isinstance(e, And):
        for part in e.parts:
            yield from _conjuncts(part)
    elif isinstance(e, Atom):
        yield e
