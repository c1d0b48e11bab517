"""Ground operators of a domain with their costs, found by relaxed reachability and kept for the next problem."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from knowledge_base.facts import Content, Fact, Value
from knowledge_base.language.checking.vocabulary import ROOT_TYPE, Vocabulary
from knowledge_base.language.evaluation.world_protocol import World, WorldDefaults
from knowledge_base.language.syntax.effect import ForEach, effect_conditions, effect_parts
from knowledge_base.language.syntax.expression import (
    Arithmetic,
    Call,
    Exists,
    Expression,
    Forall,
    Term,
    Variable,
    parts_of,
)
from knowledge_base.language.syntax.rewriting import names_of
from knowledge_base.language.syntax.text import to_text
from knowledge_base.pddl.problem_text import TOTAL_TIME, Metric
from planning.model.cancellable_work import WorkLimit
from planning.model.domain import PlanningAction
from planning.model.plan import PlanStep
from planning.model.quantities import Assignment, linear
from planning.problem.conditions import Grounder
from planning.problem.grounding import JoinRule, ReachedFacts, ground_operators, joined_atoms
from planning.problem.relevance import Relevant
from planning.problem.task import GroundOperator, Numbering, OperatorIndex


class Consulted(WorldDefaults):
    """A world that records its answers, so that another world can be compared with them.

    It contains the objects of all worlds so far.
    """

    def __init__(self, world: World, things: Mapping[str, str]) -> None:
        self._world = world
        self._truths: dict[Fact, bool] = {}
        self._contents: dict[Fact, Content] = {}
        self.things = dict(things)

    def agrees(self, world: World, things: Mapping[str, str]) -> bool:
        """Return whether `world`, with these objects and types, has equal values for all recorded queries."""
        return (
            {**things, **self.things} == {**self.things, **things}  # no object has changed its type
            and all(world.holds(f.predicate, f.args) is truth for f, truth in self._truths.items())
            and all(world.value(f.predicate, f.args) == number for f, number in self._contents.items())
        )

    def follow(self, world: World, things: Mapping[str, str]) -> bool:
        """Use `world` for later queries; return whether it contains new objects."""
        before, self._world = len(self.things), world
        self.things.update(things)
        return len(self.things) > before

    @property
    def schema(self) -> Vocabulary:
        """The vocabulary of the current world."""
        return self._world.schema

    def holds(self, predicate: str, args: tuple[Value, ...]) -> bool:
        """Return whether the fact is true, and record the result."""
        truth = self._truths[Fact(predicate, args)] = self._world.holds(predicate, args)
        return truth

    def value(self, function: str, args: tuple[Value, ...]) -> Content:
        """Return the value of the function, and record the result."""
        content = self._contents[Fact(function, args)] = self._world.value(function, args)
        return content

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> Iterable[tuple[Value, ...]]:
        """Return the facts that match the pattern; not recorded, since grounding tests each fact separately."""
        return self._world.match(predicate, pattern)

    def objects(self, type_name: str) -> Iterable[str]:
        """Return the objects of the type."""
        return [name for name, own in self.things.items() if self.schema.is_a(own, type_name)]

    def type_of(self, name: str) -> str | None:
        """Return the type of the object; `None` if the object is missing."""
        return self.things.get(name)


class OperatorCache:
    """The ground operators over all facts that were reached so far.

    Attributes:
        numbering: the numbers of the operators' literals, bounds and fluents.
        ways: the ground operators for all worlds so far, in an order that does not depend on the worlds.

    Args:
        relevant: the relevant part of the domain.
        metric: the term to minimize; `None` without a metric.
        world: the first world for which the operators are valid.
        things: the type of each object in that world.
    """

    def __init__(self, relevant: Relevant, metric: Term | None, world: World, things: Mapping[str, str]) -> None:
        self.numbering = Numbering()
        self._world = Consulted(world, things)
        self._grounder = Grounder(self._world, relevant.changing)
        self._actions = relevant.actions
        self._over_all = any(_ranges_over_all(action, world.schema) for action in relevant.actions)
        self._order = {action.name: i for i, action in enumerate(relevant.actions)}
        self._costs = Costs.of(metric, self._grounder)
        self._rules: list[JoinRule] = []
        self._reached = ReachedFacts()
        self._met: dict[str, set[tuple[Value, ...]]] = {}  # arguments by predicate
        self._queue: deque[Fact] = deque()
        self._done: set[PlanStep] = set()
        self.ways = OperatorIndex([])
        self._found_so_far = 0

    def serves(self, world: World, things: Mapping[str, str]) -> bool:
        """Return whether the cached operators are valid for this world too."""
        same = not self._over_all or list(things) == list(self._world.things)
        return same and self._world.agrees(world, things)

    def extend(self, world: World, things: Mapping[str, str], patience: WorkLimit) -> None:
        """Add the operators that become possible in this world.

        Args:
            world: the next world for which the operators must be valid.
            things: the type of each object in that world.
            patience: the limit of the work; after an error the caller must discard the cache.

        Raises:
            UnsupportedActionError: see `planning.problem.grounding.ground_operators`.
            WorkLimitError: the limit has passed.
        """
        self._grounder = replace(self._grounder, patience=patience)
        found = list(self._find_operators(world, more=self._world.follow(world, things)))
        if found:
            self.ways = OperatorIndex(sorted([*self.ways.all, *found], key=self._key))

    def _find_operators(self, world: World, *, more: bool) -> Iterator[GroundOperator]:
        first = not self._rules
        if first or more:
            self._rules = [JoinRule.of(action, self._grounder) for action in self._actions]
        for rule in self._rules if first else ():
            if not rule.atoms:
                yield from self._take(rule, {})
        triggers: dict[str, list[tuple[JoinRule, int]]] = {}
        for rule in self._rules:
            for position, atom in enumerate(rule.atoms):
                triggers.setdefault(atom.predicate, []).append((rule, position))
        for predicate in triggers:
            arity = len(world.schema.predicates[predicate].parameters)
            self._meet(predicate, world.match(predicate, (None,) * arity))
        while self._queue:
            fact = self._queue.popleft()
            self._reached.add(fact)
            for rule, position in triggers.get(fact.predicate, ()):
                self._grounder.patience.doing = f"grounding action '{rule.action.name}'"
                start = rule.unify(rule.atoms[position], fact, {})
                if start is None:
                    continue
                rest = rule.atoms[:position] + rule.atoms[position + 1 :]
                for bindings in rule.join(self._reached, rest, start, self._grounder.patience):
                    yield from self._take(rule, bindings)

    def _meet(self, predicate: str, facts: Iterable[tuple[Value, ...]]) -> None:
        """Add the new facts of a predicate to the queue."""
        met = self._met.setdefault(predicate, set())
        for args in facts:
            if args not in met:
                met.add(args)
                self._queue.append(Fact(predicate, args))

    def _take(self, rule: JoinRule, bindings: dict[str, Value]) -> Iterator[GroundOperator]:
        self._grounder.patience.doing = f"grounding action '{rule.action.name}'"
        open_parameters = [p for p in rule.action.parameters if p.name not in bindings]
        for full in self._grounder.choices(open_parameters, bindings):
            step = PlanStep(rule.action.name, tuple([str(full[p.name]) for p in rule.action.parameters]))
            if step not in self._done:
                self._done.add(step)
                for way in ground_operators(rule.action, full, self._grounder, self.numbering):
                    for fact in self.numbering.true_facts(way.adds):
                        self._meet(fact.predicate, [fact.args])
                    cost = 1.0 if self._costs is None else self._costs.cost(way.assignments)
                    self._found_so_far += 1
                    yield way._replace(cost=cost, number=self._found_so_far)

    def _key(self, way: GroundOperator) -> tuple[int, tuple[str, ...]]:
        """Return a sort key that does not depend on the world; the operators of a step have equal keys."""
        return (self._order[way.step.action], way.step.args) if way.step else (len(self._order), ())


def things_of(world: World) -> dict[str, str]:
    """Return the type of each object of the world, by the object's name."""
    return {name: world.type_of(name) or ROOT_TYPE for name in world.objects(ROOT_TYPE)}


def _ranges_over_all(action: PlanningAction, schema: Vocabulary) -> bool:
    """Return whether the operators depend on all objects of a type, and not only on objects in facts."""
    bound = {term.name for atom in joined_atoms(action, schema) for term in atom.args if isinstance(term, Variable)}
    return (
        any(parameter.name not in bound for parameter in action.parameters)
        or any(map(_has_quantifier, (action.precondition, *effect_conditions(action.effect))))
        or any(isinstance(part, ForEach) for part in effect_parts(action.effect))
    )


def _has_quantifier(e: Expression | Term) -> bool:
    return isinstance(e, Exists | Forall) or any(map(_has_quantifier, parts_of(e)))


TOTAL_COST = Call("total-cost")
"""The PDDL function for the sum of action costs; the default metric of a domain that declares this function."""


def metric_of(metric: Metric | None, schema: Vocabulary) -> Term | None:
    """Return the term to minimize; by default `(total-cost)` if the schema declares that function, otherwise `None`."""
    if metric is not None:
        return metric.term if metric.direction == "minimize" else Arithmetic("-", (metric.term,))
    declared = schema.functions.get(TOTAL_COST.function)
    return TOTAL_COST if declared is not None and declared.arity == 0 else None


def ignored(metric: Term) -> str:
    """Return the note for a metric that is not an action cost."""
    if TOTAL_TIME.function in names_of(metric):
        return f"the metric {to_text(metric)} is ignored: one action at a time is planned for without regard to time"
    return f"the metric {to_text(metric)} is ignored: it is no sum of numbers that actions raise by fixed amounts"


@dataclass(frozen=True, slots=True)
class Costs:
    """The action costs that follow from a metric.

    Attributes:
        coefficients: the factor of each numeric fluent in the metric; `None` if the metric is not a linear sum.
    """

    coefficients: Mapping[Fact, float] | None

    @staticmethod
    def of(metric: Term | None, grounder: Grounder) -> Costs | None:
        """Return the costs for a metric; `None` without a metric."""
        if metric is None:
            return None
        declared = grounder.world.schema.functions
        known = all(name in declared for name in names_of(metric))  # PDDL allows `total-time` without a declaration
        return Costs(linear(grounder.quantity(metric, {})) if known else None)

    def cost(self, assignments: Iterable[Assignment]) -> float | None:
        """Return the cost of an action with these effects; `None` if its change of the metric is not a cost."""
        if self.coefficients is None:
            return None
        total = 0.0
        for one in assignments:
            coefficient = self.coefficients.get(one.fluent, 0.0)
            if coefficient and not (one.increase and isinstance(one.amount, int | float)):
                return None
            if coefficient and isinstance(one.amount, int | float):
                total += coefficient * one.amount
        return total if total >= 0 else None
