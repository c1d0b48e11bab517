"""Plan steps of a generated plot: conditions, effects, used components, and the state that executes each step."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from dsc.dynamic.experience import Experience
from dsc.dynamic.library import Library
from dsc.dynamic.steps import offers_for
from dsc.events import SKILL_FAILURES
from dsc.model.actions import Configure, Switch, Trigger, component_of
from dsc.model.plot import ActionPlot
from dsc.model.rules import Rule
from dsc.model.states import DynamicState, SubmachineState
from dsc.sequencer.dispatcher import DEFAULT_WITHIN
from knowledge_base.errors import UnknownNameError
from knowledge_base.facts import Value
from knowledge_base.language.evaluation.lookups import conjuncts
from knowledge_base.language.syntax.effect import Add, AllOf, Delete, Effect
from knowledge_base.language.syntax.expression import (
    And,
    Arithmetic,
    Comparison,
    Constant,
    Expression,
    Not,
    Or,
    Term,
    substitute,
)
from knowledge_base.language.syntax.rewriting import names_of
from knowledge_base.owner_cache import Owner, cache_on_owner
from planning.model.domain import PlanningAction, PlanningDomain
from planning.model.plan import PlanStep
from planning.problem.expressions import changed


@dataclass(frozen=True, slots=True)
class Usage:
    """The components that a set of plots may use in any run.

    Attributes:
        components: the names of the components that the plots call, configure or switch.
        anything: whether the plots may use other components too, since they plan or use a plot from a variable.
        seconds: the sum of the time limits of all skill calls, in seconds.
    """

    components: frozenset[str] = frozenset()
    anything: bool = False
    seconds: float = 0.0

    def clashes(self, other: Usage, shared: Iterable[str]) -> bool:
        """Return whether both usages may need one component at one time; components in `shared` do not count."""
        return self.anything or other.anything or bool((self.components & other.components).difference(shared))


def usage(plots: Iterable[ActionPlot], library: Library, rules: Iterable[Rule] = ()) -> Usage:
    """Return the usage of the plots, and of the plots and commands of rules that may apply to them.

    Raises:
        UnknownNameError: a plot uses a missing plot.
    """
    found: dict[str, ActionPlot] = {}
    waiting = list(plots)
    applied = _find_applied(rules, waiting)
    waiting += [library.plot(rule.do.use) for rule in applied if rule.do.use]
    while waiting:
        plot = waiting.pop()
        if plot.name not in found:
            found[plot.name] = plot
            waiting += [library.plot(name) for name in sorted(plot.uses()) if name in library]
            waiting += offers_for(plot, library)
    reaching = (action for plot in found.values() for action in plot.actions())
    actions = [action for action in reaching if isinstance(action, Trigger | Configure | Switch)]
    actions += [one for rule in applied for one in rule.do.command if isinstance(one, Configure | Switch)]
    names = {name for action in actions if (name := component_of(action)) is not None}
    limits = [action.within or DEFAULT_WITHIN for action in actions if isinstance(action, Trigger)]
    return Usage(frozenset(names), any(map(_is_open, found.values())), sum(limits))


def _find_applied(rules: Iterable[Rule], plots: Sequence[ActionPlot]) -> list[Rule]:
    """Return the rules that may apply to a step with these plots as candidates."""
    emitted = SKILL_FAILURES.union(*(plot.emits for plot in plots))
    actions = {plot.implements for plot in plots}
    named = [rule for rule in rules if not rule.steps or actions.intersection(rule.steps)]
    return [rule for rule in named if rule.on is None or rule.on in emitted]


def fitting(plots: Iterable[ActionPlot], bindings: Mapping[str, Value]) -> tuple[ActionPlot, ...]:
    """Return the plots whose conditions may be true for these arguments; all plots if there is no such plot."""
    plots = tuple(plots)
    return tuple(plot for plot in plots if plot.when is None or not _is_false(plot.when, bindings)) or plots


def _is_false(e: Expression, bindings: Mapping[str, Value]) -> bool:
    match e:
        case And(parts):
            return any(_is_false(part, bindings) for part in parts)
        case Comparison("=" | "!=" as operator):
            sides = [substitute(side, bindings) for side in (e.left, e.right)]
            values = [side.value for side in sides if isinstance(side, Constant)]
            return len(values) == len(sides) and (values[0] == values[1]) is not (operator == "=")
        case _:
            return False


def _is_open(plot: ActionPlot) -> bool:
    states = [state for _, state, _ in plot.walk()]
    planned = any(isinstance(state, DynamicState) and state.goal is not None for state in states)
    return planned or any(isinstance(state, SubmachineState) and state.use.startswith("?") for state in states)


PATIENCE = 2
"""The factor on a step's duration, or on the sum of its skills' time limits, after which a step is interrupted."""
_MOST_CARRIERS = 8
_MOST_CARRIED = 1024  # steps; a plan for 50 items has about 130 steps
_CONFIRM = ActionPlot.model_fields["confirm"].default


@dataclass(frozen=True)
class CarriedStep(Owner):
    """A step of a plan, with everything that its states need.

    Attributes:
        text: the step in PDDL.
        needed: the ground conditions that must hold when the step begins.
        over_all: the conditions that must hold during the step, except conditions that the step itself changes.
        effect: the effect of the step.
        expected: the conditions to observe after the step; empty if effects are assumed.
        assumed: whether the effects are asserted after the step, instead of observed.
        confirm: the time limit, in seconds, for the observation of the expected conditions.
        seconds: the time limit of the step, in seconds; `None` if unknown.
        content: the content of the step's state: the candidates, or the plot that it uses.
        outcomes: the outcome events of the step other than `done`.
        usage: the components that the step uses.
    """

    text: str
    needed: tuple[Expression, ...]
    over_all: tuple[Expression, ...]
    effect: Effect
    expected: tuple[Expression, ...]
    content: Mapping[str, Any]
    assumed: bool = False
    confirm: float = _CONFIRM
    seconds: Term | None = None
    outcomes: frozenset[str] = frozenset()
    usage: Usage = field(default_factory=Usage)


class Carrier:
    """Constructor of carried steps: finds the plots that execute each step, and the components that these plots use.

    Args:
        domain: the planning domain.
        library: the plots that implement planning actions.
        rules: the contingency rules, which may use further plots and components.
    """

    def __init__(self, domain: PlanningDomain, library: Library, rules: Iterable[Rule]) -> None:
        self._domain = domain
        self._library = library.copy()
        self.rules = tuple(rules)
        self._usage: dict[tuple[str, ...], Usage] = {}  # most steps share their candidates
        self._carried: dict[tuple[PlanStep, tuple[str, ...]], CarriedStep] = {}

    @staticmethod
    def of(domain: PlanningDomain, library: Library, rules: Sequence[Rule]) -> Carrier:
        """Return the carrier of an earlier plan if rules and experience are equal, since plans share most steps."""
        carriers = _carriers(domain)
        known = carriers.get(id(library.plots))  # its copy of the library keeps them, so that their id stays in use
        if known is None or not known.suits(library, rules):
            if len(carriers) >= _MOST_CARRIERS:
                carriers.clear()
            known = carriers[id(library.plots)] = Carrier(domain, library, rules)
        return known

    def suits(self, library: Library, rules: Sequence[Rule]) -> bool:
        """Return whether rules and experience equal those of this carrier."""
        return self.rules == tuple(rules) and self._library.experience.tries is library.experience.tries

    def carried(self, step: PlanStep) -> CarriedStep:
        """Return the step as a dynamic state whose candidates implement its action and fit its arguments.

        Raises:
            UnknownNameError: no plot implements the action, or a plot uses a missing plot.
        """
        plots = implementing(step, self._library)
        key = step, tuple([plot.name for plot in plots])
        known = self._carried.get(key)
        if known is None:
            if len(self._carried) >= _MOST_CARRIED:
                self._carried.clear()
            known = self._carried[key] = self._newly_carried(step, plots)
        return known

    def _newly_carried(self, step: PlanStep, plots: Iterable[ActionPlot]) -> CarriedStep:
        bindings = self._domain.bindings(step)
        candidates = fitting(plots, bindings)
        names = tuple(plot.name for plot in candidates)
        if names not in self._usage:
            self._usage[names] = usage(candidates, self._library, self.rules)
        used = self._usage[names]
        taken = {name for plot in candidates for name in plot.parameters}
        content = {"dynamic": names, "with": {name: value for name, value in bindings.items() if name in taken}}
        if (choice := _choice(candidates, self._library.experience)) is not None:
            content["choose"] = choice
        return _step(
            step, self._domain, content, None if used.anything else PATIENCE * used.seconds,
            assumed=all(plot.effects == "assumed" for plot in candidates),
            confirm=max(plot.confirm for plot in candidates),
            outcomes=frozenset(event for plot in candidates for event in plot.emits), usage=used,
        )  # fmt: skip


def _choice(candidates: Collection[ActionPlot], experience: Experience) -> str | None:
    """Return how a step chooses among several candidates: by a term that all declare, or by experience; else `None`."""
    if len(candidates) == 1:
        return None
    for name in ("utility", "cost", "priority"):
        if all(name in plot.scores() for plot in candidates):
            return name
    return "learned" if any(experience.of(plot.implements or "", plot.name, ()) for plot in candidates) else None


@cache_on_owner
def _carriers(domain: PlanningDomain) -> dict[int, Carrier]:  # noqa: ARG001  its owner
    """Return the carriers of the domain, by the identity of their plots."""
    return {}


def sketched(step: PlanStep, domain: PlanningDomain) -> CarriedStep:
    """Return the step as a state with a plot of the action's name, which an author must write."""
    return _step(step, domain, {"use": step.action, "with": domain.bindings(step)}, None)


def implementing(step: PlanStep, library: Library) -> tuple[ActionPlot, ...]:
    """Return the plots that implement the action of a step.

    Raises:
        UnknownNameError: no plot implements the action.
    """
    found = library.implementing(step.action)
    if not found:
        known = [plot.implements for plot in library if plot.implements]
        raise UnknownNameError(
            f"no plot implements the planning action '{step.action}'", found=step.action, valid=known
        )
    return found


def expectation(effect: Effect, bindings: Mapping[str, Value]) -> Expression:
    """Return the condition that is true after an effect in every world."""
    ground = [(substitute(part.atom, bindings), isinstance(part, Add)) for part in _literals(effect)]
    added = [atom for atom, adds in ground if adds]
    return And((*added, *(Not(atom) for atom, adds in ground if not adds and atom not in added)))


def _step(
    step: PlanStep, domain: PlanningDomain, content: Mapping[str, Any], seconds: float | None, *,
    assumed: bool = False, **more: Any,
) -> CarriedStep:  # fmt: skip
    action, bindings, ground = domain.action(step), domain.bindings(step), domain.ground(step)
    limit = _limit(action, bindings)
    if limit is None and seconds:
        limit = Constant(seconds)
    return CarriedStep(
        text=str(step),
        needed=tuple([one for one in conjuncts(ground.condition) if not _is_decided(one)]),
        over_all=tuple(substitute(one, bindings) for one in _find_watched(action)),
        effect=ground.effect,
        expected=() if assumed else tuple(conjuncts(expectation(action.effect, bindings))),
        content=content, assumed=assumed, seconds=limit, **more,
    )  # fmt: skip


def _is_decided(e: Expression) -> bool:
    """Return whether the condition is true in every world, e.g. the expansion of a recursive predicate."""
    match e:
        case Comparison("=", Constant(one), Constant(other)):
            return one == other
        case And(those):
            return all(map(_is_decided, those))
        case Or(those):
            return any(map(_is_decided, those))
        case _:
            return False


def _limit(action: PlanningAction, bindings: Mapping[str, Value]) -> Term | None:
    """Return the time limit that follows from the action's duration; `None` without an upper bound."""
    if action.duration is None or action.duration.most == Constant(float("inf")):
        return None
    match substitute(action.duration.most, bindings):
        case Constant(int() | float() as most):
            return Constant(PATIENCE * most)
        case most:
            return Arithmetic("*", (Constant(PATIENCE), most))


def _find_watched(action: PlanningAction) -> Iterator[Expression]:
    """Yield the conditions over all, except conditions that the action itself changes."""
    if action.timed is not None:
        effects = (action.timed.start_effect, action.timed.end_effect)
        own = {name for effect in effects for name in changed(effect)}
        yield from (one for one in conjuncts(action.timed.over_all) if not own.intersection(names_of(one)))


def _literals(effect: Effect) -> list[Add | Delete]:
    if isinstance(effect, AllOf):
        return [literal for part in effect.parts for literal in _literals(part)]
    return [effect] if isinstance(effect, Add | Delete) else []
