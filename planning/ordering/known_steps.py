"""Needs and changes of a plan step that do not depend on the world; cached, since successive plans share steps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from knowledge_base.facts import Fact
from knowledge_base.language.checking.vocabulary import Vocabulary
from knowledge_base.language.evaluation.lookups import conjuncts
from knowledge_base.language.syntax.effect import Add, AllOf, Delete, NumericEffect, effect_leaves, effect_parts
from knowledge_base.language.syntax.expression import Atom, Constant, Expression, Not, Variable
from knowledge_base.owner_cache import cache_on_owner
from planning.model.domain import GroundStep, PlanningAction
from planning.model.plan import PlanStep
from planning.problem.conditions import Literal


@dataclass(frozen=True, slots=True)
class KnownStep:
    """The needs and changes of a step that do not depend on the world.

    Attributes:
        needs: the conditions; each with its literal if the condition is a literal.
        makes: the literals that the step makes true; `None` if they depend on the world.
        changes: the truth values of the changed facts after the step.
        plain: whether all needs are literals and no change depends on the world.
    """

    needs: tuple[tuple[Expression, Literal | None], ...]
    makes: tuple[Literal, ...] | None
    changes: dict[Fact, bool]
    plain: bool

    @staticmethod
    @cache_on_owner
    def of(ground: GroundStep, step: PlanStep, action: PlanningAction, schema: Vocabulary) -> KnownStep:
        """Return the needs and changes; kept on the ground step, since successive plans share most steps."""
        needs = tuple([(part, literal_of(part, schema)) for part in dict.fromkeys(conjuncts(ground.condition))])
        pattern = _Pattern.of(action, schema)
        if pattern.changes is None:
            return KnownStep(needs, None, {}, plain=False)
        args = dict(zip([p.name for p in action.parameters], step.args, strict=True))
        made = {False: dict[Fact, bool](), True: dict[Fact, bool]()}
        for predicate, names, adds in pattern.changes:
            made[adds][Fact(predicate, tuple([args[name] for name in names]))] = adds
        makes = tuple([Literal(fact, positive) for positive, facts in made.items() for fact in facts])
        plain = None not in [literal for _, literal in needs]
        return KnownStep(needs, makes, {**made[False], **made[True]}, plain)


@dataclass(frozen=True, slots=True)
class _Pattern:
    """The changes of an action as predicate, parameters and truth value; `None` if they depend on the world."""

    changes: tuple[tuple[str, tuple[str, ...], bool], ...] | None

    @staticmethod
    @cache_on_owner
    def of(action: PlanningAction, schema: Vocabulary) -> _Pattern:
        """Return the pattern; its changes are `None` unless the action only adds and deletes facts unconditionally."""
        types = {parameter.name: parameter.types for parameter in action.parameters}
        changes = []
        for part in effect_parts(action.effect) if action.timed is None else ():
            if isinstance(part, AllOf):
                continue
            if not isinstance(part, Add | Delete) or not _may_be_asserted(part.atom, types, schema):
                return _Pattern(None)
            names = tuple([term.name for term in part.atom.args if isinstance(term, Variable)])
            changes.append((part.atom.predicate, names, isinstance(part, Add)))
        return _Pattern(tuple(changes) if action.timed is None else None)


def changed_names(action: PlanningAction) -> Iterator[str]:
    """Yield the names of the predicates and functions that an action may change."""
    timed = action.timed
    effects = [action.effect] + ([] if timed is None else [timed.start_effect, timed.end_effect])
    for effect in effects:
        for leaf in effect_leaves(effect):
            yield leaf.call.function if isinstance(leaf, NumericEffect) else leaf.atom.predicate


def literal_of(e: Expression, schema: Vocabulary) -> Literal | None:
    """Return the condition as a literal; `None` if the condition is not a literal."""
    atom = e.body if isinstance(e, Not) else e
    if not isinstance(atom, Atom) or atom.predicate not in schema.predicates:
        return None
    values = tuple([term.value for term in atom.args if isinstance(term, Constant)])
    return Literal(Fact(atom.predicate, values), atom is e) if len(values) == len(atom.args) else None


def _may_be_asserted(atom: Atom, types: dict[str, tuple[str, ...]], schema: Vocabulary) -> bool:
    signature = schema.predicates.get(atom.predicate)
    if signature is None or atom.predicate in schema.functional or len(atom.args) != len(signature.parameters):
        return False
    for term, parameter in zip(atom.args, signature.parameters, strict=True):
        if not isinstance(term, Variable) or term.name not in types:
            return False
        if not schema.fitting(types[term.name]) <= schema.fitting(parameter.types):
            return False
    return True
