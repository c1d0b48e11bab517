"""Causal tracing: the step that establishes each condition of a plan, and the de-ordering of the steps (S1.5).

*De-ordering* keeps only those ordered pairs of the plan for which there is a reason (Bäckström 1998, *Computational
aspects of reordering plans*). The reasons are:

- Link: a step needs a condition that an earlier step establishes.
- Threat: a later step falsifies a condition that an earlier step needs.
- Conflict: one step makes a fact true and the other makes it false, or both change a number and do not commute.

Every linearization of the result therefore leads to the same final state. A fact that a step both deletes and adds is
false for a short time during the step, so two such steps never overlap.

Sets of steps are integers with one bit per step, and each fact has one record. The cost of tracing a step therefore
depends only on the facts of that step. The needs and changes of most steps are plain facts in every world, and are
cached for each step. The needs and changes of other steps are evaluated in the simulated world.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from knowledge_base.errors import InputError
from knowledge_base.facts import Delta, Fact
from knowledge_base.language.evaluation.evaluator import apply_effect, holds
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.effect import Effect, substitute_effect
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.language.syntax.text import to_text
from knowledge_base.world.overlay import Overlay
from planning.model.domain import PlanningAction, PlanningDomain
from planning.model.plan import Plan, PlanStep
from planning.ordering.known_steps import KnownStep, changed_names, literal_of
from planning.ordering.partial_order import PRESENT, CausalLink, PartialOrder, reduction
from planning.ordering.step_dependencies import (
    Changes,
    Ground,
    Names,
    Support,
    Unlisted,
    changes,
    favours,
    ground_conjuncts,
    support,
)
from planning.problem.conditions import Literal
from planning.problem.derived import derivation


def deordered(plan: Plan, domain: PlanningDomain, world: World, goal: Expression) -> PartialOrder:
    """Return the plan's steps in the order that has a reason for each pair, with causal links in the order of users.

    Every linearization leads from `world` to the goal as long as all links hold. The result is not always the least
    such order, which is NP-hard to find.

    Raises:
        InputError: the plan does not lead to the goal; `planning.validate` returns the failing step.
    """
    derived = derivation(domain)
    changing = None if derived.recursive else _changing(plan, derived.domain)
    tracing = CausalTrace(derived.world(world), changing)
    for number, step in enumerate(plan.steps, start=1):
        tracing.take(number, step, derived.domain)
    tracing.reach(len(plan.steps) + 1, derived.expand(goal))
    steps = {number: bits for number, bits in tracing.earlier.items() if number <= len(plan.steps)}
    return PartialOrder(plan.steps, tuple(tracing.links), reduction(steps))


class CausalTrace:
    """The trace of a plan from `world` to its goal; `world` stays unchanged.

    Args:
        world: the present world, with derived facts.
        changing: the predicates and functions that steps change; `None` if they are unknown.

    Attributes:
        links: the causal links, in the order of the users.
        earlier: the steps that must end before each step, as bits.
    """

    def __init__(self, world: World, changing: Names | None = None) -> None:
        self._changing = changing
        self.links: list[CausalLink] = []
        self.earlier: dict[int, int] = defaultdict(int)
        self._base, self._schema = world, world.schema
        self._ahead = Overlay(world)
        self._pending: dict[Fact, bool] = {}
        self._facts = _Records(world)
        self._numbers: dict[Fact, _Number] = defaultdict(_Number)

    def take(self, number: int, step: PlanStep, domain: PlanningDomain) -> None:
        """Add the step with number `number` to the trace.

        Raises:
            InputError: the step is not applicable.
        """
        action, ground = domain.action(step), domain.ground(step)
        self._check_types(action, step)
        known, before = KnownStep.of(ground, step, action, self._schema), len(self.links)
        for condition, literal in known.needs:
            if literal is not None:
                self._need(number, condition, literal, step)
            else:
                self._need_all(number, condition, step)
        if known.makes is None:
            self._take_in_world(number, step, action, domain, ground.effect)
        else:
            self._make(number, known.makes)
            self._pending.update(known.changes)
        if not known.plain:
            self._unite_links(before)

    def _take_in_world(
        self, number: int, step: PlanStep, action: PlanningAction, domain: PlanningDomain, effect: Effect
    ) -> None:
        """Add those changes of a step that depend on the simulated world, and apply them to that world."""
        doing = _doing(action, step, effect, domain, self._world)
        for condition in dict.fromkeys(doing.conditions):
            if holds(condition, self._world, {}):  # otherwise the start of the step itself makes the condition true
                self._need_support(number, condition, step)
        for fluent in doing.reads:
            self._rely(number, fluent)
        self._make(number, tuple(doing.makes))
        self._set(number, doing)
        plain = action.timed is None and not doing.numbers
        world = self._world
        made = doing.delta() if plain else apply_effect(effect, world)
        for fluent, now in made.values.items():
            before = world.value(fluent.predicate, fluent.args)
            if isinstance(now, int | float) and isinstance(before, int | float):
                self._numbers[fluent].moves[number] = now - before
        world.apply(made)
        for literal in doing.makes:  # the end of the step may delete a fact that its start adds
            self._facts[literal.fact].holds = world.holds(literal.fact.predicate, literal.fact.args)

    def reach(self, user: int, goal: Expression) -> None:
        """Add the goal as the last user of conditions.

        Raises:
            InputError: the goal does not hold.
        """
        before = len(self.links)
        self._need_all(user, goal, None)
        self._unite_links(before)

    def _unite_links(self, since: int) -> None:
        """Remove repeated links from index `since`, because a condition may occur several times in a step or goal."""
        self.links[since:] = dict.fromkeys(self.links[since:])

    @property
    def _world(self) -> Overlay:
        """The simulated world after all steps added so far."""
        if self._pending:
            added = tuple([fact for fact, so in self._pending.items() if so])
            removed = tuple([fact for fact, so in self._pending.items() if not so])
            self._pending.clear()
            self._ahead.apply(Delta(added=added, removed=removed))
        return self._ahead

    def _check_types(self, action: PlanningAction, step: PlanStep) -> None:
        fitting, type_of = self._schema.fitting, self._base.type_of
        for parameter, arg in zip(action.parameters, step.args, strict=True):
            if type_of(arg) not in fitting(parameter.types):
                raise InputError(f"{step} is not possible: '{arg}' is no {' or '.join(parameter.types) or 'object'}")

    def _need(self, user: int, condition: Expression, literal: Literal, whose: PlanStep | None) -> None:
        """Record that a step, or the goal, needs a literal; raise `InputError` if the literal is false."""
        wanted, record = literal.positive, self._facts[literal.fact]
        if record.holds is not wanted:
            raise _missing(condition, whose)
        provider = record.since[wanted]
        self.links.append(CausalLink(provider, condition, user))
        record.users[wanted] |= 1 << user
        if provider:
            self.earlier[user] |= 1 << provider

    def _need_all(self, user: int, condition: Expression, whose: PlanStep | None) -> None:
        """Record that a step, or the goal, needs all parts of a ground condition."""
        for part in ground_conjuncts(condition, self._base):  # quantifiers range over objects, which no step changes
            literal = literal_of(part, self._schema)
            if literal is None:
                self._need_support(user, part, whose)
            else:
                self._need(user, part, literal, whose)

    def _need_support(self, user: int, condition: Expression, whose: PlanStep | None) -> None:
        """Record that a step, or the goal, needs a ground condition of any form; raise `InputError` if it is false."""
        found = support(condition, self._world, self._latest, self._changing)
        if found is None:
            raise _missing(condition, whose)
        if not found:  # no step can change the condition
            return
        providers = {one for ground in found for one in self._providers(ground) if self._helps(one, ground, condition)}
        self.links += [CausalLink(one, condition, user) for one in sorted(providers - {PRESENT} or {PRESENT})]
        for ground in found:
            self._rely(user, ground)

    def _rely(self, user: int, ground: Ground) -> None:
        for provider in self._providers(ground):
            if provider:
                self.earlier[user] |= 1 << provider
        if isinstance(ground, Literal):
            self._facts[ground.fact].users[ground.positive] |= 1 << user
        elif isinstance(ground, Unlisted):
            self._facts.rely_on_absence(ground.predicate, user)
        else:
            self._numbers[ground].users |= 1 << user

    def _make(self, number: int, makes: Iterable[Literal]) -> None:
        """Order the step after users and makers of the opposite literals, and record its own literals as true."""
        records = [(self._facts[literal.fact], literal.positive) for literal in makes]
        own = 1 << number
        for record, positive in records:
            self.earlier[number] |= record.users[not positive] | record.makers[not positive]
            if record.holds is not positive:
                record.since[positive] = number
        for record, positive in records:
            record.makers[positive] |= own
            if record.makers[not positive] & own:  # the step makes the fact both false and true
                record.since[:] = number, number
            record.holds = positive or bool(record.makers[True] & own)
        self.earlier[number] &= ~own

    def _set(self, number: int, doing: Changes) -> None:
        for fluent, adds in doing.numbers.items():
            known = self._numbers[fluent]
            others = known.assigners if adds else known.assigners | known.adders
            self.earlier[number] |= (known.users | others) & ~(1 << number)
            if adds:
                known.adders |= 1 << number
            else:
                known.assigners |= 1 << number

    def _providers(self, ground: Ground) -> tuple[int, ...]:
        if isinstance(ground, Literal):
            return (self._facts[ground.fact].since[ground.positive],)
        if isinstance(ground, Unlisted):
            absent = {record.since[False] for record in self._facts.absent(ground.predicate)}
            return tuple(sorted(absent)) or (PRESENT,)
        known = self._numbers[ground]
        return tuple(_numbers(known.adders | known.assigners)) or (PRESENT,)

    def _helps(self, provider: int, ground: Ground, condition: Expression) -> bool:
        """Return whether the provider contributes to the condition; consumption of fuel, e.g., does not."""
        if not isinstance(ground, Fact) or provider == PRESENT or self._numbers[ground].assigners:
            return True
        good = favours(condition, ground, self._world)
        return good is None or good * self._numbers[ground].moves.get(provider, 0.0) > 0

    def _latest(self, found: Support) -> int:
        return max((provider for ground in found for provider in self._providers(ground)), default=PRESENT)


class _Record:
    """The history of a fact; in each list, index 0 concerns its falsehood and index 1 its truth.

    Attributes:
        holds: whether the fact is true now.
        since: the step that made the fact false or true; `PRESENT` if this is its initial state.
        makers: the steps that make the fact false or true, as bits.
        users: the steps that need the fact to be false or true, as bits.
    """

    __slots__ = ("holds", "makers", "since", "users")

    def __init__(self, *, holds: bool) -> None:
        self.holds = holds
        self.since = [PRESENT, PRESENT]
        self.makers = [0, 0]
        self.users = [0, 0]


class _Records(dict[Fact, _Record]):
    """The record of each fact, constructed on first access."""

    def __init__(self, world: World) -> None:
        super().__init__()
        self._world = world
        self._absence: dict[str, int] = defaultdict(int)  # users of all false facts of a predicate, as bits

    def __missing__(self, fact: Fact) -> _Record:
        made = self[fact] = _Record(holds=self._world.holds(fact.predicate, fact.args))
        if not made.holds:
            made.users[False] = self._absence.get(fact.predicate, 0)
        return made

    def absent(self, predicate: str) -> list[_Record]:
        """Return the records of the false facts of a predicate."""
        return [record for fact, record in self.items() if fact.predicate == predicate and not record.holds]

    def rely_on_absence(self, predicate: str, user: int) -> None:
        """Record that a step needs all false facts of a predicate to stay false, also those without a record."""
        for record in self.absent(predicate):
            record.users[False] |= 1 << user
        self._absence[predicate] |= 1 << user


@dataclass(slots=True)
class _Number:
    """The history of a numeric fluent.

    Attributes:
        users, adders, assigners: the steps that read the number, only add to it, or change it in other ways, as bits.
        moves: the increase by each step.
    """

    users: int = 0
    adders: int = 0
    assigners: int = 0
    moves: dict[int, float] = field(default_factory=dict)


def _changing(plan: Plan, domain: PlanningDomain) -> Names:
    """Return the names of the predicates and functions that the steps change."""
    actions = {step.action: domain.action(step) for step in plan.steps}.values()
    return frozenset(name for action in actions for name in changed_names(action))


def _doing(action: PlanningAction, step: PlanStep, effect: Effect, domain: PlanningDomain, world: World) -> Changes:
    if action.timed is None:
        return changes(effect, world)
    timed, bindings = action.timed, domain.bindings(step)
    start, end = (substitute_effect(e, bindings) for e in (timed.start_effect, timed.end_effect))
    return changes(end, world, after=start)


def _missing(condition: Expression, whose: PlanStep | None) -> InputError:
    return InputError(f"the plan does not lead to the goal: {whose or 'the goal'} needs {to_text(condition)}")


def _numbers(bits: int) -> Iterator[int]:
    while bits:
        lowest = bits & -bits
        yield lowest.bit_length() - 1
        bits ^= lowest
