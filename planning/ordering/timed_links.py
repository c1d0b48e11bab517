"""Causal links of a plan with a schedule, found by simulation on the time line.

A step may need conditions at its start, over all and at its end, and may establish conditions at its start and end. A
step that begins later can therefore establish a condition that an earlier step needs at its end.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from knowledge_base.errors import InputError
from knowledge_base.facts import Fact
from knowledge_base.language.evaluation.evaluator import apply_effect, holds
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.effect import AllOf, Effect, substitute_effect
from knowledge_base.language.syntax.expression import And, Expression, substitute
from knowledge_base.language.syntax.text import to_text
from knowledge_base.world.overlay import Overlay
from planning.model.domain import PlanningDomain
from planning.model.plan import Plan, PlanStep, Timing
from planning.model.timeline import moment
from planning.ordering.partial_order import PRESENT, CausalLink, PartialOrder, scheduled
from planning.ordering.step_dependencies import (
    Changes,
    Ground,
    Support,
    Unlisted,
    changes,
    favours,
    ground_conjuncts,
    support,
)
from planning.problem.conditions import Literal
from planning.problem.derived import derivation

_NOTHING: Expression = And(())


@dataclass(frozen=True, slots=True)
class _End:
    """The start or end of a step: the condition before it, its effect, and the condition that must hold after it."""

    number: int
    step: PlanStep
    condition: Expression
    effect: Effect
    lasting: Expression = _NOTHING


def linked(plan: Plan, domain: PlanningDomain, world: World, goal: Expression) -> PartialOrder:
    """Return the order of the plan's schedule, with its causal links.

    Raises:
        InputError: the plan does not lead to the goal.
    """
    derived = derivation(domain)
    tracing = _Tracing(Overlay(derived.world(world)))
    moments: dict[int, list[_End]] = defaultdict(list)
    for number, (step, timing) in enumerate(zip(plan.steps, plan.schedule, strict=True), start=1):
        for seconds, end in _ends(number, step, timing, derived.domain):
            moments[moment(seconds)].append(end)
    for now in sorted(moments):
        tracing.happen(moments[now])
    tracing.need(len(plan.steps) + 1, derived.expand(goal), "the goal")
    links = sorted(dict.fromkeys(tracing.links), key=lambda link: (link.user, link.provider))
    return replace(scheduled(plan), links=tuple(links))


def _ends(number: int, step: PlanStep, timing: Timing, domain: PlanningDomain) -> Iterator[tuple[float, _End]]:
    action, bindings = domain.action(step), domain.bindings(step)
    timed = action.timed

    def end(condition: Expression, effect: Effect, lasting: Expression = _NOTHING) -> _End:
        condition, lasting = substitute(condition, bindings), substitute(lasting, bindings)
        return _End(number, step, condition, substitute_effect(effect, bindings), lasting)

    if timed is None:
        yield timing.start, end(action.precondition, action.effect)
        return
    yield timing.start, end(timed.start, timed.start_effect, timed.over_all)
    yield timing.end, end(timed.end, timed.end_effect)


@dataclass(slots=True)
class _Tracing:
    """The simulation of a schedule, with the steps that established each fact and number.

    Attributes:
        world: the simulated world at the present time of the simulation.
        links: the causal links found so far.
        makers: the steps that made a literal true or changed a number; no entry if it holds initially.
        moves: the increase of each number by each step.
        assigned: the numbers that some step changed other than by addition.
    """

    world: Overlay
    links: list[CausalLink] = field(default_factory=list)
    makers: dict[Ground, list[int]] = field(default_factory=lambda: defaultdict(list))
    moves: dict[tuple[Fact, int], float] = field(default_factory=lambda: defaultdict(float))
    assigned: set[Fact] = field(default_factory=set)

    def happen(self, ends: list[_End]) -> None:
        """Simulate simultaneous events; each of them is evaluated in the world before."""
        for end in ends:
            self.need(end.number, end.condition, str(end.step))
        made = [(end, changes(end.effect, self.world)) for end in ends]
        for end, doing in made:
            for condition in doing.conditions:
                if holds(condition, self.world, {}):
                    self.need(end.number, condition, str(end.step))
        delta = apply_effect(AllOf(tuple(end.effect for end in ends)), self.world)
        for end, doing in made:
            self._make(end, doing)
        self.world.apply(delta)
        for end in ends:
            self.need(end.number, end.lasting, str(end.step))

    def need(self, user: int, condition: Expression, whose: str) -> None:
        """Record that a step, or the goal, needs a condition now; own effects of a step form no links.

        Raises:
            InputError: the condition is false.
        """
        for part in dict.fromkeys(ground_conjuncts(condition, self.world)):
            found = support(part, self.world, self._latest)
            if found is None:
                raise InputError(f"the plan does not lead to the goal: {whose} needs {to_text(part)}")
            providers = {one for ground in found for one in self._providers(ground, part)}
            if found and user not in providers:
                self.links += [CausalLink(one, part, user) for one in sorted(providers - {PRESENT} or {PRESENT})]

    def _providers(self, ground: Ground, condition: Expression) -> list[int]:
        """Return the providers of the condition; a step that moves a number the wrong way, e.g. uses fuel, is none."""
        makers = self.makers.get(ground, [PRESENT])
        if isinstance(ground, Unlisted):
            return self._removers(ground.predicate)
        if isinstance(ground, Literal) or ground in self.assigned or makers == [PRESENT]:
            return makers
        good = favours(condition, ground, self.world)
        return [one for one in makers if good is None or good * self.moves[ground, one] > 0]

    def _removers(self, predicate: str) -> list[int]:
        """Return the steps that made a fact of the predicate false last."""
        made = [
            makers[-1]
            for ground, makers in self.makers.items()
            if isinstance(ground, Literal) and ground.fact.predicate == predicate and not ground.positive
        ]
        return sorted({*made}) or [PRESENT]

    def _make(self, end: _End, doing: Changes) -> None:
        for literal in doing.makes:
            fact = literal.fact
            if self.world.holds(fact.predicate, fact.args) is not literal.positive:
                self.makers[literal] = [end.number]
        made = apply_effect(end.effect, self.world).values if doing.numbers else {}
        for fluent, adds in doing.numbers.items():
            self.makers[fluent].append(end.number)
            if not adds:
                self.assigned.add(fluent)
            before, now = self.world.value(fluent.predicate, fluent.args), made.get(fluent)
            if isinstance(now, int | float) and isinstance(before, int | float):
                self.moves[fluent, end.number] += now - before

    def _latest(self, found: Support) -> int:
        return max((one for ground in found for one in self.makers.get(ground, [PRESENT])), default=PRESENT)
