"""Explanations of 'no plan': one sentence for each unreachable goal fact, down to its missing facts; mutexes."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from knowledge_base.facts import Fact, Value
from knowledge_base.language.evaluation.explanation import explain
from knowledge_base.language.evaluation.lookups import conjuncts
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.effect import Add, AllOf, Effect, ForEach, When, effect_leaves
from knowledge_base.language.syntax.expression import (
    And,
    Atom,
    Comparison,
    Expression,
    Forall,
    Imply,
    Not,
    Or,
    TypedVariable,
    Variable,
    substitute,
)
from knowledge_base.language.syntax.text import to_text
from knowledge_base.view import View
from planning.analysis.ranges import Ranges, reached_literals
from planning.model.cancellable_work import WorkLimit
from planning.model.domain import PlanningAction, PlanningDomain
from planning.model.plan import PlanStep
from planning.model.problem import Problem
from planning.model.quantities import NumericBound
from planning.problem.conditions import Every, Grounder, Literal, Residual, Some, is_so
from planning.problem.construction import ProblemBuilder, check_goal
from planning.problem.derived import derivation
from planning.problem.grounding import JoinRule, ReachedFacts
from planning.problem.relaxed_reachability import reachable
from planning.problem.task import NOT, Task, as_fact

_LONGEST_CHAIN = 6
MOST_COUNTEREXAMPLES = 100
"""Upper bound of the objects that are listed for one violated `forall` of a goal."""
_TOGETHER = "each goal fact can be reached by itself, but not all of them together"
_NUMBERS = (
    "no plan reaches the goal with the numbers {}; if they changed without limit, each part of it could be reached"
)
_MOST_NUMBERS = 3


def why_unsolvable(
    domain: PlanningDomain, world: World, goal: Expression, patience: WorkLimit | None = None
) -> tuple[str, ...]:
    """Return the proven reasons why a goal is unreachable, see `proven_reasons`; without any, one general sentence."""
    reasons, numbers = _reasons(domain, world, goal, patience or WorkLimit())
    return reasons or (_NUMBERS.format(", ".join(numbers)) if numbers else _TOGETHER,)


def proven_reasons(
    domain: PlanningDomain, world: World, goal: Expression, patience: WorkLimit | None = None
) -> tuple[str, ...]:
    """Return one sentence for each goal fact that no action sequence can reach even without deletions.

    Each sentence follows the nearest actions back to missing facts, and to the limits of numbers. If each goal fact is
    reachable alone, the result consists of the mutexes among the goal facts. It is empty if nothing is proven.
    """
    return _reasons(domain, world, goal, patience or WorkLimit())[0]


def _reasons(
    domain: PlanningDomain, world: World, goal: Expression, patience: WorkLimit
) -> tuple[tuple[str, ...], list[str]]:
    """Return the proven reasons, and some numbers that actions change."""
    check_goal(goal, world)
    derived = derivation(domain)
    domain, world, goal = derived.domain, derived.world(world), derived.expand(goal)
    grounded = ProblemBuilder(domain).grounded(world, goal, patience=patience)
    if grounded.task is None:
        return (f"{explain(goal, world).deciding} and no planning action changes that",), []
    grounder = Grounder(world, grounded.relevant.changing, patience=patience)
    rules = tuple(JoinRule.of(case, grounder) for action in grounded.relevant.actions for case in _cases(action))
    reach = _Reach.of(grounded.task, world)
    known = dict.fromkeys([*_present(rules, world), *sorted(reach.facts, key=str)])
    causes = _Causes(domain, rules, grounder, reach, frozenset(known), ReachedFacts(known))
    alone = tuple(dict.fromkeys(causes.of(grounded.wanted)))
    return alone or _exclusions(domain, world, goal, patience), _changing(grounded.task)


def _exclusions(domain: PlanningDomain, world: World, goal: Expression, patience: WorkLimit) -> tuple[str, ...]:
    """Return a sentence for each pair of goal facts that exclude each other."""
    patience.doing = "looking for goal facts that exclude each other"
    problem = ProblemBuilder(domain).build_problem(world, goal, patience=patience)
    pairs = mutexes(problem, patience)
    told = [(one, other) for one, other in pairs if _is_declared(one) and _is_declared(other)]
    return tuple(f"{_as_written(one)} and {_as_written(other)} can never hold together" for one, other in told)


def _changing(task: Task) -> list[str]:
    """Return the first numbers that are compared and that actions change, as text."""
    changed = {change.fluent for way in task.ways.all for change in way.assignments}
    read = dict.fromkeys(one for bound in task.numbering.bounds.values() for one in bound.fluents() if one in changed)
    return [*map(str, itertools.islice(read, _MOST_NUMBERS)), *["…"] * (len(read) > _MOST_NUMBERS)]


def _is_declared(fact: Fact) -> bool:
    """Return whether the domain declares the fact; the predicate of a bookkeeping fact contains a blank."""
    return " " not in fact.predicate.removeprefix(NOT)


def _as_written(fact: Fact) -> str:
    denied = fact.predicate.startswith(NOT)
    return f"(not {replace(fact, predicate=fact.predicate.removeprefix(NOT))})" if denied else str(fact)


@dataclass(frozen=True, slots=True)
class _Reach:
    """The facts and the ranges of numbers that relaxed reachability allows.

    Attributes:
        facts: the reachable facts, in positive normal form.
        ranges: the ranges of the numbers.
        world: the present world.
    """

    facts: frozenset[Fact]
    ranges: Ranges
    world: World

    @staticmethod
    def of(task: Task, world: World) -> _Reach:
        ranges, numbering = Ranges(world), task.numbering
        if any(way.assignments for way in task.ways.all):
            literals = reached_literals(task, ranges)
        else:
            literals = reachable(task).facts.keys() - numbering.fluents - numbering.bounds.keys()
        return _Reach(frozenset([numbering.facts[one] for one in literals]), ranges, world)

    def allows(self, condition: Residual) -> bool:
        """Return whether each leaf of the condition is true or may become true independently of the other leaves."""
        match condition:
            case bool():
                return condition
            case Literal(fact, positive):
                present = is_so(fact, self.world) is positive
                return present or as_fact(condition) in self.facts
            case NumericBound():
                return self.ranges.allow(condition)
            case Every(parts):
                return all(map(self.allows, parts))
            case Some(parts):
                return any(map(self.allows, parts))


@dataclass(frozen=True, slots=True)
class _Nearest:
    """A step that adds a fact, with its missing facts and conditions.

    `inner` has the missing facts in the conditions. `fixed` is the number of missing facts and conditions that no
    action can change.
    """

    step: PlanStep
    facts: tuple[Fact, ...]
    conditions: tuple[str, ...]
    inner: tuple[Fact, ...]
    fixed: int


@dataclass(frozen=True, slots=True)
class _Causes:
    domain: PlanningDomain
    rules: tuple[JoinRule, ...]
    grounder: Grounder
    reach: _Reach
    reached: frozenset[Fact]
    index: ReachedFacts

    def of(self, wanted: Residual) -> Iterator[str]:
        """Yield a sentence for each unreachable literal or bound of the condition."""
        match wanted:
            case Literal():
                if as_fact(wanted) not in self.reached:
                    yield self.chain(wanted.fact) if wanted.positive else _stays(wanted.fact)
            case NumericBound():
                if not self.reach.allows(wanted):
                    yield f"{wanted} cannot hold: {self.reach.ranges.limits(wanted)}"
            case Every(parts):
                for part in parts:
                    yield from self.of(part)
            case Some(parts):
                causes = [tuple(self.of(part)) for part in parts]
                if all(causes):
                    yield from itertools.chain.from_iterable(causes)
            case bool():
                pass

    def chain(self, fact: Fact) -> str:
        """Return a sentence that leads from the fact through the nearest actions to unreachable facts."""
        said: list[str] = []
        agenda, seen, rooted = [fact], {fact}, False
        while agenda and len(said) < _LONGEST_CHAIN:
            here = agenda.pop(0)
            nearest = self.nearest(here)
            if nearest is None:
                rooted = True
                said.append(f"{here} does not hold, and no planning action makes it true")
                continue
            missing = (*nearest.facts, *nearest.inner)
            rooted |= not missing or bool(nearest.conditions and not nearest.inner)
            said.append(f"{here} needs {nearest.step}, which needs {_nearest_text(nearest)}")
            fresh = [one for one in dict.fromkeys(missing) if one not in seen]
            seen.update(fresh)
            agenda.extend(fresh)
        return "; ".join(said if rooted or agenda else [*said, "none of these can come first"])

    def nearest(self, fact: Fact) -> _Nearest | None:
        """Return the action that adds the fact with the fewest missing facts; among equals, the first of the domain."""
        found = [near for rule in self.rules for near in self.ways(rule, fact)]
        return min(found, key=_distance, default=None)

    def ways(self, rule: JoinRule, fact: Fact) -> Iterator[_Nearest]:
        """Yield, for each effect that can add the fact, the arguments of the action with the fewest missing facts."""
        for leaf in effect_leaves(rule.action.effect):
            if isinstance(leaf, Add) and leaf.atom.predicate == fact.predicate:
                start = rule.unify(leaf.atom, fact, {})
                closest = None if start is None else self.closest(rule, start)
                if closest is not None:
                    yield closest

    def closest(self, rule: JoinRule, start: dict[str, Value]) -> _Nearest | None:
        """Return the step with the fewest dropped positive preconditions so that the other ones have arguments."""
        for abandoned in range(len(rule.atoms) + 1):
            found = [
                self.lacking(rule, full)
                for kept in itertools.combinations(rule.atoms, len(rule.atoms) - abandoned)
                for bindings in itertools.islice(rule.join(self.index, kept, start, self.grounder.patience), 1)
                if (full := self.completed(rule, bindings)) is not None
            ]
            if found:
                return min(found, key=_distance)
        return None

    def completed(self, rule: JoinRule, bindings: dict[str, Value]) -> dict[str, Value] | None:
        """Return the bindings with each unbound parameter bound to the first object of its type; `None` without one."""
        first = {name: next(iter(objects), None) for name, objects in rule.allowed.items()}
        full = {name: bindings.get(name, value) for name, value in first.items()}
        return {k: v for k, v in full.items() if v is not None} if None not in full.values() else None

    def lacking(self, rule: JoinRule, bindings: dict[str, Value]) -> _Nearest:
        parameters = self.domain.actions[rule.action.name].parameters
        step = PlanStep(rule.action.name, tuple(str(bindings[p.name]) for p in parameters))
        needed = [self.grounder.fact(atom, bindings) for atom in rule.atoms]
        others = conjuncts(rule.action.precondition)
        residuals = {c: self.grounder.residual(c, bindings) for c in others if c not in rule.atoms}
        unmet = [c for c, residual in residuals.items() if not self.reach.allows(residual)]
        inner = dict.fromkeys(fact for c in unmet for fact in self.unreached(residuals[c]))
        missing = tuple(fact for fact in needed if fact not in self.reached)
        fixed = len(unmet) + sum(fact.predicate not in self.grounder.changing for fact in missing)
        conditions = tuple(self.with_limits(c, residuals[c], bindings) for c in unmet)
        return _Nearest(step, missing, conditions, tuple(inner), fixed)

    def with_limits(self, condition: Expression, residual: Residual, bindings: Mapping[str, Value]) -> str:
        """Return an unreachable condition as text, a comparison with the limits of its numbers."""
        if isinstance(residual, NumericBound):
            return f"{residual}, but {self.reach.ranges.limits(residual)}"
        text = to_text(substitute(condition, bindings))
        compared = explain(condition, self.reach.world, bindings).detail if isinstance(condition, Comparison) else None
        return f"{text}, here {compared}" if compared else text

    def unreached(self, condition: Residual) -> Iterator[Fact]:
        """Yield the positive facts in a condition that no action sequence reaches."""
        match condition:
            case Literal(fact, positive):
                if positive and fact not in self.reached:
                    yield fact
            case Every(parts) | Some(parts):
                for part in parts:
                    yield from self.unreached(part)
            case NumericBound() | bool():
                pass


def _cases(action: PlanningAction) -> Iterator[PlanningAction]:
    """Yield an action for each effect; variables and conditions of the effect become parameters and precondition."""
    for leaf, variables, conditions in _effects(action.effect):
        needed = (*conjuncts(action.precondition), *(part for one in conditions for part in conjuncts(one)))
        yield replace(action, parameters=(*action.parameters, *variables), precondition=And(needed), effect=leaf)


def _effects(
    effect: Effect, variables: tuple[TypedVariable, ...] = (), conditions: tuple[Expression, ...] = ()
) -> Iterator[tuple[Effect, tuple[TypedVariable, ...], tuple[Expression, ...]]]:
    """Yield the leaves of an effect, each with the variables and conditions that enclose it."""
    match effect:
        case AllOf(parts):
            for part in parts:
                yield from _effects(part, variables, conditions)
        case ForEach(more, body):
            yield from _effects(body, (*variables, *more), conditions)
        case When(condition, body):
            yield from _effects(body, variables, (*conditions, condition))
        case _:
            yield effect, variables, conditions


def _present(rules: Iterable[JoinRule], world: World) -> Iterator[Fact]:
    """Yield the facts that hold in `world`, of all predicates in the preconditions of the actions."""
    for predicate in dict.fromkeys(atom.predicate for rule in rules for atom in rule.atoms):
        arity = len(world.schema.predicates[predicate].parameters)
        for args in world.match(predicate, (None,) * arity):
            yield Fact(predicate, tuple(args))


def _distance(near: _Nearest) -> tuple[int, int]:
    return len(near.facts) + len(near.conditions), near.fixed


def _nearest_text(nearest: _Nearest) -> str:
    return " and ".join([*map(str, nearest.facts), *nearest.conditions]) or "more than can hold together"


def _stays(fact: Fact) -> str:
    return f"{fact} holds, and no planning action makes it false"


@dataclass(frozen=True, slots=True)
class _NumberedAction:
    """A ground action with facts as numbers; each set of facts is an integer with one bit per fact."""

    needs: tuple[int, ...]
    needed: int
    adds: tuple[int, ...]
    added: int
    kept: int


def mutexes(problem: Problem, patience: WorkLimit) -> list[tuple[Fact, Fact]]:
    """Return the pairs of goal facts that never hold together; with one action at a time, none is known."""
    return [] if problem.one_at_a_time else list(goal_mutexes(problem.whole or problem, patience))


def goal_mutexes(problem: Problem, patience: WorkLimit) -> Iterator[tuple[Fact, Fact]]:
    """Yield the pairs of goal facts that never hold together, though each fact may hold alone.

    Raises:
        WorkLimitError: the search exceeds `patience`.
    """
    number = {fact: i for i, fact in enumerate(dict.fromkeys([*problem.init, *problem.goal, *_mentions(problem)]))}
    actions = []
    for action in problem.actions:
        adds, deletes = ([number[fact] for fact in facts] for facts in (action.adds, action.deletes))
        needs = tuple(number[fact] for fact in action.precondition)
        actions.append(_NumberedAction(needs, _bits(needs), tuple(adds), _bits(adds), ~(_bits(adds) | _bits(deletes))))
    together = _reach_pairs(actions, [number[fact] for fact in problem.init], len(number), patience)
    for one, other in itertools.combinations(problem.goal, 2):
        if not together[number[one]] >> number[other] & 1:
            yield one, other


def _mentions(problem: Problem) -> Iterator[Fact]:
    for action in problem.actions:
        yield from action.facts()


def _bits(numbers: Iterable[int]) -> int:
    found = 0
    for number in numbers:
        found |= 1 << number
    return found


def _reach_pairs(actions: list[_NumberedAction], init: list[int], size: int, patience: WorkLimit) -> list[int]:
    """Return, for each fact, the facts that can hold together with it, as bits; a reachable fact includes itself."""
    possible = _bits(init)
    together = [possible if possible >> i & 1 else 0 for i in range(size)]
    before: list[int] = []
    while before != together:
        before = together.copy()
        for action in actions:
            patience.spend()
            if any(action.needed & ~together[need] for need in action.needs):
                continue
            beside = action.kept & possible
            for need in action.needs:
                beside &= together[need]
            for one in action.adds:
                fresh = (beside | action.added) & ~together[one]
                together[one] |= fresh
                _mirror(one, fresh, together)
            possible |= action.added
    return together


def _mirror(one: int, fresh: int, together: list[int]) -> None:
    while fresh:
        lowest = fresh & -fresh
        together[lowest.bit_length() - 1] |= 1 << one
        fresh ^= lowest


def unmet(goal: Expression, knowledge: View) -> Iterator[str]:
    """Yield each false part of a goal as text; for a `forall`, the part for each object that violates it."""
    for part in goal.parts if isinstance(goal, And) else (goal,):
        if knowledge.ask(part):
            continue
        if isinstance(part, And):
            yield from unmet(part, knowledge)
        elif isinstance(part, Forall):
            yield from _counterexamples(part, knowledge)
        else:
            yield to_text(part)


def _counterexamples(goal: Forall, knowledge: View) -> Iterator[str]:
    kinds = [
        Or(tuple(Atom(kind, (Variable(one.name),)) for kind in one.types or ("object",))) for one in goal.variables
    ]
    wanted = goal.body.conclusion if isinstance(goal.body, Imply) else goal.body
    for found in knowledge.query(And((*kinds, Not(goal.body))), limit=MOST_COUNTEREXAMPLES):
        yield to_text(substitute(wanted, found))
