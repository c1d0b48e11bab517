"""Causal tracing: record for each condition of a plan the step that establishes it, and de-order the steps (S1.5).

*De-ordering* keeps only the ordered pairs of the plan with a reason (Bäckström 1998, *Computational aspects of
reordering plans*). The reasons:

- Link: a step needs a condition that an earlier step establishes.
- Threat: a later step falsifies a condition that an earlier step needs.
- Conflict: one step makes a fact true that the other makes false, or both change a number and do not commute.

Every linearization then takes the same steps to the same end. A fact that a step both deletes and adds counts as false
in between, so that two such steps never overlap.

Sets of steps are bits, and each fact has one record, so that the cost of a step depends on its own facts. The needs and
changes of most steps are plain facts in every world, and are cached for each step. Other steps are evaluated in the
simulated world.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from knowledge_base.errors import InputError
from knowledge_base.facts import Delta, Fact
from knowledge_base.language.checking.vocabulary import Vocabulary
from knowledge_base.language.evaluation.evaluator import apply_effect, holds
from knowledge_base.language.evaluation.world import World
from knowledge_base.language.syntax.effect import Add, AllOf, Delete, Effect, effect_parts, substitute_effect
from knowledge_base.language.syntax.expression import And, Atom, Constant, Expression, Not, Variable
from knowledge_base.language.syntax.identity_cache import IdentityCache
from knowledge_base.language.syntax.text import to_text
from knowledge_base.world.overlay import Overlay
from planning.domain import GroundStep, PlanningAction, PlanningDomain
from planning.ordering.partial_order import PRESENT, CausalLink, PartialOrder, reduction
from planning.ordering.step_dependencies import Changes, Ground, Support, changes, conjuncts, favours, support
from planning.plan import Plan, PlanStep
from planning.problem.conditions import Literal
from planning.problem.derived import derivation


def causal_links(plan: Plan, domain: PlanningDomain, world: World, goal: Expression) -> tuple[CausalLink, ...]:
    """Return the causal links of a plan from `world` to the goal, by user.

    The plan leads to the goal as long as all of them hold.

    Raises:
        InputError: the plan does not lead to the goal.
    """
    return deordered(plan, domain, world, goal).links


def deordered(plan: Plan, domain: PlanningDomain, world: World, goal: Expression) -> PartialOrder:
    """Return the plan without ordered pairs that have no reason.

    Every linearization leads from `world` to the goal. The result is not always the least such order, which is NP-hard
    to find.

    Raises:
        InputError: the plan does not lead to the goal; `planning.validation.validate` returns the step and the reason.
    """
    derived = derivation(domain)
    tracing = CausalTrace(derived.world(world))
    for number, step in enumerate(plan.steps, start=1):
        tracing.take(number, step, derived.domain)
    tracing.reach(len(plan.steps) + 1, derived.expand(goal))
    links = tuple(dict.fromkeys(CausalLink(*link) for link in tracing.links))
    steps = {number: bits for number, bits in tracing.earlier.items() if number <= len(plan.steps)}
    return PartialOrder(plan.steps, links, reduction(steps))


class CausalTrace:
    """The trace of a plan that leads from `world`, which it does not change, to its goal.

    Args:
        world: the present, with derived facts.

    Attributes:
        links: provider, condition and user of each causal link, in the order of the users.
        earlier: for each step, the steps that must end before it, as bits.
    """

    def __init__(self, world: World) -> None:
        self.links: list[tuple[int, Expression, int]] = []
        self.earlier: dict[int, int] = defaultdict(int)
        self._base = world
        self._ahead = Overlay(world)
        self._pending: dict[Fact, bool] = {}
        self._facts: dict[Fact, _Record] = {}
        self._numbers: dict[Fact, _Number] = defaultdict(_Number)

    def take(self, number: int, step: PlanStep, domain: PlanningDomain) -> None:
        """Add step number `number` to the trace.

        Raises:
            InputError: the step is not applicable.
        """
        action, ground = domain.action(step), domain.ground(step)
        self._check_types(action, step)
        known = _Known.of(ground, action, self._base.schema)
        for condition, literal in known.needs:
            if literal is not None:
                self._need(number, condition, literal, step)
            else:
                self._need_all(number, condition, step)
        if known.makes is not None:
            self._make(number, known.makes)
            self._pending.update(known.changes)
            return
        doing = _doing(action, step, ground.effect, domain, self._world)
        for condition in dict.fromkeys(doing.conditions):
            if holds(condition, self._world, {}):  # otherwise the step's own start makes it true
                self._need_support(number, condition, step)
        for fluent in doing.reads:
            self._rely(number, fluent)
        self._make(number, tuple(doing.makes))
        self._set(number, doing)
        plain = action.timed is None and not doing.numbers
        world = self._world
        made = doing.delta() if plain else apply_effect(ground.effect, world)
        for fluent, now in made.values.items():
            before = world.value(fluent.predicate, fluent.args)
            if isinstance(now, int | float) and isinstance(before, int | float):
                self._numbers[fluent].moves[number] = now - before
        world.apply(made)
        for literal in doing.makes:  # the end may delete a fact that the start adds
            self._record(literal.fact).holds = world.holds(literal.fact.predicate, literal.fact.args)

    def reach(self, user: int, goal: Expression) -> None:
        """Add the goal as the last user.

        Raises:
            InputError: the goal does not hold.
        """
        self._need_all(user, goal, None)

    @property
    def _world(self) -> Overlay:
        """The simulated world after the steps so far."""
        if self._pending:
            added = tuple([fact for fact, so in self._pending.items() if so])
            removed = tuple([fact for fact, so in self._pending.items() if not so])
            self._pending.clear()
            self._ahead.apply(Delta(added=added, removed=removed))
        return self._ahead

    def _check_types(self, action: PlanningAction, step: PlanStep) -> None:
        fitting, type_of = self._base.schema.fitting, self._base.type_of
        for parameter, arg in zip(action.parameters, step.args, strict=True):
            if type_of(arg) not in fitting(parameter.types):
                raise InputError(f"{step} is not possible: '{arg}' is no {' or '.join(parameter.types) or 'object'}")

    def _record(self, fact: Fact) -> _Record:
        found = self._facts.get(fact)
        if found is None:
            found = self._facts[fact] = _Record(self._base.holds(fact.predicate, fact.args))
        return found

    def _need(self, user: int, condition: Expression, literal: Literal, whose: PlanStep | None) -> None:
        """Record that a step, or the goal, needs a literal."""
        wanted, record = literal.positive, self._record(literal.fact)
        if record.holds is not wanted:
            raise _missing(condition, whose)
        provider = record.since[wanted]
        self.links.append((provider, condition, user))
        record.users[wanted] |= 1 << user
        if provider:
            self.earlier[user] |= 1 << provider

    def _need_all(self, user: int, condition: Expression, whose: PlanStep | None) -> None:
        """Record that a step, or the goal, needs all parts of a ground condition now."""
        for part in conjuncts(condition, self._base):  # reads only objects, which no step changes
            literal = _literal(part, self._base.schema)
            if literal is None:
                self._need_support(user, part, whose)
            else:
                self._need(user, part, literal, whose)

    def _need_support(self, user: int, condition: Expression, whose: PlanStep | None) -> None:
        """Record that a step, or the goal, needs a ground condition of any form now."""
        found = support(condition, self._world, self._latest)
        if found is None:
            raise _missing(condition, whose)
        if not found:  # no step can change it
            return
        providers = {one for ground in found for one in self._providers(ground) if self._helps(one, ground, condition)}
        self.links += [(one, condition, user) for one in sorted(providers - {PRESENT} or {PRESENT})]
        for ground in found:
            self._rely(user, ground)

    def _rely(self, user: int, ground: Ground) -> None:
        for provider in self._providers(ground):
            if provider:
                self.earlier[user] |= 1 << provider
        if isinstance(ground, Literal):
            self._record(ground.fact).users[ground.positive] |= 1 << user
        else:
            self._numbers[ground].users |= 1 << user

    def _make(self, number: int, makes: Iterable[Literal]) -> None:
        """Order the step after users and makers of the opposite; a fact both deleted and added is true at the end."""
        records = [(self._record(literal.fact), literal.positive) for literal in makes]
        own = 1 << number
        for record, positive in records:
            self.earlier[number] |= record.users[not positive] | record.makers[not positive]
            if record.holds is not positive:
                record.since[positive] = number
        for record, positive in records:
            record.makers[positive] |= own
            if record.makers[not positive] & own:  # the step makes it both false and true
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
            return (self._record(ground.fact).since[ground.positive],)
        known = self._numbers[ground]
        return tuple(_numbers(known.adders | known.assigners)) or (PRESENT,)

    def _helps(self, provider: int, ground: Ground, condition: Expression) -> bool:
        """Return whether the provider contributes to the condition; consuming fuel does not provide the rest."""
        if isinstance(ground, Literal) or provider == PRESENT or self._numbers[ground].assigners:
            return True
        good = favours(condition, ground, self._world)
        return good is None or good * self._numbers[ground].moves.get(provider, 0.0) > 0

    def _latest(self, found: Support) -> int:
        return max((provider for ground in found for provider in self._providers(ground)), default=PRESENT)


@dataclass(slots=True)
class _Record:
    """The history of a fact; index 0 of each list is about its falsehood, index 1 about its truth.

    Attributes:
        holds: whether the fact holds now.
        since: the step that made it so; `PRESENT` if it was so initially.
        makers: the steps that make it so, as bits.
        users: the steps that rely on it, as bits.
    """

    holds: bool
    since: list[int] = field(default_factory=lambda: [PRESENT, PRESENT])
    makers: list[int] = field(default_factory=lambda: [0, 0])
    users: list[int] = field(default_factory=lambda: [0, 0])


@dataclass(slots=True)
class _Number:
    """The history of a number.

    Attributes:
        users, adders, assigners: steps, as bits, that read it, that only add to it, and that change it in other ways.
        moves: the increase by each step.
    """

    users: int = 0
    adders: int = 0
    assigners: int = 0
    moves: dict[int, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Known:
    """The needs and changes of a step that are the same in every world.

    Attributes:
        needs: its conditions; with the literal if the condition is one.
        makes: the literals that it makes true; `None` if they depend on the world.
        changes: the truth values of their facts afterwards.
    """

    needs: tuple[tuple[Expression, Literal | None], ...]
    makes: tuple[Literal, ...] | None
    changes: dict[Fact, bool]

    @staticmethod
    def of(step: GroundStep, action: PlanningAction, schema: Vocabulary) -> _Known:
        """Return the cached needs and changes: a new plan shares most steps with the last."""
        return _known.find(step, schema) or _known.keep(step, schema, _Known._of(step, action, schema))

    @staticmethod
    def _of(step: GroundStep, action: PlanningAction, schema: Vocabulary) -> _Known:
        parts = dict.fromkeys(_flat(step.condition))
        needs = tuple([(part, _literal(part, schema)) for part in parts])
        if not _always_the_same(action, schema):
            return _Known(needs, None, {})
        leaves = [leaf for leaf in effect_parts(step.effect) if isinstance(leaf, Add | Delete)]
        makes = dict.fromkeys([Literal(_fact(leaf.atom), isinstance(leaf, Add)) for leaf in leaves])
        deleted = {one.fact: False for one in makes if not one.positive}
        return _Known(needs, tuple(makes), {**deleted, **{one.fact: True for one in makes if one.positive}})


_known: IdentityCache[GroundStep, _Known] = IdentityCache(size=1024)


def _doing(action: PlanningAction, step: PlanStep, effect: Effect, domain: PlanningDomain, world: World) -> Changes:
    if action.timed is None:
        return changes(effect, world)
    timed, bindings = action.timed, domain.bindings(step)
    start, end = (substitute_effect(e, bindings) for e in (timed.start_effect, timed.end_effect))
    return changes(end, world, after=start)


def _flat(e: Expression) -> Iterator[Expression]:
    if isinstance(e, And):
        for part in e.parts:
            yield from _flat(part)
    else:
        yield e


def _literal(e: Expression, schema: Vocabulary) -> Literal | None:
    atom = e.body if isinstance(e, Not) else e
    if isinstance(atom, Atom) and atom.predicate in schema.predicates and _is_ground(atom):
        return Literal(_fact(atom), atom is e)
    return None


def _is_ground(atom: Atom) -> bool:
    return all(isinstance(term, Constant) for term in atom.args)


def _fact(atom: Atom) -> Fact:
    return Fact(atom.predicate, tuple([term.value for term in atom.args if isinstance(term, Constant)]))


def _always_the_same(action: PlanningAction, schema: Vocabulary) -> bool:
    """Return whether the action only adds and deletes facts, unconditionally, with valid types for all arguments."""
    types = {parameter.name: parameter.types for parameter in action.parameters}
    return action.timed is None and all(
        isinstance(part, AllOf) or (isinstance(part, Add | Delete) and _may_be_told(part.atom, types, schema))
        for part in effect_parts(action.effect)
    )


def _may_be_told(atom: Atom, types: dict[str, tuple[str, ...]], schema: Vocabulary) -> bool:
    signature = schema.predicates.get(atom.predicate)
    if signature is None or atom.predicate in schema.functional or len(atom.args) != len(signature.parameters):
        return False
    for term, parameter in zip(atom.args, signature.parameters, strict=True):
        if not isinstance(term, Variable) or term.name not in types:
            return False
        if not schema.fitting(types[term.name]) <= schema.fitting(parameter.types):
            return False
    return True


def _missing(condition: Expression, whose: PlanStep | None) -> InputError:
    return InputError(f"the plan does not lead to the goal: {whose or 'the goal'} needs {to_text(condition)}")


def _numbers(bits: int) -> Iterator[int]:
    while bits:
        lowest = bits & -bits
        yield lowest.bit_length() - 1
        bits ^= lowest
